"""The benchmark of rows on a GPU: what it writes, on the processor in little; and what it says without a GPU."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from rich.console import Console

pytest.importorskip("rsl_rl", reason='rsl-rl-lib is not installed (extra "cuda")')

from aframe_env.dynamics import layout as at
from aframe_env.scenario import ScenarioDistribution
from benchmarks import gpu
from train.learn import ppo_rsl


def test_figures_of_a_small_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpu, "copy_bandwidth", lambda device: 1e10)
    out = tmp_path / "gpu.json"
    options = gpu.Options(rows=(3, 5), steps=2, rounds=3, targets=(-1e9, 1.1), scenarios=2, limit=1e-3, out=out)
    chosen = ppo_rsl.Options(device="cpu", n_envs=1024, n_steps=16, batch_size=8192, n_epochs=1, timesteps=40_000)
    gpu.run(options, torch.device("cpu"), chosen, Console(quiet=True))
    found = json.loads(out.read_text())
    assert [speed["rows"] for speed in found["speeds"]] == [3, 5]
    for speed in found["speeds"]:
        median = sorted(speed["steps_per_second"])[1]
        assert len(speed["steps_per_second"]) == 3
        assert speed["bandwidth_share"] == pytest.approx(median * gpu.bytes_moved(ScenarioDistribution()) / 1e10)
    assert [(o["target"], o["reached"]) for o in found["learning"]] == [(-1e9, True), (1.1, False)]


def test_bytes_moved_lie_between_a_row_s_own_slots_and_all_of_them() -> None:
    own = 2 * 8 * at.ROW_SLOTS
    assert own < gpu.bytes_moved(ScenarioDistribution()) < own + 8 * 19 * 32
    assert gpu.bytes_moved(ScenarioDistribution(components=4)) < gpu.bytes_moved(ScenarioDistribution(components=64))


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")
def test_without_a_gpu_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["benchmarks.gpu", "--out", str(tmp_path / "gpu.json")])
    with pytest.raises(SystemExit) as stopped:
        gpu.main()
    assert stopped.value.code == 2
    assert "no CUDA device" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
