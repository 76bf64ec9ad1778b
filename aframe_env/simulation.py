"""Rows of the task: the engine, its observation and its cost. Scalar and vector environment are faces of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from aframe_env import task
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.flexible.readout import ROTATION
from aframe_env.engine import Engine
from aframe_env.flexible_engine import FlexibleEngine, Mesh, mesh_of
from aframe_env.rfem.model import warn_of_rotation
from aframe_env.scenario import Scenario, ScenarioDistribution, ScenarioSource
from aframe_env.scenario.motion import require_coverage
from aframe_env.scenario.sensors import SensorBank, Sensors
from aframe_env.validation import InvalidValue, require_choice, require_number

FloatArray = npt.NDArray[np.float64]

MODELS = ("simplified", "rfem")


@dataclass(frozen=True)
class RowState:
    """Everything that the rest of a row's episode depends on, but for its generator."""

    scenario: Scenario
    engine: FloatArray
    sensors: tuple[FloatArray, FloatArray, FloatArray, int, int] | None
    step: int
    mesh: Mesh | None = None
    """Of the full model; None for the simplified one."""


class Simulation:
    """``rows`` independent episodes of one task."""

    def __init__(
        self,
        rows: int,
        *,
        model: str = "simplified",
        scenario: ScenarioSource | None = None,
        control_period: float = 0.1,
        episode_duration: float = 60.0,
        observation: task.Observation = "state",
        max_inner_step: float | None = None,
        rfes: tuple[int, int] | None = None,
        rfem_modes: int | None = None,
    ) -> None:
        """Validate the arguments of the environments (see ``AFrameHeaveEnv``) and make room for the rows."""
        require_choice("model", model, MODELS)
        require_number("control_period", control_period, "s", low=1e-3, high=2.0)
        require_number("episode_duration", episode_duration, "s", low=control_period, high=1e6)
        if not isinstance(observation, Sensors):
            require_choice("observation", observation, ("state", "sensors"))
        self.source: ScenarioSource = ScenarioDistribution() if scenario is None else scenario
        if not isinstance(self.source, Scenario | ScenarioDistribution):
            raise InvalidValue(f"scenario = {scenario!r}: must be a Scenario or a ScenarioDistribution")
        self.rows = rows
        self.control_period = float(control_period)
        self.episode_steps = max(1, math.ceil(episode_duration / control_period - 1e-9))
        self.episode_duration = self.episode_steps * self.control_period
        self._mesh = mesh_of(model, rfes, rfem_modes)
        if self._mesh is None:
            self._engine = Engine(rows, control_period, max_inner_step=max_inner_step)
        else:
            self._engine = FlexibleEngine(rows, control_period, self._mesh, max_inner_step=max_inner_step)
        self._report = task.report_kernel(self._engine.lanes)
        sensors = Sensors() if observation == "sensors" else observation
        self.sensors = sensors if isinstance(sensors, Sensors) else None
        """None where the full state is observed."""
        self._bank = SensorBank(self.sensors, rows, control_period) if self.sensors else None
        quantities = task.STATE if self._bank is None else task.SENSED
        self.quantities = quantities
        self.observation_space = task.box(quantities)
        self._low, self._high = self.observation_space.low, self.observation_space.high
        limit = np.float32(self.source.crane.winch.max_speed)
        self.action_space = spaces.Box(-limit, limit, (1,), np.float32)
        self.scenarios: list[Scenario | None] = [None] * rows
        self.steps = np.zeros(rows, dtype=np.int64)
        self._everything = np.arange(rows)
        self.state = np.zeros((rows, len(task.STATE)))
        self.results = np.zeros((rows, task.RESULTS))
        self._warned = False

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "_report"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._report = task.report_kernel(self._engine.lanes)

    def frames(self) -> FloatArray | None:
        """Readout of the rows' frames, (rows, READOUTS); None for the simplified model.

        Warns:
            SmallRotationWarning: An rfe turns by more than 0.05 rad; once in the life of these rows.
        """
        if not isinstance(self._engine, FlexibleEngine):
            return None
        frames = self._engine.read_frames()
        if not self._warned:
            self._warned = warn_of_rotation(float(frames[:, ROTATION].max()))
        return frames

    @property
    def engine(self) -> Engine:
        """The engine, for reading."""
        return self._engine

    def draw(self, rng: np.random.Generator, scenario: Scenario | None = None) -> tuple[Scenario, int]:
        """Draw a row's scenario (or take the given one) and the seed of its sensors' noise."""
        noise_seed = int(rng.integers(2**63))
        if scenario is None:
            scenario = self.source if isinstance(self.source, Scenario) else self.source.draw(rng)
        elif not isinstance(scenario, Scenario):
            raise InvalidValue(f"options['scenario'] = {scenario!r}: must be a Scenario")
        require_coverage(scenario.motion, "episode_duration", self.episode_duration)
        return scenario, noise_seed

    def reset_rows(self, indices: npt.NDArray[np.int64], drawn: list[tuple[Scenario, int]]) -> None:
        """Put rows at the start of their scenarios."""
        for index, (scenario, _) in zip(indices.tolist(), drawn, strict=True):
            self._engine.reset_row(index, scenario)
            self.scenarios[index] = scenario
        self.steps[indices] = 0
        self._read_out(indices)
        if self._bank is not None:
            truth = self._sensed_truth()
            for index, (_, noise_seed) in zip(indices.tolist(), drawn, strict=True):
                self._bank.reset_row(index, truth[index], noise_seed)

    def advance(self, commands: FloatArray) -> None:
        """Advance every row by one control step; ``commands`` (rows,) rad/s, finite."""
        self._engine.step(commands)
        self.steps += 1
        self._read_out(self._everything)
        if self._bank is not None:
            self._bank.measure(self._sensed_truth())

    def observe(self) -> npt.NDArray[np.float32]:
        """Return a fresh observation of every row: (rows, K)."""
        values = self.state
        if self._bank is not None:
            values = np.concatenate([self._bank.readings, self._known()], axis=1)
        observation = np.empty(values.shape, dtype=np.float32)
        task.clip(values, self._low, self._high, observation)
        return observation

    def copy_row(self, index: int) -> RowState:
        """Return the state of a row."""
        scenario = self.scenarios[index]
        if scenario is None:
            raise InvalidValue("get_state() before the first reset()")
        sensors = None if self._bank is None else self._bank.copy_row(index)
        return RowState(scenario, self._engine.copy_row(index), sensors, int(self.steps[index]), self._mesh)

    def write_row(self, index: int, state: RowState) -> None:
        """Put back what ``copy_row`` returned."""
        if (state.sensors is None) != (self._bank is None):
            raise InvalidValue("set_state(): the state belongs to an environment with another observation")
        if state.mesh != self._mesh:
            raise InvalidValue(
                "set_state(): the state belongs to an environment with another model, rfes or rfem_modes"
            )
        self._engine.restore_row(index, state.engine, state.scenario)
        self.scenarios[index] = state.scenario
        self.steps[index] = state.step
        if self._bank is not None and state.sensors is not None:
            self._bank.write_row(index, state.sensors)
        self._read_out(np.array([index]))

    def _read_out(self, rows: npt.NDArray[np.int64]) -> None:
        self._report(self._engine.blocks, self.episode_duration, rows, self.state, self.results)

    def _known(self) -> FloatArray:
        """What the operator knows before the lift: mass and nominal unstretched rope length, (rows, 2)."""
        mass = self._engine.read(at.MASS)
        return np.stack([mass, self._engine.read(at.FREE_LENGTH)], axis=1)

    def _sensed_truth(self) -> FloatArray:
        return task.sensed_truth(self.state, self._engine.deck()[:, 3:5])
