"""What is told of a lift when the rope runs off a drum in layers."""

from __future__ import annotations

import numpy as np

from aframe_env import Crane, HarmonicMotion, Rope, Scenario, Winch
from aframe_env.env import AFrameHeaveEnv


def test_length_that_is_told_before_the_lift_stays_when_the_layer_changes() -> None:
    crane = Crane(winch=Winch(drum_width=0.5, max_rope_length=600.0), rope=Rope(outer_diameter=0.07))
    scenario = Scenario(crane=crane, motion=HarmonicMotion(), load_mass=5e4, target_level=-200.0)
    sensed, state = (AFrameHeaveEnv(scenario=scenario, observation=name) for name in ("sensors", "state"))
    told, true = sensed.reset(seed=0)[0][9], state.reset(seed=0)[0][13]
    assert told == np.float32(scenario.free_length) == true
    for _ in range(200):
        command = np.full(1, 3.0, dtype=np.float32)
        assert sensed.step(command)[0][9] == told
        observation = state.step(command)[0]
    # Some 20 s at 3 rad/s; the radius shrinks as the rope runs off.
    assert 40.0 < observation[13] - true < 3.0 * 20.0 * crane.drum_radius(scenario.free_length)
