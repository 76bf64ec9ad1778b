"""Observers: the rope's state now, and the pulley's path to come, from late and noisy readings or the full state."""

from __future__ import annotations

import numpy as np

from aframe_env.scenario.crane import GRAVITY
from aframe_env.scenario.sensors import Sensors
from agents.control.chain import Chains
from agents.control.chain_filter import ChainFilter
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.lateness import Lateness, require_readings
from agents.control.regulator import Columns, HoistBatch
from agents.control.rope_filter import RopeFilter
from agents.control.wave_bank import WaveBank
from agents.control.wave_filter import WaveFilter


class KalmanObserver:
    """Present state of N rows, whose readings are late by whole control steps.

    Kalman filters of the pulley, as a bank of waves, and of the load, bobbing on its rope.

    The rope's model carries the estimates over the delay, with the drums' turns meanwhile and the predicted motion of
    the pulleys. One that adapts tells the pulleys' motion as much further ahead as readings and winches are later than
    told.
    """

    def __init__(
        self, hoists: HoistBatch, damping_ratio: float, sensors: Sensors, waves: ExpectedWaves, adapts: bool = False
    ) -> None:
        """``damping_ratio`` of the loads' bobbing, share of critical.

        ``sensors`` and ``waves``: delay, noise and motion that the filters are designed for.
        """
        self._hoists = hoists
        self._damping_ratio = damping_ratio
        self.model = hoists.model(damping_ratio)
        rows, hold = len(hoists.frequency), max(1, round(sensors.depth_error.period / hoists.period))
        self._turns = np.zeros((round(sensors.delay / hoists.period), rows))
        """(steps of delay, N) turns of the drums since the moment of measurement, rad."""
        bank = WaveBank.of(waves, sensors)
        self._tension, self._unit = sensors.tension, sensors.motion_unit
        self.heard = np.ones(rows, dtype=np.bool_)
        """(N,) whether the latest reading of the heave rate was one: in a dropout the last one stays, to the bit."""
        self.waves = WaveFilter(rows, hoists.period, hold, bank)
        self.load: RopeFilter | ChainFilter = RopeFilter(rows, bank.rate_noise)
        self.lateness = Lateness(rows, hoists.period, len(self._turns)) if adapts else None
        self._heave_rate, self._true_rate, self._drum_angle, self._first_angle, self._depth_error = np.zeros((5, rows))

    def start(self, o: Columns, rows: Rows = ALL) -> None:
        """Begin hoists, as ``hoists`` has, in these rows with the first readings (n,)."""
        self.model.replace(rows, self._hoists.model(self._damping_ratio, rows))
        if self.lateness is not None:
            self.lateness.start(rows)
        self._turns[:, rows] = 0.0
        self.heard[rows] = True
        self._start(o, rows)

    def retune(self, longer: FloatArray) -> None:
        """Go on with the hoists as they are now, the ropes ``longer`` (N,) by that factor; what is known stays."""
        self.model.replace(ALL, self._hoists.model(self._damping_ratio))
        self._retune_load(longer)

    def advance(self, turned: FloatArray, o: Columns) -> None:
        """Take the readings a control step later, during which the drums turned by ``turned`` (N,) rad."""
        if self.lateness is not None:
            winch = self._hoists.winch
            self.lateness.advance(winch.radius * winch.speed, winch.radius * o["drum_speed"])
        if len(self._turns):
            self._turns = np.concatenate([self._turns, turned[None]])[1:]
        self._advance(o)

    def state(self) -> FloatArray:
        """State z (N, 4) of the rope's model, now."""
        hoists = self._hoists
        rises = np.diff(self.waves.path(hoists.period * np.arange(len(self._turns) + 1.0)), axis=0)
        z = self._carried((rises - hoists.winch.radius * self._turns) / hoists.period)
        z[:, 3] = self.waves.rate(self._times(1))[0] - hoists.winch.radius * hoists.winch.speed
        return z

    def _carried(self, speeds: FloatArray) -> FloatArray:
        """State (N, 4) but for the last, by mean ``speeds`` (delay, N) m/s of the rope's end since the readings."""
        depth_error, stretch = self._depth_error, self.load.stretch
        z = np.stack([depth_error, self.load.load_velocity, depth_error + stretch, np.zeros_like(stretch)], axis=1)
        for speed in speeds:
            z[:, 3] = 0.0
            z = self.model.advance(z, speed)
        return z

    def rises(self, steps: int) -> FloatArray:
        """Rise of the pulley during each of the coming control steps, (steps, N) m."""
        return np.diff(self.waves.path(self._times(steps + 1)), axis=0)

    def pulley(self) -> tuple[FloatArray, ...]:
        """Velocity [m/s] of the pulley, its acceleration in the middle of the coming control step, and the mean ones.

        These are over that step and the next, all (N,), m/s².
        """
        period = self._hoists.period
        velocity = self.waves.rate(self._times(3))
        middle = self.waves.acceleration(self._times(1) + 0.5 * period)[0]
        soon, later = np.diff(velocity, axis=0) / period
        return velocity[0], middle, soon, later

    def _times(self, count: int) -> FloatArray:
        """Now and the ends of the coming control steps, s after the moment of measurement: (count,) or (count, N)."""
        times = self._hoists.period * np.arange(len(self._turns), len(self._turns) + count, dtype=np.float64)
        return times if self.lateness is None else times[:, None] + self.lateness.seconds

    def _start(self, o: Columns, rows: Rows) -> None:
        self._start_load(rows)
        self.waves.start(rows)
        self._heave_rate[rows], self._drum_angle[rows] = o["pulley_velocity_z"], o["drum_angle"]
        self._first_angle[rows], self._depth_error[rows] = o["drum_angle"], 0.0
        self._true_rate[rows] = o["pulley_velocity_z"]
        if self.waves.finds:
            # A ship that moves already has the load off its level by the heave, and the first readings tell.
            self.waves.find(o["pulley_velocity_z"], o["depth_error"], rows)
            self._true_rate[rows] = self.waves.rate(np.zeros(1))[0][rows]
            self._depth_error[rows] = self.waves.heave()[rows]

    def _start_load(self, rows: Rows) -> None:
        assert isinstance(self.load, RopeFilter)
        self.load.start(self.model.some(rows), self._hoists.period, self._stretch_noise(rows), rows)

    def _retune_load(self, longer: FloatArray) -> None:
        assert isinstance(self.load, RopeFilter)
        self.load.retune(self.model, self._hoists.period, self._stretch_noise(ALL), longer)

    def _stretch_noise(self, rows: Rows) -> FloatArray:
        """Standard deviation (n,) m of a reading of the ropes' stretch."""
        hoists, tension = self._hoists, self._tension
        noise = np.maximum(tension.noise, tension.relative_noise * hoists.weighed[rows] * GRAVITY)
        return hoists.stretch_under(noise, {"rope_length": hoists.rope_length[rows]}, rows)

    def _advance(self, o: Columns) -> None:
        radius, heave_rate, drum_angle = self._hoists.winch.radius, o["pulley_velocity_z"], o["drum_angle"]
        paid_out = radius * (drum_angle - self._drum_angle)
        if self._unit is None:
            self.waves.advance(heave_rate)
            true_rate = heave_rate
        else:
            self.heard = heave_rate != self._heave_rate
            self.waves.advance(heave_rate, self.heard)
            true_rate = self.waves.rate(np.zeros(1))[0]
        speed = 0.5 * (true_rate + self._true_rate) - paid_out / self._hoists.period
        self._heave_rate, self._true_rate, self._drum_angle = heave_rate, true_rate, drum_angle
        self.load.advance(speed, self._hoists.stretch(o))
        below = radius * (drum_angle - self._first_angle) + self.load.stretch
        self.waves.correct(self._missed(o["depth_error"], self.waves.heave(), below))
        self._depth_error = self.waves.heave() - below

    def _missed(self, depth_error: FloatArray, heave: FloatArray, below: FloatArray) -> FloatArray:
        """How far a reading (N,) m is from the pulley's heave less the rope's growth ``below`` it, both estimated."""
        return depth_error - heave + below


class ChainObserver(KalmanObserver):
    """``KalmanObserver`` whose filter of the load knows the rope's mass and the water's drag.

    And a depth that comes later than all else, as sound does from a deep load, is compared with what it was then.
    """

    def __init__(
        self, hoists: HoistBatch, damping_ratio: float, sensors: Sensors, waves: ExpectedWaves, adapts: bool = False
    ) -> None:
        super().__init__(hoists, damping_ratio, sensors, waves, adapts)
        rows = len(hoists.frequency)
        self.load: ChainFilter = ChainFilter(rows, WaveBank.of(waves, sensors).rate_noise)
        self._reckoned = np.zeros((round(sensors.depth_error.delay / hoists.period) + 1, rows))
        """Depth errors (steps + 1, N) m as estimated, from the moment that a depth is read of to that of the rest."""

    def _carried(self, speeds: FloatArray) -> FloatArray:
        now = self.load.carried(self._depth_error, speeds)
        return np.column_stack([now, np.zeros(len(now))])

    def _missed(self, depth_error: FloatArray, heave: FloatArray, below: FloatArray) -> FloatArray:
        self._reckoned = np.concatenate([self._reckoned[1:], (heave - below)[None]])
        return np.asarray(depth_error - self._reckoned[0])

    def _start_load(self, rows: Rows) -> None:
        self._reckoned[:, rows] = 0.0
        self.load.start(*self._tuned(rows), rows)

    def _retune_load(self, longer: FloatArray) -> None:
        self.load.retune(*self._tuned(ALL), longer)

    def _tuned(self, rows: Rows) -> tuple[Chains, float, FloatArray, FloatArray]:
        hoists = self._hoists
        length = hoists.rope_length[rows]
        softness = hoists.stretch_under(np.ones_like(length), {"rope_length": length}, rows)
        return hoists.chains(rows), hoists.period, softness, self._stretch_noise(rows)


class StateObserver:
    """What ``KalmanObserver`` tells, from observations of the full state: only the path to come is an estimate."""

    lateness = None

    def __init__(self, hoists: HoistBatch, damping_ratio: float, waves: ExpectedWaves) -> None:
        self._hoists = hoists
        self._damping_ratio = damping_ratio
        self.model = hoists.model(damping_ratio)
        rows = len(hoists.frequency)
        self.waves = WaveFilter(rows, hoists.period, 1, WaveBank.of(waves, None))
        self._z = np.zeros((rows, 4))
        self._velocity, self._acceleration = np.zeros((2, rows))

    def start(self, o: Columns, rows: Rows = ALL) -> None:
        """Begin hoists, as ``hoists`` has, in these rows with the first observations (n,)."""
        self.model.replace(rows, self._hoists.model(self._damping_ratio, rows))
        self.waves.start(rows)
        self._look(o, rows)

    def retune(self, longer: FloatArray) -> None:
        """Go on with the hoists as they are now."""
        self.model.replace(ALL, self._hoists.model(self._damping_ratio))

    def advance(self, turned: FloatArray, o: Columns) -> None:
        """Take the observations a control step later."""
        self.waves.advance(o["pulley_velocity_z"])
        self._look(o, ALL)

    def state(self) -> FloatArray:
        """State z (N, 4) of the rope's model, now."""
        return self._z

    def rises(self, steps: int) -> FloatArray:
        """Rise of the pulley during each of the coming control steps, (steps, N) m."""
        period = self._hoists.period
        soon = period * (self._velocity + 0.5 * period * self._acceleration)
        return np.concatenate([soon[None], np.diff(self.waves.path(period * np.arange(1.0, steps + 1.0)), axis=0)])

    def pulley(self) -> tuple[FloatArray, ...]:
        """Velocity [m/s] and acceleration [m/s²] (N,) of the pulley."""
        return self._velocity, self._acceleration

    def _look(self, o: Columns, rows: Rows) -> None:
        winch = self._hoists.winch
        winch.speed[rows] = o["drum_speed"]
        self._velocity[rows], self._acceleration[rows] = o["pulley_velocity_z"], o["pulley_acceleration_z"]
        rope_end = o["depth_error"] + self._hoists.stretch(o, rows)
        if self._hoists.heavy[rows].any():
            # The waves in a heavy rope are in its tension; where its end is, is known from pulley, drum and slant.
            aslant = 0.5 * (o["load_offset_x"] ** 2 + o["load_offset_y"] ** 2) / o["rope_length"]
            reckoned = o["pulley_heave"] - winch.radius[rows] * o["drum_angle"] + aslant
            rope_end = np.where(self._hoists.heavy[rows], reckoned, rope_end)
        rope_end_speed = o["pulley_velocity_z"] - winch.radius[rows] * o["drum_speed"]
        self._z[rows] = np.stack([o["depth_error"], o["load_velocity_z"], rope_end, rope_end_speed], axis=1)


Observer = KalmanObserver | StateObserver


def observer_for(
    hoists: HoistBatch,
    damping_ratio: float,
    sensors: Sensors | None,
    waves: ExpectedWaves,
    adapts: bool = False,
    chains: bool = False,
) -> Observer:
    """Observer of hoists with these sensors; None where the full state is observed, which is never late.

    ``chains``: it knows the ropes' mass and the water's drag, which the full state tells anyway.
    """
    require_readings(adapts, sensors)
    if sensors is None:
        return StateObserver(hoists, damping_ratio, waves)
    if chains:
        return ChainObserver(hoists, damping_ratio, sensors, waves, adapts)
    return KalmanObserver(hoists, damping_ratio, sensors, waves, adapts)
