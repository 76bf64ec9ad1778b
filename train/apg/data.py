"""Recordings: episodes of the real engine, with what a recurrent agent would have seen in them, and what was true.

The drum plays the optimum meanwhile. Readings, forecasts and the filters' errors hardly depend on what it does, so that
they serve whatever a network does in their place (``train.apg.twin``). Where readings are later than told,
the errors do depend on it, and what the filters make of the load is taken out of them (``train.apg.estimates``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import torch

from aframe_env import task
from aframe_env.config import TaskConfig
from aframe_env.dynamics.start import critical_damping
from aframe_env.scenario import Scenario
from aframe_env.simulation import Simulation
from aframe_env.validation import InvalidValue
from agents.control.chain import Chains, Hanging
from agents.control.inverse_dynamics import RequiredRope
from agents.control.optimum import drag_rate, optimise
from agents.control.rope import RopeModel
from agents.learned.recurrent_inputs import Lookout, LookoutConfig
from agents.policy import DrumStill, FloatArray
from agents.rollout import run
from train.apg.estimates import Estimates

PREVIEW: Final = 90
"""Control steps beyond an episode's end that the pulley's path is recorded for: what the teacher sees ahead."""
LONG_PREVIEW: Final = 160
"""The same where loads bob as slowly as the waves, on ropes with mass or in water."""
OPTIMUM_ROUNDS: Final = 8
"""Gauss-Newton steps of the optimum: what further ones gain is of no account here."""
LEAST_CEILING: Final = 0.3
"""Heave reduction of the optimum below which an episode is left out: nothing is to be learned from it."""
GREATEST_DELAY: Final = 0.6
"""Greatest delay of readings that is followed, s."""

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Recordings:
    """N episodes of n control steps."""

    made_for: LookoutConfig
    """What the agents' inputs are made for."""
    series: Array
    """(N, n, S) of ``Outlook``."""
    figures: Array
    """(N, F) ``FIGURES``."""
    gains: Array
    """(N, 4) of the regulator."""
    told_change: Array
    """(N,) greatest change of the rope's speed at the drum in a step, as told, m/s."""
    told_speed: Array
    """(N,) greatest speed of the rope at the drum, as told, m/s."""
    told_lag: Array
    """(N,) of the winch, as told, in control steps."""
    error: Array
    """(N, n, 4) estimated less true state of ``RopeModel``; its last as if the drum's speed were as reckoned. Where
    there are gains, the rest is estimated less what ``Estimates`` make of the true state."""
    gain: Array
    """(N, n, 4) of the filter of the load; (N, 0, 4) where its errors hardly depend on what the drum does."""
    told_transition: Array
    """(N, 3, 4), ``reading`` (N, H) and ``softness`` (N,): of ``Estimates``."""
    reading: Array
    softness: Array
    start: Array
    """(N, 3) depth error, its rate and the rope's end at the start, m and m/s: of a ship that moves already, too."""
    rise: Array
    """(N, n) foretold speed of the pulley in the coming step, as in ``Outlook``, m/s."""
    path: Array
    """(N, n + 1 + preview) length of rope since the start that would hold the load still, m."""
    path_speed: Array
    """(N, n + 1 + preview) its rate, m/s."""
    transition: Array
    """(N, S, S + 1), and ``drag`` (N, S): of ``Chains``; (N, 3, 4) and zeros for ropes without mass in air."""
    drag: Array
    bobbing: Array
    """(N, 4, 4) of ``RopeModel``, with what the water's drag would do to it at the speeds of the optimum."""
    most_change: Array
    """(N,) what is true of ``told_change``."""
    most_speed: Array
    """(N,) and of ``told_speed``,"""
    lag: Array
    """(N,) and of ``told_lag``."""
    still: Array
    """(N,) root mean square depth error with the drum left still, m."""
    best: Array
    """(N,) and with the best drum commands."""

    @property
    def preview(self) -> int:
        """Control steps that the paths go on beyond an episode's end."""
        return int(self.path.shape[1] - 1 - self.rise.shape[1])

    @property
    def period(self) -> float:
        """Control step, s."""
        return self.made_for.control_period

    def rows(self, which: npt.NDArray[np.int64] | slice) -> Recordings:
        """Some of the episodes."""
        return Recordings(self.made_for, **{name: array[which] for name, array in self.arrays().items()})

    def arrays(self) -> dict[str, Array]:
        """All that there is of each episode, by name."""
        return {each.name: getattr(self, each.name) for each in fields(self) if each.name != "made_for"}

    @classmethod
    def joined(cls, parts: Sequence[Recordings]) -> Recordings:
        """The episodes of all parts, one after the other."""
        names = parts[0].arrays()
        arrays = {name: np.concatenate([part.arrays()[name] for part in parts]) for name in names}
        return cls(parts[0].made_for, **arrays)

    def model(self) -> RopeModel:
        """Model of the loads' bobbing, as it truly is."""
        return RopeModel(self.bobbing, self.bobbing[:, :, 3].copy())

    def shares(self, rms: torch.Tensor) -> torch.Tensor:
        """Shares (N,) of the ceiling for depth errors (N,) m."""
        still, best = (torch.from_numpy(each).to(rms.dtype) for each in (self.still, self.best))
        return (still - rms) / (still - best)

    def tensors(self) -> dict[str, torch.Tensor]:
        """Arrays as tensors of the series' precision."""
        precision = torch.from_numpy(self.series).dtype
        arrays = self.arrays()
        return {name: torch.from_numpy(np.ascontiguousarray(array)).to(precision) for name, array in arrays.items()}


def require_known(scenarios: Sequence[Scenario]) -> None:
    """Raise unless the twin knows all of these lifts."""
    for scenario in scenarios:
        further = {
            "target_path": scenario.target_path is not None,
            "luffing": scenario.luffing is not None,
            "seabed": scenario.water is not None and scenario.water.seabed is not None,
            "height of the load": scenario.load.height > 0.0,
            "compensator, friction at the pulley, or power, torque, layers or drive of the winch": (
                not scenario.crane.is_plain
            ),
        }
        if found := [name for name, there in further.items() if there]:
            raise InvalidValue(f"{', '.join(found)}: must not be there, for the twin of train.apg knows none of them")
        if (scenario.sensor_delay or 0.0) > GREATEST_DELAY:
            raise InvalidValue(
                f"sensor_delay = {scenario.sensor_delay:g} s: must be at most {GREATEST_DELAY:g} s for the twin of "
                "train.apg"
            )


def lengthening(scenarios: Sequence[Scenario]) -> FloatArray:
    """Rope (N,) below the pulley for each metre that the drum pays out; a light rope is reckoned at the drum."""
    return np.array([1.0 if scenario.is_light else 1.0 + scenario.pulley_strain for scenario in scenarios])


def required_path(scenarios: Sequence[Scenario], period: float, steps: int) -> tuple[FloatArray, FloatArray]:
    """Length of rope (N, steps + 1) m since the start that would hold the loads still, and its rate, m/s."""
    rope, longer = RequiredRope(scenarios, period), lengthening(scenarios)
    half = np.empty((2 * steps + 2, len(scenarios)))
    for i in range(len(half)):
        half[i] = longer * rope.now()
        rope.advance()
    rate = np.zeros((steps + 1, len(scenarios)))
    rate[1:] = (half[3::2] - half[1:-1:2]) / period
    rate[0] = (4.0 * half[1] - 3.0 * half[0] - half[2]) / period
    return half[::2].T.copy(), rate.T.copy()


def readings(scenarios: Sequence[Scenario], config: TaskConfig) -> FloatArray:
    """Shares (N, H) of the true values now and at each control step before that make a reading, by the true delays."""
    told = 0.0 if config.sensors is None else config.sensors.delay
    delays = np.array([told if each.sensor_delay is None else each.sensor_delay for each in scenarios])
    steps = np.arange(math.ceil(GREATEST_DELAY / config.control_period) + 1)
    return np.clip(1.0 - abs(delays[:, None] / config.control_period - steps), 0.0, 1.0)


def told_softness(scenarios: Sequence[Scenario]) -> FloatArray:
    """Stretch (N,) of the ropes that tensions are said to make over the true one."""
    return np.array([s.crane.rope.axial_stiffness / s.as_told.crane.rope.axial_stiffness for s in scenarios])


def record(scenarios: Sequence[Scenario], config: TaskConfig, seed: int) -> Recordings:
    """Record an episode of each scenario; ``seed`` of the sensors' noise. Those of no use are left out."""
    require_known(scenarios)
    count, steps, period = len(scenarios), config.steps, config.control_period
    optimum = optimise(scenarios, config, rounds=OPTIMUM_ROUNDS)
    still = run(DrumStill(), scenarios, config)
    light = all(scenario.is_light for scenario in scenarios)
    path, path_speed = required_path(scenarios, period, steps + (PREVIEW if light else LONG_PREVIEW))
    made_for = LookoutConfig.of(config)
    lookout, adapts = Lookout(count, made_for), made_for.adapts
    simulation = Simulation(count, config.replaced(scenario=scenarios[0], observation=config.sensors or "state"))
    noise = np.random.default_rng(seed).integers(2**63, size=count).tolist()
    simulation.reset_rows(np.arange(count), list(zip(scenarios, noise, strict=True)))
    taut, start = np.ones(count, dtype=np.bool_), np.zeros((count, 3))
    longer = lengthening(scenarios)
    radius = longer * [scenario.crane.winch.drum_radius for scenario in scenarios]
    series, error, rise = [], np.empty((count, steps, 4)), np.empty((count, steps))
    gain = np.zeros((count, steps if adapts else 0, 4))
    reading, softness = readings(scenarios, config), told_softness(scenarios)
    estimates: Estimates | None = None
    paid_out, velocity = np.zeros(count), np.empty((count, steps))
    for step in range(steps):
        seen = simulation.observe()
        outlook = lookout.advance(seen) if step else lookout.start(seen, [each.as_told for each in scenarios])
        true = simulation.state
        velocity[:, step] = true[:, task.LOAD_VELOCITY_Z]
        rope_end = path[:, step] - radius * true[:, task.DRUM_ANGLE]
        rope_end_speed = path_speed[:, step] - outlook.speed
        state = np.stack([true[:, task.DEPTH_ERROR], true[:, task.LOAD_VELOCITY_Z], rope_end], axis=1)
        start = start if step else state
        if estimates is not None:
            gain[:, step] = lookout.load_gain
            state = estimates.advance(*map(torch.from_numpy, (state, path[:, step] - paid_out, gain[:, step]))).numpy()
        elif adapts:
            figures = (lookout.told_transition, reading, softness)
            estimates = Estimates(made_for, *(torch.from_numpy(each.copy()) for each in figures))
        series.append(outlook.series)
        error[:, step] = outlook.z - np.column_stack([state, rope_end_speed])
        rise[:, step] = outlook.rise
        simulation.advance(lookout.follow(optimum.commands[:, step]))
        taut &= simulation.results[:, task.SLACK] == 0.0
        paid_out = paid_out + radius * lookout.turned
    best = np.sqrt(optimum.omega1 / config.duration)
    slowing = np.array([drag_rate(*each) for each in zip(scenarios, velocity, strict=True)])
    frequency = np.array([scenario.rope_frequency for scenario in scenarios])
    damping = np.array([s.total_rope_damping / critical_damping(s.rope_stiffness, s.moved_mass) for s in scenarios])
    bobbing = RopeModel.of(frequency, damping, period, slowing).a
    transition, drag = bobbing[:, :3], np.zeros((count, 3))
    if not light:
        transition, drag, _ = Chains.of([Hanging.of(scenario) for scenario in scenarios], period)
    winches = [scenario.crane.winch for scenario in scenarios]
    recordings = Recordings(
        made_for,
        series=np.stack(series, axis=1),
        figures=lookout.figures,
        gains=lookout.gains,
        told_change=lookout.most_change,
        told_speed=lookout.most_speed,
        told_lag=lookout.lag,
        error=error.astype(np.float32),
        gain=gain.astype(np.float32),
        told_transition=lookout.told_transition,
        reading=reading,
        softness=softness,
        start=start.astype(np.float32),
        rise=rise.astype(np.float32),
        path=path,
        path_speed=path_speed.astype(np.float32),
        transition=transition,
        drag=drag,
        bobbing=bobbing,
        most_change=longer * [winch.max_rope_acceleration * period for winch in winches],
        most_speed=longer * [winch.max_rope_speed for winch in winches],
        lag=np.array([winch.lag / period for winch in winches]),
        still=still.rms,
        best=best,
    )
    of_use = taut & np.isfinite(best) & (best < (1.0 - LEAST_CEILING) * still.rms)
    return recordings.rows(np.flatnonzero(of_use))
