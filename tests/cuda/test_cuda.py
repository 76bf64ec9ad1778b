"""The rows of a GPU against those of the processor: in numba's simulator, and on the GPU itself where there is one."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import episodes
import numpy as np
import pytest
import torch

from aframe_env import Crane, InvalidValue, Rope, Scenario, ScenarioDistribution, Told
from aframe_env.config import TaskConfig
from aframe_env.scenario import ScenarioSource
from aframe_env.simulation import Simulation

pytest.importorskip("tensordict", reason='tensordict is not installed (extra "cuda")')
pytest.importorskip("numba_cuda", reason='numba-cuda is not installed (extra "cuda")')

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """What the simulator makes of all cases: in a process of its own, since the switch is read at import."""
    file = tmp_path_factory.mktemp("cuda") / "episodes.npz"
    subprocess.run(
        # The random numbers' arithmetic overflows on purpose, of which uncompiled numpy warns.
        [sys.executable, "-W", "ignore:overflow:RuntimeWarning", episodes.__file__, file],
        env={**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(ROOT)},
        check=True,
        timeout=300,
    )
    with np.load(file) as results:
        return dict(results)


def compare(got: Callable[[str], np.ndarray], name: str) -> None:
    """Hold what a device made of a case together with the processor's."""
    expected = episodes.episodes(name, "cpu")
    for key, value in expected.items():
        assert got(key).dtype == value.dtype
        assert got(key).shape == value.shape
        # Rounding differs: the processor's fused multiply-add is two operations in the simulator.
        np.testing.assert_allclose(got(key), value, rtol=1e-6, atol=1e-12, err_msg=key)
    observation = expected["observation"]
    assert np.ptp(observation[:, :, 10], axis=0).min() > 0.1, "the drums turned"
    if name != "one sea state":
        assert expected["done"].any(axis=0).sum() >= 2, "rows have begun anew"


@pytest.mark.parametrize("name", episodes.CASES)
def test_the_simulated_device_s_episodes_are_the_processor_s(name: str, simulated: dict[str, np.ndarray]) -> None:
    compare(lambda key: simulated[f"{name}/{key}"], name)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
@pytest.mark.parametrize("name", episodes.CASES)
def test_the_device_s_episodes_are_the_processor_s(name: str) -> None:
    results = episodes.episodes(name, "cuda")
    compare(lambda key: results[key], name)


def test_ropes_with_mass_are_not_drawn_on_a_device() -> None:
    from aframe_env.cuda.rows import CudaRows

    host = Simulation(1, TaskConfig(scenario=ScenarioDistribution(crane=Crane(rope=Rope.six_strand()))))
    with pytest.raises(InvalidValue, match=r"mass_per_length = 19\.55 kg/m.*drawn on a CUDA device"):
        CudaRows(host, 1, torch.device("cpu"))


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (
            ScenarioDistribution(lag=(0.0, 0.3)),
            r"lag = \(0\.0, 0\.3\): scenarios drawn on a CUDA device",
        ),
        (ScenarioDistribution(told_mass_error=0.2), "told_mass_error = 0.2: scenarios drawn on a CUDA device"),
        (
            Scenario(told=Told(load_mass=5e4)),
            "told: load_mass = 50000.0 kg: rows on a CUDA device",
        ),
    ],
)
def test_what_is_told_wrongly_does_not_come_to_a_device(source: ScenarioSource, words: str) -> None:
    from aframe_env.cuda.rows import CudaRows

    with pytest.raises(InvalidValue, match=words):
        CudaRows(Simulation(1, TaskConfig(scenario=source)), 1, torch.device("cpu"))


def test_the_compiler_accepts_the_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """The simulator takes anything that is Python; the compiler's types and intermediate code need no GPU either."""
    from numba import complex128, float32, float64, int64, uint8, void
    from numba.cuda import dispatcher
    from numba.cuda.compiler import compile_cuda

    from aframe_env.cuda import kernels
    from agents.control import winch_cuda

    capability = (8, 0)
    monkeypatch.setattr(dispatcher, "get_current_device", lambda: SimpleNamespace(compute_capability=capability))
    vector, matrix, single, singles = float64[::1], float64[:, ::1], float32[::1], float32[:, ::1]
    rows, mask = (matrix, int64, int64, matrix), uint8[::1]
    outputs = (matrix, matrix, single, single, singles)
    tables = (vector, matrix, vector, matrix, vector, vector, vector, complex128[:, :, ::1])
    signatures: dict[Any, tuple[Any, ...]] = {
        kernels.advance: (*rows, singles, float64, *outputs),
        kernels.advance_any: (*rows, singles, float64, *outputs),
        kernels.repeat: (matrix, mask, vector, *outputs),
        kernels.draw: (*rows, mask, int64, int64[::1], *tables, *outputs),
        winch_cuda.invert: (vector, vector, float64, float64, float64, float64, vector),
    }
    for kernel, arguments in signatures.items():
        compiled = compile_cuda(kernel, void, arguments, cc=capability)
        assert compiled.signature.args == arguments
        assert not compiled.objectmode
