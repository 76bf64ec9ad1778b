"""Run a policy over a set of scenarios, all episodes in step, on the pure task."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aframe_env import task
from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.simulation import Simulation
from agents.policy import FloatArray, Policy

HELD_OUT_SEED = 20_091_123
"""Scenarios for evaluation are drawn from this seed and their number. Training never draws from it."""


def held_out_scenarios(distribution: ScenarioDistribution, count: int) -> list[Scenario]:
    """Return the first ``count`` held-out scenarios; the same ones, whatever the count."""
    return [distribution.draw(np.random.default_rng([HELD_OUT_SEED, i])) for i in range(count)]


@dataclass(frozen=True)
class Episodes:
    """What came of N episodes."""

    omega1: FloatArray
    """(N,) ∫ (x_L3 - h)² dt, m² s."""
    omega2: FloatArray
    """(N,) max |x_L3 - h|, m."""
    duration: float
    """s."""
    slack: npt.NDArray[np.bool_]
    """(N,) whether the rope was ever slack."""
    parted: npt.NDArray[np.bool_]
    """(N,) whether the rope parted."""
    error: npt.NDArray[np.float32]
    """(N, steps + 1) depth error at the control steps, m."""
    drum_speed: npt.NDArray[np.float32]
    """(N, steps + 1) actual drum speed, rad/s."""

    @property
    def rms(self) -> FloatArray:
        """(N,) root mean square depth error, m."""
        return np.sqrt(self.omega1 / self.duration)


def run(
    policy: Policy,
    scenarios: Sequence[Scenario],
    *,
    observation: task.Observation = "state",
    control_period: float = 0.1,
    episode_duration: float = 60.0,
    model: str = "simplified",
    rfem_modes: int | None = None,
    noise_seed: int = 0,
    progress: Callable[[int], object] | None = None,
) -> Episodes:
    """Run ``policy`` through every scenario, on either model (see ``AFrameHeaveEnv``).

    ``noise_seed`` draws the sensors' noise, the same for every policy.
    """
    rows = len(scenarios)
    simulation = Simulation(
        rows,
        model=model,
        rfem_modes=rfem_modes,
        scenario=scenarios[0],
        observation=observation,
        control_period=control_period,
        episode_duration=episode_duration,
    )
    seeds = np.random.default_rng(noise_seed).integers(2**63, size=rows).tolist()
    simulation.reset_rows(np.arange(rows), list(zip(scenarios, seeds, strict=True)))
    policy.reset(scenarios, control_period)
    steps = simulation.episode_steps
    error = np.empty((rows, steps + 1), dtype=np.float32)
    speed = np.empty((rows, steps + 1), dtype=np.float32)
    slack = np.zeros(rows, dtype=np.bool_)
    error[:, 0], speed[:, 0] = simulation.state[:, 0], simulation.state[:, 10]
    alive = np.ones(rows, dtype=np.bool_)
    omega1, omega2 = np.zeros(rows), np.zeros(rows)
    for step in range(steps):
        simulation.advance(policy.act(simulation.observe(), step * control_period))
        error[:, step + 1], speed[:, step + 1] = simulation.state[:, 0], simulation.state[:, 10]
        # A row whose rope has parted is over: it was charged for its free fall, and runs on unobserved.
        omega1 = np.where(alive, simulation.results[:, task.OMEGA1], omega1)
        omega2 = np.where(alive, simulation.results[:, task.OMEGA2], omega2)
        slack |= alive & (simulation.results[:, task.SLACK] > 0.0)
        alive &= simulation.results[:, task.PARTED] == 0.0
        if progress is not None:
            progress(step + 1)
    return Episodes(omega1, omega2, simulation.episode_duration, slack, ~alive, error, speed)
