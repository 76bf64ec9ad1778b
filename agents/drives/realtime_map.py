"""The drive map in real time: its drives for the waves that the motion unit shows, told apart as they come.

The paper's outlook is a map of basic drive functions, approximated in real time. A pseudo-harmonic drive, eqs. (34),
(36), is fixed by amplitude, frequency and phase of its harmonics, and the map stores them as a ratio to the heave's.
Here the heave's own harmonics are the oscillators of a Kalman filter of the heave rate, followed at every control
step, so that a phase is never older than the latest reading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE
from agents.control.expected_waves import ExpectedWaves
from agents.control.regulator import Columns, HoistBatch, Observation
from agents.control.wave_bank import WaveBank
from agents.control.wave_filter import WaveFilter
from agents.control.winch import WinchModel
from agents.drives.map import DriveMap
from agents.policy import FloatArray, Knowledge

LOOKUP_PERIOD: Final = 1.0
"""Time between two looks at the map, s."""
ENCODER_GAIN: Final = 0.1
"""Share of its deviation from the encoder's reading that the reckoned drum angle is corrected by at each step."""
BRAKING_SHARE: Final = 0.25
"""Share of the winch's acceleration that brakes a drum which catches up with its drive."""


@dataclass
class RealTimeMapPolicy:
    """Follow the map's drives for the waves of the moment, with an encoder loop on the drum.

    It reads the pulley's heave rate and the drum's angle, and is told load mass and rope length before the lift. There
    is no feedback of the load or of the tension: what the drum does not take up stays. The filter begins with a ship at
    rest; a ship that is under way already leaves the load off its level by the heave at the start. A lead that a map
    asks for is kept to some hundredths of the heave, as well as the filter finds the quadrature of the waves.
    """

    drive_map: DriveMap
    sensors: Sensors | None = field(default_factory=Sensors)
    """Sensors that it acts on, for their delay and noise; None for the full state, which has neither."""
    waves: ExpectedWaves = field(default_factory=lambda: ExpectedWaves.of(ScenarioDistribution()))
    """Motion of the pulley that its filter expects."""
    name: str = field(init=False)
    knows: Knowledge = field(init=False)
    _scenarios: Sequence[Scenario] = field(init=False, repr=False, default=())
    _period: float = field(init=False, repr=False, default=0.1)
    _hoists: HoistBatch | None = field(init=False, repr=False, default=None)
    _bank: WaveFilter = field(init=False, repr=False)
    _drums: _Drums = field(init=False, repr=False)
    _ratio: npt.NDArray[np.complex128] = field(init=False, repr=False)
    """(N, bands) rope paid out over heave."""
    _step: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.sensors is None:
            self.name, self.knows = "drive map in real time (state)", Knowledge.STATE
        else:
            self.name, self.knows = "drive map in real time", Knowledge.SENSORS

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only what a ``Lift`` has is looked at."""
        self._scenarios, self._period, self._hoists = scenarios, control_period, None

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        if self._hoists is not None:
            self._hoists.retune(rope_length, growth, wet)

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for readings (N, 10), or observations (N, 14) of the full state.

        Raises InvalidValue for an observation of another width.
        """
        period = self._period
        if self._hoists is None:
            self._hoists = HoistBatch(len(observation), period, STATE if self.sensors is None else SENSED)
            o = self._hoists.start(self._scenarios, observation)
            self._start(self._hoists.winch, o)
        else:
            o = self._hoists.columns(observation)
            self._bank.advance(o["pulley_velocity_z"])
            self._drums.advance(o)
        if self._step % max(1, round(LOOKUP_PERIOD / period)) == 0:
            self._look_up(o)
        self._step += 1
        return self._drums.follow(*self.wanted(np.array([0.0, period])))

    def wanted(self, times: FloatArray) -> FloatArray:
        """Drum angles (T, N) rad since the start that the map asks for, ``times`` (T,) s from now."""
        assert self._hoists is not None
        delay = 0.0 if self.sensors is None else self.sensors.delay
        growth = np.exp(np.outer(times + delay, self._bank.exponents))
        # Row by row in the same order, whatever the batch: a sum, not a matrix product.
        rope = (growth[:, None, :] * (self._ratio * self._bank.phasors())[None]).real.sum(axis=2)
        return np.asarray(rope / self._hoists.winch.radius)

    def _start(self, winch: WinchModel, o: Columns) -> None:
        # The load's depth is not read: a reading of endless noise counts for nothing.
        bank = replace(WaveBank.of(self.waves, self.sensors), depth_noise=math.inf)
        self._bank = WaveFilter(len(winch.radius), self._period, 1, bank)
        self._bank.start()
        if self._bank.finds:
            self._bank.find(o["pulley_velocity_z"], o["depth_error"])
        self._drums = _Drums(winch, self._period, self.sensors, o)
        self._step = 0

    def _look_up(self, o: Columns) -> None:
        assert self._hoists is not None
        phasors, frequency = self._bank.phasors(), self._bank.exponents.imag
        # A harmonic of a sea goes with the amplitude of the whole, as in ``DriveMap.drive``.
        amplitude = np.sqrt(np.square(np.abs(phasors)).sum(axis=1))
        self._ratio = self.drive_map.ratio_at(
            np.broadcast_to(amplitude[:, None], phasors.shape),
            np.broadcast_to(2.0 * np.pi / frequency, phasors.shape),
            np.broadcast_to(self._hoists.mass[:, None], phasors.shape),
            np.broadcast_to(o["rope_length"][:, None], phasors.shape),
        )
        for i, lift in enumerate(self._scenarios):
            if not lift.is_light:
                # The radius counts the strain at the pulley already; what the map counts as such comes off.
                axial_stiffness = lift.crane.rope.axial_stiffness
                self._ratio[i] *= 1.0 + self.drive_map.light_strain(self._hoists.mass[i], axial_stiffness)


class _Drums:
    """Drums of N rows: their angle now, from the encoder and the turns since, and the commands that steer it."""

    def __init__(self, winch: WinchModel, period: float, sensors: Sensors | None, o: Columns) -> None:
        self._winch, self._period, self._sensed = winch, period, sensors is not None
        delay = 0.0 if sensors is None else sensors.delay / period
        self._whole = math.floor(delay + 1e-9)
        self._weight = min(1.0, max(0.0, delay - self._whole))
        self._first = o["drum_angle"]
        self._angles = np.zeros((self._whole + 2, len(winch.radius)))
        """Angles (steps back, N) rad since the start, the present one first."""

    def advance(self, o: Columns) -> None:
        """Take the encoders' readings, a control step after the latest command."""
        reading = o["drum_angle"] - self._first
        if not self._sensed:
            self._angles[0], self._winch.speed = reading, o["drum_speed"]
            return
        # The reading is the angle a delay ago, between the control steps on either side.
        then = (1.0 - self._weight) * self._angles[self._whole] + self._weight * self._angles[self._whole + 1]
        self._angles += ENCODER_GAIN * (reading - then)

    def follow(self, now: FloatArray, later: FloatArray) -> FloatArray:
        """Find commands (N,) rad/s towards the angles ``later`` (N,) rad at the end of the control step.

        A drum that is behind its wanted angle ``now`` (N,) catches up no faster than it can be braked.
        """
        period, winch = self._period, self._winch
        behind = now - self._angles[0]
        braking = np.sqrt(2.0 * BRAKING_SHARE * winch.max_acceleration * abs(behind))
        command, turned = winch.command(later - now + np.clip(behind, -period * braking, period * braking))
        self._angles = np.concatenate([(self._angles[0] + turned)[None], self._angles[:-1]])
        return command
