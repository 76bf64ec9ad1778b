"""Features and commands of tensors are those of arrays."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import Crane, InvalidValue, Rope, Scenario, Sensors, Winch
from aframe_env.task import STATE
from agents.control.expected_waves import ExpectedWaves
from agents.learned.features import STATE_FEATURES, FeatureConfig, Features
from agents.learned.tensor_features import TensorFeatures

RANGES = {
    "depth_error": (-30.0, 30.0),
    "pulley_velocity_z": (-4.0, 4.0),
    "pulley_acceleration_z": (-3.0, 3.0),
    "drum_angle": (-20.0, 20.0),
    "drum_speed": (-4.0, 4.0),
    "rope_tension": (0.0, 3e6),
    "load_mass": (1e4, 2e5),
    "rope_length": (50.0, 2000.0),
}
"""Of an observation's quantities; ± 5 for the others."""
WAVES = st.builds(
    lambda low, width, bands, variance, build_up: ExpectedWaves(
        frequency=tuple(np.linspace(low, low + width, bands)), variances=((variance,) * bands,), build_up=build_up
    ),
    low=st.floats(0.3, 0.6),
    width=st.floats(0.3, 1.2),
    bands=st.integers(2, 12),
    variance=st.floats(1e-5, 0.05),
    build_up=st.sampled_from([0.0, 3.0]),
)


def observations(rng: np.random.Generator, rows: int) -> np.ndarray:
    low, high = np.array([RANGES.get(quantity.name, (-5.0, 5.0)) for quantity in STATE]).T
    return rng.uniform(low, high, (rows, len(STATE))).astype(np.float32)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    rows=st.integers(1, 20),
    period=st.sampled_from([0.05, 0.1, 0.25, 0.5]),
    diameter=st.floats(0.5, 3.0),
    lag=st.sampled_from([0.0, 0.2]),
    stiffness=st.floats(5e7, 5e8),
    waves=WAVES,
    action=st.sampled_from(["residual", "speed"]),
)
def test_features_and_commands_are_those_of_arrays(
    seed: int,
    rows: int,
    period: float,
    diameter: float,
    lag: float,
    stiffness: float,
    waves: ExpectedWaves,
    action: str,
) -> None:
    """Over many steps in which single rows begin anew, whatever the observations."""
    crane = Crane(winch=Winch(drum_diameter=diameter, lag=lag), rope=Rope(axial_stiffness=stiffness))
    config = FeatureConfig(control_period=period, waves=waves, action=action)  # type: ignore[arg-type]
    rng = np.random.default_rng(seed)
    arrays, tensors = Features(rows, config), TensorFeatures(rows, crane, config, "cpu", cuda=False)
    first = np.ones(rows, dtype=np.bool_)
    for step in range(30):
        observed = observations(rng, rows)
        want = arrays.advance(observed) if step else np.empty((rows, len(STATE_FEATURES)), dtype=np.float32)
        begun = np.flatnonzero(first)
        if len(begun):
            want[begun] = arrays.start(observed[begun], [Scenario(crane=crane)] * len(begun), begun)
        got = tensors.look(torch.from_numpy(observed), torch.from_numpy(first))
        assert got.dtype == torch.float32
        # Single precision: what the features are rounded to.
        np.testing.assert_allclose(got, want, rtol=1e-6, atol=1e-6)
        output = rng.uniform(-1.5, 1.5, rows)
        commands = tensors.command(torch.from_numpy(output[:, None]))
        assert commands.shape == (rows, 1)
        np.testing.assert_allclose(commands[:, 0], arrays.command(output), rtol=1e-5, atol=1e-5)
        first = rng.uniform(size=rows) < 0.1


def test_sensors_are_refused() -> None:
    with pytest.raises(InvalidValue, match="must be of the full state"):
        TensorFeatures(1, Crane(), FeatureConfig(sensors=Sensors()), "cpu", cuda=False)
