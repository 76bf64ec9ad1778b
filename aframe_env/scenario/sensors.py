"""Sensors: what a real installation measures, with noise, delay, sampling and resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import kernel
from aframe_env.dynamics.random import normal
from aframe_env.memory import require_memory
from aframe_env.scenario import motion_unit
from aframe_env.scenario.motion_unit import MotionUnit, MotionUnitBank, Past
from aframe_env.scenario.preview import Preview
from aframe_env.validation import InvalidValue, require_instance, require_number, shown

FloatArray = npt.NDArray[np.float64]

SPEED_OF_SOUND: Final = 1500.0
"""In sea water, m/s."""


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One measured quantity. Units are those of the quantity."""

    noise: float = 0.0
    """Standard deviation of the error."""
    relative_noise: float = 0.0
    """Standard deviation as a share of the quantity; the larger of the two holds."""
    correlation_time: float = 0.0
    """Time constant of the error (first-order Gauss-Markov process), s; 0 for white noise."""
    period: float = 0.0
    """Time between samples, held in between, s; 0 for a sample at every control step."""
    resolution: float = 0.0
    """Smallest step of the reading; 0 for none."""
    delay: float = 0.0
    """Time from a motion to its reading beside that of all channels, s."""

    def __post_init__(self) -> None:
        for name in ("noise", "relative_noise"):
            require_number(name, getattr(self, name), "of the channel's unit", low=0.0, high=1e9)
        require_number("resolution", self.resolution, "of the channel's unit", low=1e-12, high=1e9, or_zero=True)
        require_number("correlation_time", self.correlation_time, "s", low=0.0, high=1e6)
        require_number("period", self.period, "s", low=0.0, high=1e4)
        require_number("delay", self.delay, "s", low=0.0, high=10.0)


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """The sensors of an installation. The defaults follow data sheets of what is sold today.

    The motion reference unit reports at the pulley (lever arms compensated): heave to the worse of 5 cm and 5 %,
    roll and pitch to 0.03°; the drum has an encoder, the rope a load pin; the load's depth is slow and coarse.
    """

    delay: float = 0.1
    """Time from a motion to its reading, s; for all channels."""
    mass_told: bool = True
    """False: the load's mass is not told before the lift, and ``load_mass`` reads 0."""
    preview: Preview | None = None
    """What a wave radar foretells of the pulley's heave; None: there is no radar."""
    heave: Channel = field(default_factory=lambda: Channel(noise=0.05, relative_noise=0.05, correlation_time=30.0))
    """Pulley's vertical displacement, m."""
    heave_rate: Channel = field(default_factory=lambda: Channel(noise=0.01, relative_noise=0.01))
    """Pulley's vertical velocity, m/s."""
    roll: Channel = field(default_factory=lambda: Channel(noise=math.radians(0.03)))
    """rad."""
    pitch: Channel = field(default_factory=lambda: Channel(noise=math.radians(0.03)))
    """rad."""
    drum_angle: Channel = field(default_factory=lambda: Channel(resolution=2.0 * math.pi / 4096))
    """rad."""
    drum_speed: Channel = field(default_factory=lambda: Channel(noise=0.002))
    """rad/s."""
    tension: Channel = field(default_factory=lambda: Channel(noise=2.0e3, relative_noise=0.005))
    """N."""
    depth_error: Channel = field(default_factory=lambda: Channel(noise=0.05, period=1.0, resolution=0.01))
    """x_L3 - h, m."""
    motion_unit: MotionUnit | None = None
    """Errors of a real motion reference unit, which reads heave, heave rate, roll and pitch: before the noise of these
    channels. None: it has none."""

    def __post_init__(self) -> None:
        require_number("delay", self.delay, "s", low=0.0, high=10.0)
        if not isinstance(self.mass_told, bool):
            raise InvalidValue(f"mass_told = {shown(self.mass_told)}: must be True or False")
        if self.preview is not None:
            require_instance("preview", self.preview, Preview)
        for name in CHANNELS:
            require_instance(name, getattr(self, name), Channel)
        if self.motion_unit is not None:
            require_instance("motion_unit", self.motion_unit, MotionUnit)

    @classmethod
    def transponder(cls, depth: float, **changes: Any) -> Sensors:
        """Return the default sensors with the load's depth told through ``depth`` m of water.

        A pressure gauge on the load answers an acoustic call: sound takes a second for 1,500 m, there and back, and the
        next call follows the answer by a second. ``changes`` replace further fields.
        """
        require_number("depth", depth, "m", low=0.0, high=1.2e4)
        way = depth / SPEED_OF_SOUND
        channel = Channel(noise=0.05, period=2.0 * way + 1.0, resolution=0.01, delay=way)
        return cls(**{"depth_error": channel, **changes})

    @classmethod
    def ideal(cls) -> Sensors:
        """Return the same channels without noise, delay, sampling or resolution."""
        perfect: dict[str, Any] = {name: Channel() for name in CHANNELS}
        return cls(delay=0.0, **perfect)


CHANNELS = ("heave", "heave_rate", "roll", "pitch", "drum_angle", "drum_speed", "tension", "depth_error")


class SensorBank:
    """The sensors of many rows: from true quantities to readings, control step by control step."""

    def __init__(self, sensors: Sensors, rows: int, control_period: float) -> None:
        channels = [getattr(sensors, name) for name in CHANNELS]
        self._noise = np.array([c.noise for c in channels])
        self._relative = np.array([c.relative_noise for c in channels])
        self._keep = np.array(
            [math.exp(-control_period / c.correlation_time) if c.correlation_time else 0.0 for c in channels]
        )
        self._hold = np.array([max(1, round(c.period / control_period)) for c in channels], dtype=np.int64)
        self._resolution = np.array([c.resolution for c in channels])
        self._period, self._delay = control_period, sensors.delay
        self._further_delay = np.array([c.delay for c in channels])
        # A reading is the truth of its delay ago, interpolated between the control steps on either side.
        self._whole = np.zeros((rows, len(CHANNELS)), dtype=np.int64)
        self._weight = np.zeros((rows, len(CHANNELS)))
        self._memory = np.zeros((rows, 0, len(CHANNELS)))
        """(rows, past control steps with the newest first, channels)."""
        self._set_delay(slice(None), None)
        self._error = np.zeros((rows, len(CHANNELS) + (motion_unit.STATE if sensors.motion_unit else 0)))
        """(rows, channels) errors of the channels, and behind them the state of the motion reference unit."""
        self._unit: MotionUnitBank | None = None
        if sensors.motion_unit is not None:
            self._unit = MotionUnitBank(sensors.motion_unit, rows, control_period)
        self._reading = np.zeros((rows, len(CHANNELS)))
        self._seed = np.zeros(rows, dtype=np.uint64)
        self._count = np.zeros(rows, dtype=np.int64)

    def reset_row(
        self, index: int, truth: FloatArray, seed: int, delay: float | None = None, past: Past | None = None
    ) -> None:
        """Start a row that has been at ``truth`` (channels,) for ever, with its own noise.

        ``delay``: from a motion to its reading, s, in the place of the sensors'. ``past``: motion before the start,
        with the drum still; a motion reference unit alone reckons with it.
        """
        self._set_delay(index, delay)
        self._memory[index] = truth
        self._error[index] = 0.0
        if self._unit is not None:
            self._unit.draw(index, seed)
            self._start_unit(self._unit, index, truth.copy(), past)
        self._seed[index] = seed
        self._count[index] = 0
        self._measure(slice(index, index + 1))

    def measure(self, truth: FloatArray) -> FloatArray:
        """Readings (rows, channels) one control step later, the truth being ``truth`` (rows, channels)."""
        self._memory[:, 1:] = self._memory[:, :-1].copy()
        if self._unit is None:
            self._memory[:, 0] = truth
            self._measure(slice(None))
            return self._reading
        state, last = self._error[:, len(CHANNELS) :], self._reading[:, : motion_unit.READ].copy()
        self._memory[:, 0] = self._unit.sense(truth, state, self._count)
        self._measure(slice(None))
        out = self._unit.out(state)
        self._reading[out, : motion_unit.READ] = last[out]
        return self._reading

    def _start_unit(self, unit: MotionUnitBank, index: int, truth: FloatArray, past: Past | None) -> None:
        """Start the motion reference unit of a row, and fill its memory with what it has told."""
        unit.start(index, self._error[index, len(CHANNELS) :], truth, past)
        self._memory[index] = truth
        if past is not None:
            steps = self._memory.shape[1] - 1
            self._memory[index, 1:, : motion_unit.READ] += unit.before(index, past, steps)
            # With the drum still the load goes with the pulley.
            self._memory[index, 1:, CHANNELS.index("depth_error")] += past.change(past.heave, self._period, steps)

    @property
    def has_motion_unit(self) -> bool:
        """Whether motion before the start is reckoned with."""
        return self._unit is not None

    @property
    def readings(self) -> FloatArray:
        """The latest readings, (rows, channels)."""
        return self._reading

    def copy_row(self, index: int) -> tuple[FloatArray, FloatArray, FloatArray, int, int]:
        """Return everything that the row's further readings depend on."""
        return (
            self._memory[index].copy(),
            self._error[index].copy(),
            self._reading[index].copy(),
            int(self._seed[index]),
            int(self._count[index]),
        )

    def write_row(
        self, index: int, state: tuple[FloatArray, FloatArray, FloatArray, int, int], delay: float | None = None
    ) -> None:
        """Put back what ``copy_row`` returned of a row with this ``delay``, as in ``reset_row``."""
        self._set_delay(index, delay)
        memory, self._error[index], self._reading[index] = state[:3]
        # What lies further back than either bank's rows are late is never looked at.
        past = min(len(memory), self._memory.shape[1])
        self._memory[index, :past] = memory[:past]
        self._seed[index], self._count[index] = state[3:]
        if self._unit is not None:
            self._unit.draw(index, int(self._seed[index]))

    def _set_delay(self, index: int | slice, delay: float | None) -> None:
        """Let the readings of a row, or of some, be so late, s, and all memories be long enough."""
        delays = ((self._delay if delay is None else delay) + self._further_delay) / self._period
        self._whole[index] = np.floor(delays + 1e-9)
        self._weight[index] = np.clip(delays - self._whole[index], 0.0, 1.0)
        rows, past, channels = self._memory.shape
        needed = int(self._whole[index].max()) + 2
        if needed > past:
            require_memory(
                f"num_envs = {rows} with sensors that are {delays.max() * self._period:g} s late",
                8 * rows * needed * channels,
            )
            longer = np.zeros((rows, needed, channels))
            longer[:, :past] = self._memory
            self._memory = longer

    def _measure(self, rows: slice) -> None:
        _read_kernel()(
            self._memory[rows],
            self._whole[rows],
            self._weight[rows],
            self._noise,
            self._relative,
            self._keep,
            self._hold,
            self._resolution,
            self._seed[rows],
            self._count[rows],
            self._error[rows],
            self._reading[rows],
        )


@cache
def _read_kernel():  # type: ignore[no-untyped-def]

    @kernel
    def read(memory, whole, weight, noise, relative, keep, hold, resolution, seed, count, error, reading):  # type: ignore[no-untyped-def]
        rows, _, channels = memory.shape
        for i in range(rows):
            for c in range(channels):
                draw = normal(seed[i], count[i] * channels + c)
                fresh = math.sqrt(1.0 - keep[c] * keep[c])
                if count[i] == 0:
                    error[i, c] = draw
                else:
                    error[i, c] = keep[c] * error[i, c] + fresh * draw
                if count[i] % hold[c] == 0:
                    newer, older = memory[i, whole[i, c], c], memory[i, whole[i, c] + 1, c]
                    truth = (1.0 - weight[i, c]) * newer + weight[i, c] * older
                    value = truth + error[i, c] * max(noise[c], relative[c] * abs(truth))
                    if resolution[c] > 0.0:
                        value = round(value / resolution[c]) * resolution[c]
                    reading[i, c] = value
            count[i] += 1

    return read
