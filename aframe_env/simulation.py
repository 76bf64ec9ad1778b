"""Rows of the task: the engine, its observation and its cost. Scalar and vector environment are faces of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from aframe_env import task
from aframe_env.config import TaskConfig
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.flexible.readout import ROTATION
from aframe_env.engine import Engine
from aframe_env.flexible_engine import FlexibleEngine, Mesh
from aframe_env.rfem.model import warn_of_rotation
from aframe_env.scenario import Scenario, ScenarioSource
from aframe_env.scenario.motion import require_coverage
from aframe_env.scenario.motion_unit import Past
from aframe_env.scenario.preview import PreviewBank, require_foreseeable
from aframe_env.scenario.sensors import SensorBank
from aframe_env.validation import InvalidValue, shown

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RowState:
    """Everything that the rest of a row's episode depends on, but for its generator."""

    scenario: Scenario
    engine: FloatArray
    sensors: tuple[FloatArray, FloatArray, FloatArray, int, int] | None
    step: int
    mesh: Mesh | None = None
    """Mesh of the full model; None for the simplified one."""


class Simulation:
    """``rows`` independent episodes of one task."""

    def __init__(self, rows: int, config: TaskConfig | None = None) -> None:
        """Make room for the rows."""
        self.config = config = config or TaskConfig()
        self.source: ScenarioSource = config.source
        self.rows = rows
        self.control_period = float(config.control_period)
        self.episode_steps, self.episode_duration = config.steps, config.duration
        if config.mesh is None:
            self._engine = Engine(rows, self.control_period, max_inner_step=config.max_inner_step)
        else:
            self._engine = FlexibleEngine(rows, self.control_period, config.mesh, max_inner_step=config.max_inner_step)
        self._report = task.report_kernel(self._engine.lanes)
        self._bank = SensorBank(config.sensors, rows, self.control_period) if config.sensors else None
        preview = config.sensors.preview if config.sensors else None
        self._previews = PreviewBank(preview, rows, self.control_period) if preview else None
        self.observation_space = task.box(config.quantities)
        self._low, self._high = self.observation_space.low, self.observation_space.high
        limit = np.float32(self.source.max_drum_speed)
        self.action_space = spaces.Box(-limit, limit, (1,), np.float32)
        self.scenarios: list[Scenario | None] = [None] * rows
        self._told_mass = np.zeros(rows)
        """Masses of the loads that the operator was told, kg."""
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
            raise InvalidValue(f"options['scenario'] = {shown(scenario)}: must be a Scenario")
        require_coverage(scenario.motion, "episode_duration", self.episode_duration)
        if self._previews is not None:
            require_foreseeable(scenario)
        return scenario, noise_seed

    def reset_rows(self, indices: npt.NDArray[np.int64], drawn: list[tuple[Scenario, int]]) -> None:
        """Put rows at the start of their scenarios."""
        for index, (scenario, _) in zip(indices.tolist(), drawn, strict=True):
            self._engine.reset_row(index, scenario)
            self._begin(index, scenario)
        self.steps[indices] = 0
        self._read_out(indices)
        if self._bank is not None:
            truth = self._sensed_truth()
            for index, (scenario, noise_seed) in zip(indices.tolist(), drawn, strict=True):
                past = Past.of(scenario) if self._bank.has_motion_unit else None
                self._bank.reset_row(index, truth[index], noise_seed, scenario.sensor_delay, past)
                if self._previews is not None:
                    self._previews.start_row(index, scenario, noise_seed)

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
            foretold = () if self._previews is None else (self._previews.at(self.steps),)
            values = np.concatenate([self._bank.readings, self._known(), *foretold], axis=1)
        observation = np.empty(values.shape, dtype=np.float32)
        task.clip(values, self._low, self._high, observation)
        if self._bank is None:
            observation[:, task.LOAD_MASS] = self._told_mass
        return observation

    def copy_row(self, index: int) -> RowState:
        """Return the state of a row."""
        scenario = self.scenarios[index]
        if scenario is None:
            raise InvalidValue("get_state() before the first reset()")
        sensors = None if self._bank is None else self._bank.copy_row(index)
        return RowState(scenario, self._engine.copy_row(index), sensors, int(self.steps[index]), self.config.mesh)

    def write_row(self, index: int, state: RowState) -> None:
        """Put back what ``copy_row`` returned."""
        if (state.sensors is None) != (self._bank is None):
            raise InvalidValue("set_state(): the state belongs to an environment with another observation")
        if state.mesh != self.config.mesh:
            raise InvalidValue(
                "set_state(): the state belongs to an environment with another model, rfes or rfem_modes"
            )
        self._engine.restore_row(index, state.engine, state.scenario)
        self._begin(index, state.scenario)
        self.steps[index] = state.step
        if self._bank is not None and state.sensors is not None:
            self._bank.write_row(index, state.sensors, state.scenario.sensor_delay)
            if self._previews is not None:
                *_, noise_seed, _ = state.sensors
                self._previews.start_row(index, state.scenario, noise_seed)
        self._read_out(np.array([index]))

    def _read_out(self, rows: npt.NDArray[np.int64]) -> None:
        self._report(self._engine.blocks, self.episode_duration, rows, self.state, self.results)

    def _begin(self, index: int, scenario: Scenario) -> None:
        """Note the scenario of a row."""
        self.scenarios[index] = scenario
        self._told_mass[index] = scenario.as_told.load_mass

    def _known(self) -> FloatArray:
        """Mass, if it is told, and nominal unstretched rope length: known before the lift, (rows, 2)."""
        assert self.config.sensors is not None
        mass = self._told_mass * self.config.sensors.mass_told
        return np.stack([mass, self._engine.read(at.START_LENGTH)], axis=1)

    def _sensed_truth(self) -> FloatArray:
        return task.sensed_truth(self.state, self._engine.deck()[:, 3:5])
