"""A state machine that steps, resets, saves and copies environments of tasks from all over the documented ranges.

Rows side by side must be what each is alone, to the last bit, and whatever comes out must be finite and in its space.
"""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt
import torch
from gymnasium.vector import AutoresetMode
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from tensordict import TensorDict

from aframe_env import Scenario, ScenarioDistribution, SmallRotationWarning
from aframe_env.config import TaskConfig
from aframe_env.dynamics.start import longest_inner_step
from aframe_env.env import AFrameHeaveEnv
from aframe_env.torch_env import AFrameHeaveTorchEnv
from aframe_env.vector_env import AFrameHeaveVectorEnv
from benchmarks.ranges import values

MOST_ROWS: Final = 10
Source = TypeVar("Source", Scenario, ScenarioDistribution)
"""More than a block of rows."""
MOST_STEPS: Final = 40
"""Most steps of a rule."""
MOST_INNER_STEPS: Final = 500
"""About the most inner steps of a step: a stiff rope gets a short control step, or little would be tried."""


def known_to_the_full_model(source: Source) -> Source:
    """The same without what that model refuses: a drum with inertia, a frame that luffs on elastic servomotors."""
    crane = replace(source.crane, winch=replace(source.crane.winch, drive=None))
    elastic = crane.frame.structure.servomotor.stiffness is not None
    changes = {"luffing": None} if isinstance(source, Scenario) and elastic else {}
    found: Source = values.made(lambda: replace(source, crane=crane, **changes))
    return found


@st.composite
def tasks(draw: st.DrawFn) -> TaskConfig:
    """Tasks on either model with either observation, whose episodes end within the steps that are made."""
    model = draw(st.sampled_from(["simplified", "rfem"]))
    source: Scenario | ScenarioDistribution = draw(st.one_of(values.scenarios(), values.distributions()))
    if model == "rfem":
        source = known_to_the_full_model(source)
    period = draw(st.one_of(st.just(0.1), values.intervals_of(TaskConfig())["control_period"].values))
    period = short_enough(period, source if isinstance(source, Scenario) else source.nominal())
    changes: dict[str, Any] = (
        {"rfes": (3, 2), "rfem_modes": draw(st.sampled_from([None, 5]))} if model == "rfem" else {}
    )
    return values.made(
        lambda: TaskConfig(
            model=model,
            scenario=source,
            observation=draw(st.one_of(st.sampled_from(["state", "sensors"]), values.sensors())),
            control_period=period,
            episode_duration=period * draw(st.integers(1, 60)),
            **changes,
        )
    )


def short_enough(period: float, scenario: Scenario) -> float:
    """A control step in its range, of no more than some inner steps."""
    inner_step = min(longest_inner_step(scenario.rope_frequency, scenario.rope_damping_rate), scenario.chain_step)
    return max(1e-3, min(period, MOST_INNER_STEPS * inner_step))


@dataclass
class Count:
    """What all machines have done."""

    steps: int = 0
    """Steps of a row, made by itself and among others."""
    episodes: dict[str, int] = field(default_factory=lambda: {"simplified": 0, "rfem": 0})
    """Episodes that were begun on each model."""


class Rows(RuleBasedStateMachine):
    """A vector environment beside one environment for each of its rows."""

    count = Count()

    @initialize(
        config=tasks(),
        rows=st.integers(1, MOST_ROWS),
        mode=st.sampled_from(list(AutoresetMode)),
        seed=st.integers(0, 2**31),
    )
    def make(self, config: TaskConfig, rows: int, mode: AutoresetMode, seed: int) -> None:
        """Make and reset both."""
        self.rows, self.mode = rows, mode
        self.together = AFrameHeaveVectorEnv(rows, config, autoreset_mode=mode)
        self.alone = [AFrameHeaveEnv(config) for _ in range(rows)]
        self.ended = np.zeros(rows, dtype=bool)
        self.saved: tuple[Any, ...] | None = None
        self.limit = float(self.together.single_action_space.high[0])  # type: ignore[attr-defined]
        with turned_too_far():
            observations, infos = self.together.reset(seed=seed)
            own = [env.reset(seed=seed + i) for i, env in enumerate(self.alone)]
        self._begun(rows)
        self._same(observations, [each[0] for each in own])
        self._same_infos(infos, [each[1] for each in own])

    @rule(
        count=st.integers(1, MOST_STEPS),
        size=st.sampled_from([0.0, 0.5, 1.0, 3.0, 1e30]),
        seed=st.integers(0, 2**31),
        held=st.booleans(),
    )
    def step(self, count: int, size: float, seed: int, held: bool) -> None:
        """Make some steps with commands up to ``size`` of the winch's speed, the same all the time or not."""
        rng = np.random.default_rng(seed)
        actions = self._actions(rng, size)
        for _ in range(count):
            if self.mode is AutoresetMode.DISABLED and self.ended.any():
                self._reset(self.ended.copy(), None, None)
            self._step(actions if held else self._actions(rng, size))

    @rule(mask=st.lists(st.booleans(), min_size=MOST_ROWS, max_size=MOST_ROWS), seed=st.none() | st.integers(0, 2**31))
    def reset_some(self, mask: list[bool], seed: int | None) -> None:
        """Reset some rows, or all."""
        chosen = np.array(mask[: self.rows])
        self._reset(chosen if chosen.any() else ~chosen, seed, None)

    @rule(scenario=values.scenarios())
    def reset_to(self, scenario: Scenario) -> None:
        """Reset all rows to a scenario."""
        if self.together.simulation.config.model == "rfem":
            scenario = known_to_the_full_model(scenario)
        self._reset(np.ones(self.rows, dtype=bool), None, scenario)

    @rule()
    def save(self) -> None:
        """Keep the state."""
        if not self.ended.any():
            self.saved = self.together.get_state(), [env.get_state() for env in self.alone]

    @rule()
    def restore(self) -> None:
        """Go back to the state that was kept, all rows and each."""
        if self.saved is None:
            return
        states, own = self.saved
        self.together.set_state(states)
        for env, state in zip(self.alone, own, strict=True):
            env.set_state(state)
        self.ended[:] = False

    @rule(pickled=st.booleans())
    def copy(self, pickled: bool) -> None:
        """Go on with copies."""
        if pickled:
            self.together, self.alone = pickle.loads(pickle.dumps((self.together, self.alone)))
        else:
            self.together, self.alone = copy.deepcopy((self.together, self.alone))

    @invariant()
    def state_is_the_same(self) -> None:
        """Full states are equal and finite."""
        if not hasattr(self, "together") or (self.mode is AutoresetMode.NEXT_STEP and self.ended.any()):
            return
        states = self.together.simulation.state
        assert np.isfinite(states).all(), states
        np.testing.assert_array_equal(states, [env.simulation.state[0] for env in self.alone])

    def _actions(self, rng: np.random.Generator, size: float) -> npt.NDArray[np.float32]:
        return (size * self.limit * rng.uniform(-1.0, 1.0, (self.rows, 1))).astype(np.float32)

    def _step(self, actions: npt.NDArray[np.float32]) -> None:
        with turned_too_far():
            observations, rewards, terminations, truncations, infos = self.together.step(actions)
            own = [self._step_alone(i, actions[i]) for i in range(self.rows)]
        self.count.steps += self.rows
        np.testing.assert_array_equal(rewards, [each[1] for each in own])
        np.testing.assert_array_equal(terminations, [each[2] for each in own])
        np.testing.assert_array_equal(truncations, [each[3] for each in own])
        assert np.isfinite(rewards).all(), rewards
        self._same(observations, [each[0] for each in own])
        self._same_infos(infos, [each[4] for each in own])
        if self.mode is not AutoresetMode.SAME_STEP:
            self.ended = terminations | truncations

    def _step_alone(self, index: int, action: npt.NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """What a row does as its mode says, by itself."""
        env = self.alone[index]
        if self.mode is AutoresetMode.NEXT_STEP and self.ended[index]:
            self._begun(1)
            observation, info = env.reset()
            return observation, 0.0, False, False, info
        observation, reward, terminated, truncated, info = env.step(action)
        if self.mode is AutoresetMode.SAME_STEP and (terminated or truncated):
            self._begun(1)
            observation, info = env.reset()
        return observation, reward, terminated, truncated, info

    def _reset(self, mask: npt.NDArray[np.bool_], seed: int | None, scenario: Scenario | None) -> None:
        options = {} if scenario is None else {"scenario": scenario}
        with turned_too_far():
            observations, _ = self.together.reset(seed=seed, options={"reset_mask": mask, **options})
            for index in np.flatnonzero(mask).tolist():
                own, _ = self.alone[index].reset(seed=None if seed is None else seed + index, options=options)
                np.testing.assert_array_equal(observations[index], own)
        self._begun(int(mask.sum()))
        self.ended &= ~mask

    def _begun(self, episodes: int) -> None:
        self.count.episodes[self.together.simulation.config.model] += episodes

    def _same(self, observations: npt.NDArray[np.float32], own: Sequence[npt.NDArray[np.float32]]) -> None:
        np.testing.assert_array_equal(observations, np.array(own))
        assert all(each in self.together.single_observation_space for each in observations), observations

    def _same_infos(self, infos: dict[str, Any], own: Sequence[dict[str, Any]]) -> None:
        for name in own[0]:
            np.testing.assert_array_equal(infos[name], [each[name] for each in own], err_msg=name)
            assert np.isfinite(infos[name]).all(), (name, infos[name])


class Tensors(RuleBasedStateMachine):
    """Rows with tensors in and out beside one environment for each, on a scenario of their own."""

    count = Rows.count

    @initialize(scenario=values.scenarios(), rows=st.integers(1, MOST_ROWS), steps=st.integers(1, 60))
    def make(self, scenario: Scenario, rows: int, steps: int) -> None:
        """Make and reset both."""
        period = short_enough(0.1, scenario)
        config = TaskConfig(scenario=scenario, control_period=period, episode_duration=period * steps)
        self.together = AFrameHeaveTorchEnv(rows, config, device="cpu")
        self.alone = [AFrameHeaveEnv(config) for _ in range(rows)]
        self.limit = float(self.together.action_space.high[0])  # type: ignore[attr-defined]
        self.saved: tuple[Any, ...] | None = None
        self._same(self.together.get_observations(), [env.reset(seed=0)[0] for env in self.alone])

    @rule(count=st.integers(1, MOST_STEPS), size=st.sampled_from([0.0, 1.0, 1e30]), seed=st.integers(0, 2**31))
    def step(self, count: int, size: float, seed: int) -> None:
        """Make some steps with commands up to ``size`` of the winch's speed."""
        rng = np.random.default_rng(seed)
        for _ in range(count):
            actions = (size * self.limit * rng.uniform(-1.0, 1.0, (len(self.alone), 1))).astype(np.float32)
            observations, rewards, dones, extras = self.together.step(torch.from_numpy(actions))
            self.count.steps += len(self.alone)
            finals, own = [], []
            for i, env in enumerate(self.alone):
                observation, reward, terminated, truncated, _ = env.step(actions[i])
                assert float(rewards[i]) == np.float32(reward)
                assert bool(dones[i]) == (terminated or truncated)
                assert bool(extras["time_outs"][i]) == (truncated and not terminated)
                finals.append(observation)
                own.append(env.reset()[0] if terminated or truncated else observation)
            assert torch.isfinite(rewards).all(), rewards
            np.testing.assert_array_equal(extras["final_obs"].numpy(), np.array(finals))
            self._same(observations, own)

    @rule()
    def save(self) -> None:
        """Keep the state."""
        self.saved = self.together.get_state(), [env.get_state() for env in self.alone]

    @rule()
    def restore(self) -> None:
        """Go back to the state that was kept."""
        if self.saved is not None:
            self.together.set_state(self.saved[0])
            for env, state in zip(self.alone, self.saved[1], strict=True):
                env.set_state(state)

    def _same(self, observations: TensorDict, own: Sequence[npt.NDArray[np.float32]]) -> None:
        found = observations["policy"].numpy()
        np.testing.assert_array_equal(found, np.array(own))
        assert all(each in self.together.observation_space for each in found), found


def turned_too_far() -> warnings.catch_warnings[None]:
    """Take a frame that is too soft for its load for granted: the package warns of it."""
    return warnings.catch_warnings(action="ignore", category=SmallRotationWarning)
