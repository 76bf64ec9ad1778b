"""The agents' interface on many rows as a vector environment of Stable-Baselines3.

What the learner meets is that of ``agents.AgentInterface``; here the rows are those of one simulation and draw from one
generator, without Gymnasium's face between them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import torch
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

from aframe_env import task
from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario
from aframe_env.simulation import RowState, Simulation
from agents.learned.agent import output_zero
from agents.learned.features import LIMIT
from agents.learned.interface import Cuts, InterfaceConfig, LearnerFeatures
from train.learn.memory import Memory, into_object, of_object
from train.learn.options import LearningOptions
from train.learn.practice import Practice
from train.learn.share import REACH

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]


_OWN: Final = ("_which", "_commands", "_return", "_length", "_error_sum", "_still_sum")
_SENSED: Final = ("sensed_past", "sensor_errors", "readings")

GROUPS: Final = 8
"""Groups of rows that start together where scenarios are practised on."""


def median_reduction(error_sum: FloatArray, still_sum: FloatArray) -> float:
    """Median over N rows of the heave reduction.

    Integrals (N,) m² s over the same time: of the squared depth error, and of the pulley's squared heave, which stands
    for what the load of a still drum would do.
    """
    moved = still_sum > 0.0
    left = np.sqrt(error_sum[moved] / still_sum[moved])
    return 1.0 - float(np.median(left)) if len(left) else 0.0


class TrainingVecEnv(VecEnv):
    """Rows of the task for a learner: SAME_STEP resets, infos only for the rows that finished."""

    def __init__(
        self,
        rows: int,
        config: TaskConfig | None = None,
        interface: InterfaceConfig | None = None,
        *,
        practice: Practice | None = None,
        features: LearnerFeatures | None = None,
        reach: float = 1.0,
        seed: int = 0,
    ) -> None:
        """Make so many rows of the task; ``seed`` for the draws of scenarios.

        ``practice``: scenarios to draw from in the place of the task's, with their own reward and what they tell the
        critic, at the end of an observation. ``features``: what the rows observe, in the place of the interface's;
        ``reach``: how far actions go.
        """
        interface = interface or InterfaceConfig()
        self._interface = interface
        self._practice = practice
        self._which = np.zeros(rows, dtype=np.int64)
        """Scenario of ``practice`` that each row runs in."""
        self._simulation = simulation = Simulation(rows, config)
        self._rng = np.random.default_rng(seed)
        self._drawn_from: list[Mapping[str, Any]] = [self._rng.bit_generator.state] * rows
        """State of the generator before each row's scenario was drawn."""
        self._commands = np.zeros(rows)
        self._no_infos: list[dict[str, Any]] = [{} for _ in range(rows)]
        self._features = features or LearnerFeatures.of(simulation.config, rows, interface)
        self._cuts = Cuts(rows, simulation.control_period, simulation.episode_duration, interface)
        told = practice.waves.shape[2] if practice else 0
        super().__init__(
            rows,
            spaces.Box(-LIMIT, LIMIT, (len(self._features.names) + told,), np.float32),
            spaces.Box(-reach, reach, (1,), np.float32),
        )
        self._return = np.zeros(rows)
        self._length = np.zeros(rows, dtype=np.int64)
        self._error_sum, self._still_sum = np.zeros((2, rows))

    @property
    def actor_inputs(self) -> int:
        """Number of features that are the agent's; the rest is for the critics."""
        return self._features.actor_inputs

    @property
    def quantities(self) -> tuple[task.Quantity, ...]:
        """Quantities of the environment's observation."""
        return self._simulation.config.quantities

    def pop_reduction(self) -> float:
        """Median over the rows of the heave reduction since the last call, exploration included."""
        reduction = median_reduction(self._error_sum, self._still_sum)
        self._error_sum[:] = self._still_sum[:] = 0.0
        return reduction

    def reset(self) -> Float32Array:
        """Start all rows at random times of their horizon, so that they do not all end at once."""
        self._restart(np.arange(self.num_envs))
        if self._practice is None:
            self._cuts.left[:] = self._rng.integers(1, self._cuts.horizon + 1, self.num_envs)
        else:
            # In groups: whenever rows start anew, plans are made anew for all.
            group = self._rng.integers(1, GROUPS + 1, self.num_envs)
            self._cuts.left[:] = np.maximum(1, self._cuts.horizon * group // GROUPS)
        return self._observed()

    def _observed(self) -> Float32Array:
        if self._practice is None:
            return self._features.values.copy()
        told = self._practice.told(self._which, self._simulation.steps)
        return np.concatenate([self._features.values, told], axis=1)

    def step_async(self, actions: Float32Array) -> None:
        """Take the actions (rows, 1), outputs of the agent's network."""
        self._commands = self._features.command(actions[:, 0].astype(np.float64))

    def step_wait(self):  # type: ignore[no-untyped-def]
        """Advance, and restart the rows that finished."""
        simulation = self._simulation
        simulation.advance(self._commands)
        cost = simulation.results[:, task.COST]
        self._error_sum += cost
        self._still_sum += np.square(simulation.state[:, task.PULLEY_HEAVE]) * simulation.control_period
        if self._practice is None:
            rewards = self._interface.rewards(cost, simulation.control_period)
        else:
            rewards = self._practice.rewards(self._which, cost / simulation.control_period)
        self._return += rewards
        self._length += 1
        parted = simulation.results[:, task.PARTED] > 0.0
        cut = self._cuts.advance(simulation.state[:, task.DEPTH_ERROR])
        finished = parted | cut | (simulation.steps >= simulation.episode_steps)
        self._features.advance(simulation.observe(), simulation.state)
        infos = self._no_infos
        if finished.any():
            infos = list(infos)
            rows = np.flatnonzero(finished)
            last = self._observed()
            for i in rows.tolist():
                infos[i] = {
                    "terminal_observation": last[i],
                    "TimeLimit.truncated": not parted[i],
                    "episode": {"r": float(self._return[i]), "l": int(self._length[i]), "t": 0.0},
                }
            self._restart(rows)
        return self._observed(), rewards.astype(np.float32), finished, infos

    def _restart(self, rows: npt.NDArray[np.int64]) -> None:
        drawn = self._draw(rows)
        scenarios = [scenario for scenario, _ in drawn]
        simulation = self._simulation
        simulation.reset_rows(rows, drawn)
        self._cuts.start(rows)
        self._return[rows] = 0.0
        self._length[rows] = 0
        self._features.start(simulation.observe()[rows], simulation.state[rows], scenarios, rows)

    def _draw(self, rows: npt.NDArray[np.int64]) -> list[tuple[Scenario, int]]:
        """Scenarios for these rows, and seeds of their noise."""
        if self._practice is None:
            drawn = []
            for row in rows.tolist():
                self._drawn_from[row] = self._rng.bit_generator.state
                drawn.append(self._simulation.draw(self._rng))
            return drawn
        self._which[rows] = self._rng.integers(len(self._practice.scenarios), size=len(rows))
        seeds = self._rng.integers(2**53, size=len(rows)).tolist()
        return [(self._practice.scenarios[i], seed) for i, seed in zip(self._which[rows], seeds, strict=True)]

    def memory(self) -> Memory:
        """Everything that the rows' rest depends on."""
        simulation, memory = self._simulation, Memory({name: getattr(self, name).copy() for name in _OWN})
        memory.put("features", of_object(self._features))
        memory.put("cuts", of_object(self._cuts))
        memory.values["generator"] = self._rng.bit_generator.state
        memory.values["drawn_from"] = list(self._drawn_from)
        rows = [simulation.copy_row(i) for i in range(self.num_envs)]
        memory.arrays["engine"] = np.stack([row.engine for row in rows])
        memory.values["steps"] = [row.step for row in rows]
        sensed = [row.sensors for row in rows if row.sensors is not None]
        if sensed:
            for i, name in enumerate(_SENSED):
                memory.arrays[name] = np.stack([sensors[i] for sensors in sensed])
            memory.values["noise"] = [sensors[3:] for sensors in sensed]
        return memory

    def recall(self, memory: Memory) -> None:
        """Put back what ``memory`` told of rows with the same options."""
        simulation = self._simulation
        for name in _OWN:
            getattr(self, name)[:] = memory.arrays[name]
        self._drawn_from = list(memory.values["drawn_from"])
        for i, (engine, step) in enumerate(zip(memory.arrays["engine"], memory.values["steps"], strict=True)):
            sensors = None
            if "noise" in memory.values:
                seed, count = memory.values["noise"][i]
                sensors = (*(memory.arrays[name][i] for name in _SENSED), seed, count)
            mesh = simulation.config.mesh
            simulation.write_row(i, RowState(self._scenario(i), engine, sensors, step, mesh))
        self._rng.bit_generator.state = memory.values["generator"]
        # What a lift is stands in no memory: the features are told it anew.
        scenarios = [scenario for scenario in simulation.scenarios if scenario is not None]
        self._features.start(simulation.observe(), simulation.state, scenarios)
        into_object(self._features, memory.under("features"))
        into_object(self._cuts, memory.under("cuts"))

    def _scenario(self, row: int) -> Scenario:
        """The scenario of a row, drawn again."""
        if self._practice is not None:
            return self._practice.scenarios[int(self._which[row])]
        self._rng.bit_generator.state = self._drawn_from[row]
        scenario, _ = self._simulation.draw(self._rng)
        return scenario

    def close(self) -> None:
        """Nothing to close."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Attribute of the bridge, once for each row asked for."""
        return [getattr(self, attr_name, None) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Rows have no attributes of their own to set."""
        raise NotImplementedError("the rows of a native vector environment have no attributes of their own")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Rows have no methods of their own to call."""
        raise NotImplementedError("the rows of a native vector environment have no methods of their own")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Rows have no wrappers."""
        return [False for _ in self._get_indices(indices)]

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed the draws of scenarios."""
        self._rng = np.random.default_rng(seed)
        return [seed] * self.num_envs


def make_rows(options: LearningOptions) -> TrainingVecEnv:
    """Rows of the environment for a learner."""
    torch.set_num_threads(options.threads)
    practice = None
    if options.practice:
        base = options.start or output_zero(options.features)
        practice = Practice.of(options.config, base, options.practice, options.seed)
    return TrainingVecEnv(
        options.n_envs,
        options.config,
        options.interface,
        practice=practice,
        features=options.learner_features(options.n_envs),
        reach=1.0 if options.start is None else REACH,
        seed=options.seed,
    )
