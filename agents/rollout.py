"""Run a policy over a set of scenarios, all episodes in step, on the pure task."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from aframe_env import task
from aframe_env.config import TaskConfig, task_config
from aframe_env.dynamics import layout as at
from aframe_env.memory import require_memory
from aframe_env.scenario import Scenario, ScenarioSource
from aframe_env.scenario.series import drawn_scenarios as drawn_scenarios
from aframe_env.simulation import Simulation
from agents.policy import FloatArray, Policy, begin

HELD_OUT_SEED = 20_091_123
"""Scenarios for evaluation are drawn from this seed and their number. Training never draws from it."""


def held_out_scenarios(source: ScenarioSource, count: int) -> list[Scenario]:
    """Return the first ``count`` held-out scenarios; the same ones, whatever the count."""
    return drawn_scenarios(source, HELD_OUT_SEED, count)


def noise_seeds(noise_seed: int, count: int) -> list[int]:
    """Return the seeds of the sensors' noise in the first ``count`` scenarios of a series; the same ones, likewise."""
    seeds: list[int] = np.random.default_rng(noise_seed).integers(2**63, size=count).tolist()
    return seeds


HISTORY = (task.DEPTH_ERROR, task.DRUM_SPEED, task.ROPE_TENSION)
"""Columns of the state that are kept of every control step."""
BED = (task.LANDINGS, task.LIFT_OFFS, task.LANDING_SPEED)
"""Results that tell of the seabed."""
BAND = 0.05
"""Depth error that an operator can live with, m: time beyond it is counted."""


def history_bytes(steps: int) -> int:
    """Memory that an episode's columns of so many control steps take."""
    return len(HISTORY) * (steps + 1) * np.dtype(np.float32).itemsize


@dataclass(frozen=True, kw_only=True)
class Episodes:
    """Results of N episodes. A row whose rope parts is counted until then, and its free fall in Ω1 and Ω2."""

    omega1: FloatArray
    """(N,) ∫ (x_L3 - h)² dt, m² s."""
    omega2: FloatArray
    """(N,) max |x_L3 - h|, m."""
    duration: float
    """s."""
    slack_events: npt.NDArray[np.int64]
    """(N,) number of times the rope went slack."""
    peak_tension: FloatArray
    """(N,) greatest rope tension, inner steps included, N."""
    drum_travel: FloatArray
    """(N,) rope reeled in and out by the drum, m."""
    peak_power: FloatArray
    """(N,) greatest power between drum and rope at the control steps, driving or braking, W."""
    time_outside: FloatArray
    """(N,) time with a depth error beyond ±BAND, and all that is left after a parted rope, s."""
    parted: npt.NDArray[np.bool_]
    """(N,) true if the rope parted."""
    landings: npt.NDArray[np.int64]
    """(N,) number of times that the load came down on the seabed."""
    lift_offs: npt.NDArray[np.int64]
    """(N,) and that it was lifted off it."""
    landing_speed: FloatArray
    """(N,) greatest speed of all landings, m/s; 0 without one."""
    error: npt.NDArray[np.float32]
    """(N, steps + 1) depth error at the control steps, m."""
    drum_speed: npt.NDArray[np.float32]
    """(N, steps + 1) actual drum speed, rad/s."""
    tension: npt.NDArray[np.float32]
    """(N, steps + 1) rope tension, N."""

    @property
    def control_period(self) -> float:
        """s."""
        return float(self.duration / (self.error.shape[1] - 1))

    @property
    def slack(self) -> npt.NDArray[np.bool_]:
        """(N,) true if the rope was ever slack."""
        return self.slack_events > 0

    @property
    def rms(self) -> FloatArray:
        """(N,) root mean square depth error, m."""
        return np.sqrt(self.omega1 / self.duration)

    def rows(self, which: slice) -> Episodes:
        """Return some of the episodes."""
        return replace(self, **{name: getattr(self, name)[which] for name in self._arrays()})

    @classmethod
    def joined(cls, parts: Sequence[Episodes]) -> Episodes:
        """Return the episodes of all parts, one after the other."""
        arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in cls._arrays()}
        return cls(duration=parts[0].duration, **arrays)

    @classmethod
    def _arrays(cls) -> list[str]:
        return [each.name for each in fields(cls) if each.name != "duration"]


def run(
    policy: Policy,
    scenarios: Sequence[Scenario],
    config: TaskConfig | None = None,
    *,
    noise_seed: int = 0,
    first: int = 0,
    progress: Callable[[int], object] | None = None,
    **arguments: Any,
) -> Episodes:
    """Run ``policy`` through every scenario, on the task of ``config`` but for these arguments of the environment.

    ``noise_seed`` draws the sensors' noise, the same for every policy; ``first`` is the place of the first scenario in
    its series, by which the noise goes.
    """
    rows = len(scenarios)
    config = task_config(config, arguments)
    # A single scenario stands for all of them: their cranes' winches are alike. It has no sensors of its own.
    config = config.replaced(observation=config.sensors or "state", scenario=scenarios[0])
    simulation = Simulation(rows, config)
    seeds = noise_seeds(noise_seed, first + rows)[first:]
    simulation.reset_rows(np.arange(rows), list(zip(scenarios, seeds, strict=True)))
    begin(policy, scenarios, config.control_period)
    steps = simulation.episode_steps
    tally = _Tally(simulation, scenarios)
    for step in range(steps):
        simulation.advance(policy.act(simulation.observe(), step * config.control_period))
        tally.add()
        if progress is not None:
            progress(step + 1)
    return tally.episodes()


class _Tally:
    """The figures of episodes that run in step, control step by control step."""

    def __init__(self, simulation: Simulation, scenarios: Sequence[Scenario]) -> None:
        rows, steps = simulation.rows, simulation.episode_steps
        self._simulation = simulation
        self._radius = np.array([s.crane.drum_radius(s.free_length) for s in scenarios])
        require_memory(f"{rows} episodes of {steps} control steps", rows * history_bytes(steps))
        self._histories = np.empty((len(HISTORY), rows, steps + 1), dtype=np.float32)
        self._step = 0
        self._alive = np.ones(rows, dtype=np.bool_)
        self._was_slack = np.zeros(rows, dtype=np.bool_)
        self._slack_events = np.zeros(rows, dtype=np.int64)
        self._omega1, self._omega2 = np.zeros(rows), np.zeros(rows)
        self._peak_tension = simulation.state[:, task.ROPE_TENSION].copy()
        self._drum_travel, self._peak_power, self._time_outside = np.zeros(rows), np.zeros(rows), np.zeros(rows)
        self._rope_speed = np.zeros(rows)
        self._bed = np.zeros((len(BED), rows))
        self._record()

    def _record(self) -> None:
        self._histories[:, :, self._step] = self._simulation.state[:, HISTORY].T

    def add(self) -> None:
        """Count the control step that has just been made."""
        results, period = self._simulation.results, self._simulation.control_period
        self._step += 1
        self._record()
        error, drum_speed, tension = self._simulation.state[:, HISTORY].T
        # A row whose rope has parted is over: it was charged for its free fall, and runs on unobserved.
        alive = self._alive
        self._omega1[alive] = results[alive, task.OMEGA1]
        self._omega2[alive] = results[alive, task.OMEGA2]
        self._bed[:, alive] = results[alive][:, BED].T
        slack = alive & (results[:, task.SLACK] > 0.0)
        self._slack_events += slack & ~self._was_slack
        self._was_slack = slack
        peak = np.maximum(self._peak_tension, self._simulation.engine.read(at.PEAK_TENSION))
        self._peak_tension = np.where(alive, peak, self._peak_tension)
        rope_speed = self._radius * abs(drum_speed)
        self._drum_travel += alive * 0.5 * period * (rope_speed + self._rope_speed)
        self._rope_speed = rope_speed
        self._peak_power = np.maximum(self._peak_power, alive * rope_speed * tension)
        self._time_outside += period * (~alive | (abs(error) > BAND))
        self._alive = alive & (results[:, task.PARTED] == 0.0)

    def episodes(self) -> Episodes:
        """The figures of all episodes."""
        return Episodes(
            omega1=self._omega1,
            omega2=self._omega2,
            duration=self._simulation.episode_duration,
            slack_events=self._slack_events,
            peak_tension=self._peak_tension,
            drum_travel=self._drum_travel,
            peak_power=self._peak_power,
            time_outside=self._time_outside,
            parted=~self._alive,
            landings=self._bed[0].astype(np.int64),
            lift_offs=self._bed[1].astype(np.int64),
            landing_speed=self._bed[2],
            error=self._histories[0],
            drum_speed=self._histories[1],
            tension=self._histories[2],
        )
