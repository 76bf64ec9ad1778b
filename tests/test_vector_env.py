"""The native vector environment against Gymnasium's own vector of scalar environments, in every autoreset mode."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from aframe_env import Crane, InvalidValue, Rope, Scenario, ScenarioDistribution
from aframe_env.env import AFrameHeaveEnv
from aframe_env.vector_env import AFrameHeaveVectorEnv

ROWS = 5
WEAK = ScenarioDistribution(
    load_mass=1e5, rope_length=(50.0, 300.0), hs=(1.0, 4.0), ramp=1.0, crane=Crane(rope=Rope(breaking_load=1.35e6))
)
"""Under random commands the ropes of some rows part, each at its own time; those of others last."""


def arguments(observation: str = "state") -> dict[str, Any]:
    return {"scenario": WEAK, "episode_duration": 3.0, "observation": observation}


def both(mode: AutoresetMode, observation: str = "state") -> tuple[AFrameHeaveVectorEnv, SyncVectorEnv]:
    native = AFrameHeaveVectorEnv(ROWS, autoreset_mode=mode, **arguments(observation))
    scalar = SyncVectorEnv([lambda: AFrameHeaveEnv(**arguments(observation))] * ROWS, autoreset_mode=mode)
    return native, scalar


def assert_same_infos(got: dict[str, Any], want: dict[str, Any]) -> None:
    """Gymnasium leaves out keys that no row has; rows outside a key's mask have no meaning."""
    assert {key for key in got if not key.startswith("_") or got[key].any()} == set(want)
    for key in (key for key in want if not key.startswith("_")):
        mask = want[f"_{key}"]
        np.testing.assert_array_equal(got[f"_{key}"], mask)
        if isinstance(want[key], dict):
            assert_same_infos(got[key], want[key])
        else:
            for row in np.flatnonzero(mask):
                np.testing.assert_array_equal(got[key][row], want[key][row])


def assert_same_step(got: tuple[Any, ...], want: tuple[Any, ...]) -> None:
    for ours, theirs in zip(got[:-1], want[:-1], strict=True):
        np.testing.assert_array_equal(ours, theirs)
        assert ours.dtype == theirs.dtype
    assert_same_infos(got[-1], want[-1])


@pytest.mark.parametrize("observation", ["state", "sensors"])
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_autoreset_is_gymnasiums(mode: AutoresetMode, observation: str) -> None:
    native, scalar = both(mode, observation)
    assert native.metadata["autoreset_mode"] is mode
    assert native.observation_space == scalar.observation_space
    assert native.action_space == scalar.action_space
    assert_same_step(native.reset(seed=3), scalar.reset(seed=3))
    rng = np.random.default_rng(2)
    ends = np.zeros(2, dtype=int)
    for _ in range(120):
        actions = rng.uniform(-4.0, 4.0, (ROWS, 1)).astype(np.float32)
        got, want = native.step(actions), scalar.step(actions)
        assert_same_step(got, want)
        ended = got[2] | got[3]
        ends += [np.count_nonzero(got[2]), np.count_nonzero(got[3])]
        if mode is AutoresetMode.DISABLED and ended.any():
            options = {"reset_mask": ended}
            assert_same_step(native.reset(options=dict(options)), scalar.reset(options=dict(options)))
    assert (ends >= 3).all()  # both kinds of end, and not all rows at a time


def test_seeds_of_a_list_and_of_a_number() -> None:
    native, scalar = both(AutoresetMode.NEXT_STEP)
    for seed in ([7, 1, 4, None, 2], 11):
        got, want = native.reset(seed=seed)[0], scalar.reset(seed=seed)[0]
        known = [k for k in range(ROWS) if not isinstance(seed, list) or seed[k] is not None]
        np.testing.assert_array_equal(got[known], want[known])
    assert native.np_random_seed == (11, 12, 13, 14, 15)


def test_masked_reset_leaves_the_other_rows_alone() -> None:
    """Rows started again at different times go on side by side, as scalar environments do."""
    mode = AutoresetMode.DISABLED
    native = AFrameHeaveVectorEnv(ROWS, autoreset_mode=mode)
    scalar = SyncVectorEnv([AFrameHeaveEnv] * ROWS, autoreset_mode=mode)
    native.reset(seed=0)
    scalar.reset(seed=0)
    still = np.zeros((ROWS, 1), dtype=np.float32)
    for k in range(10):
        mask = np.arange(ROWS) == k % ROWS
        got, want = (env.reset(seed=20 + k, options={"reset_mask": mask.copy()}) for env in (native, scalar))
        np.testing.assert_array_equal(got[0], want[0])
        assert_same_step(native.step(still), scalar.step(still))


def test_ended_rows_must_be_reset_when_nothing_resets_them() -> None:
    env = AFrameHeaveVectorEnv(2, autoreset_mode="Disabled", max_episode_steps=3)
    env.reset(seed=0)
    still = np.zeros((2, 1), dtype=np.float32)
    env.step(still)
    env.reset(options={"reset_mask": np.array([True, False])})
    env.step(still)
    truncated = env.step(still)[3]
    assert truncated.tolist() == [False, True]
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"rows \[1\] have ended"):
        env.step(still)
    env.reset(options={"reset_mask": truncated})
    assert env.step(still)[3].tolist() == [True, False]
    env.reset(options={"reset_mask": np.array([False, True])})
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"rows \[0\] have ended"):
        env.step(still)


def test_scenarios_for_all_rows_and_for_each() -> None:
    env = AFrameHeaveVectorEnv(2)
    one, other = Scenario.paper(), Scenario.paper(load_mass=5e4)
    env.reset(options={"scenario": one})
    assert env.scenarios == (one, one)
    env.reset(options={"scenario": [one, other]})
    assert env.scenarios == (one, other)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda env: env.step(np.zeros((3, 1))), r"actions of shape \(3, 1\): must be of shape \(2, 1\), rad/s"),
        (lambda env: env.step("left"), "actions = 'left': must be an array of numbers, rad/s"),
        (lambda env: env.step(np.array([[0.0], [np.nan]])), r"actions\[1\] = nan rad/s: must be finite"),
        (lambda env: env.step(np.array([[np.inf], [0.0]])), r"actions\[0\] = inf rad/s: must be finite"),
        (lambda env: env.reset(seed=[1]), "seed: 1 seeds for 2 rows"),
        (lambda env: env.reset(options={"reset_mask": np.zeros(2, bool)}), "must select at least one row"),
        (lambda env: env.reset(options={"reset_mask": [True, True]}), r"must be a bool array of shape \(2,\)"),
        (lambda env: env.reset(options={"scenarios": None}), "options: unknown key 'scenarios'"),
        (lambda env: env.reset(options={"scenario": [Scenario.paper()]}), "a sequence of 2"),
        (lambda env: env.reset(options={"scenario": ["calm", None]}), "must be a Scenario"),
        (lambda env: env.set_state(env.get_state()[:1]), "1 rows for an environment of 2"),
        (lambda _: AFrameHeaveVectorEnv(0), r"num_envs = 0: must be in \[1,"),
        (lambda _: AFrameHeaveVectorEnv(2, autoreset_mode="Never"), "autoreset_mode = 'Never': must be one of"),
        (lambda _: AFrameHeaveVectorEnv(2, max_episode_steps=0), "max_episode_steps = 0"),
        (lambda _: AFrameHeaveVectorEnv(2, max_episode_steps=5, control_period="x"), "control_period = 'x'"),
        (lambda _: AFrameHeaveVectorEnv(2, render_mode="human"), "render_mode = 'human'"),
    ],
)
def test_bad_input_is_named(call: Any, message: str) -> None:
    env = AFrameHeaveVectorEnv(2)
    env.reset(seed=0)
    with pytest.raises(InvalidValue, match=message):
        call(env)


def test_step_before_reset() -> None:
    with pytest.raises(gymnasium.error.ResetNeeded):
        AFrameHeaveVectorEnv(2).step(np.zeros((2, 1)))
