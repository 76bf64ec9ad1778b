"""Features and commands of tensors are those of arrays."""

from __future__ import annotations

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import Crane, Rope, Winch
from aframe_env.task import STATE
from agents.learned.features import StateFeatures
from agents.learned.tensor_features import TensorStateFeatures

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


def observations(rng: np.random.Generator, rows: int) -> np.ndarray:
    low, high = np.array([RANGES.get(quantity.name, (-5.0, 5.0)) for quantity in STATE]).T
    return rng.uniform(low, high, (rows, len(STATE))).astype(np.float32)


@settings(max_examples=50, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    rows=st.integers(1, 20),
    period=st.floats(0.05, 0.5),
    diameter=st.floats(0.5, 3.0),
    lag=st.sampled_from([0.0, 0.2]),
    stiffness=st.floats(5e7, 5e8),
)
def test_features_and_commands_are_those_of_arrays(
    seed: int, rows: int, period: float, diameter: float, lag: float, stiffness: float
) -> None:
    crane = Crane(winch=Winch(drum_diameter=diameter, lag=lag), rope=Rope(axial_stiffness=stiffness))
    rng = np.random.default_rng(seed)
    arrays, tensors = StateFeatures(rows, period), TensorStateFeatures(crane, period, cuda=False)
    first = observations(rng, rows)
    first[:, [quantity.name for quantity in STATE].index("drum_angle")] = 0.0  # as at a start
    # Single precision: what the features are rounded to.
    np.testing.assert_allclose(
        tensors.look(torch.from_numpy(first)), arrays.start(first, [crane] * rows), rtol=1e-6, atol=1e-6
    )
    output = rng.uniform(-1.5, 1.5, rows)
    commands = tensors.command(torch.from_numpy(first), torch.from_numpy(output[:, None].astype(np.float32)))
    assert commands.shape == (rows, 1)
    np.testing.assert_allclose(commands[:, 0], arrays.command(output), rtol=1e-5, atol=1e-5)
