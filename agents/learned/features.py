"""Features of the learned agents: from observations to a network's inputs, and from its output to a drum speed.

The inputs are numbers of order one, each a fixed function of the observations since the start, so that an agent needs
no running statistics and means the same on every crane and in every sea. A bank of waves, fitted to the pulley's heave
rate as it comes, foretells the pulley's motion; on sensors, Kalman filters tell the present from the readings. The
output says how fast the rope's upper end is to go up or down in space: with the residual action, a feed-forward takes
up what the pulley is about to move meanwhile, so that with an output of zero the drum only follows the pulley; with the
speed action there is nothing below the network, and the output is the drum's speed itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from aframe_env.config import TaskConfig
from aframe_env.scenario import ScenarioDistribution
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE
from aframe_env.validation import require_choice
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.observer import observer_for
from agents.control.regulator import GRID, Columns, Gains, HoistBatch, Observation, gain_table, regulated_speed

Float32Array = npt.NDArray[np.float32]
Action = Literal["residual", "speed"]
ACTIONS: Final = ("residual", "speed")

LIMIT = 20.0
"""Features are clipped to ± this."""
AUTHORITY = 0.25
"""Speed of the rope's end for a small output, over that output and the winch's greatest acceleration, s."""
FAR_AUTHORITY = 1.25
"""The same for an output of 1: a fine hand near zero, and room to anticipate what the winch will not be able to do."""
AHEAD = (0.3, 0.6, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0)
"""Times from now at which the pulley's velocity is foretold, s."""
RISES = (1.0, 2.0, 3.0, 4.0, 6.0)
"""Times from now by which the pulley's rise is foretold, s."""
STATE_REGULATOR = Gains(effort=0.01, share=0.02)
"""Regulator whose answer is a feature, on the full state."""
SENSED_REGULATOR = Gains(effort=0.03, share=0.02)
"""And on sensors."""

PRESENT: Final = (
    "depth_error",
    "depth_error_near_zero",
    "load_velocity_z",
    "stretch_deviation",
    "rope_end_speed",
    "regulator",
    "drum_speed_share",
    "wanted_speed_change",
    "pulley_velocity_z",
    "pulley_acceleration_z",
    "pulley_heave",
    "load_mass",
    "rope_length",
    "bobbing_rate",
    "max_rope_speed",
    "max_rope_acceleration",
    "speed_peak_to_come",
    "acceleration_peak_to_come",
)
FORETOLD: Final = (
    *(f"pulley_velocity_z_in_{t:g}_s" for t in AHEAD),
    *(f"pulley_rise_in_{t:g}_s" for t in RISES),
)
FEATURES: Final = (*PRESENT, *FORETOLD, "heave_rate_innovation")
"""Names of the features, the same on sensors and on the full state."""


@dataclass(frozen=True, kw_only=True)
class FeatureConfig:
    """What features are made for."""

    control_period: float = TaskConfig.control_period
    """s."""
    sensors: Sensors | None = None
    """Sensors that measure the observation; None where the full state is observed."""
    waves: ExpectedWaves = field(default_factory=lambda: ExpectedWaves.of(ScenarioDistribution()))
    """Motion of the pulley that is expected."""
    action: Action = "residual"
    """"residual": the output moves the rope's end, above a feed-forward that follows the pulley; "speed": it is the
    drum's speed, as a share of the winch's."""

    def __post_init__(self) -> None:
        require_choice("action", self.action, ACTIONS)

    @classmethod
    def of(cls, task: TaskConfig, action: Action = "residual") -> FeatureConfig:
        """For the agents of a task."""
        return cls(
            control_period=task.control_period,
            sensors=task.sensors,
            waves=ExpectedWaves.of(task.source),
            action=action,
        )


class Features:
    """Features of N rows, and what their outputs ask of the winches."""

    def __init__(self, rows: int, config: FeatureConfig) -> None:
        self._action = config.action
        quantities, self._gains = (STATE, STATE_REGULATOR) if config.sensors is None else (SENSED, SENSED_REGULATOR)
        self._hoists = hoists = HoistBatch(rows, config.control_period, quantities)
        self._observer = observer_for(hoists, self._gains.damping_ratio, config.sensors, config.waves)
        self._table = gain_table(self._gains.damping_ratio, self._gains.effort, hoists.period)
        self._k = np.zeros((4, rows))
        """Gains of the regulator."""
        self._rise, self._turned = np.zeros((2, rows))
        """Rise of the pulleys [m] and turn of the drums [rad] in this control step."""

    def start(self, observation: Observation, cranes: Sequence[Crane], rows: Rows = ALL) -> Float32Array:
        """Features (n, F) of the first observations (n, K) of these ``rows``, whose past is forgotten."""
        hoists = self._hoists
        o = hoists.start(cranes, observation, rows)
        self._observer.start(o, rows)
        self._k[:, rows] = [np.interp(hoists.frequency[rows], GRID, line) for line in self._table]
        return self._look(o, rows)

    def advance(self, observation: Observation) -> Float32Array:
        """Features (N, F) of all rows, whose observations (N, K) are one control step later."""
        o = self._hoists.columns(observation)
        self._observer.advance(self._turned, o)
        return self._look(o, ALL)

    def command(self, output: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for a network's output (N,), in [-1, 1]."""
        winch, period = self._hoists.winch, self._hoists.period
        if self._action == "speed":
            command = np.clip(output, -1.0, 1.0) * winch.max_speed
            self._turned = winch.turn(command)
            return command
        turn = wanted_turn(np, self._rise, output, winch.radius, winch.max_acceleration, period)
        command, self._turned = winch.command(turn)
        return command

    @property
    def rope_state(self) -> FloatArray:
        """State z (N, 4) of the rope's model, as it is reckoned with now."""
        return self._observer.state()

    @property
    def pulley_speed(self) -> FloatArray:
        """Mean speed (N,) m/s of the pulleys in the coming control step, as it is reckoned with."""
        return np.asarray(self._rise / self._hoists.period)

    @property
    def hoist(self) -> HoistFeatures:
        """Loads, ropes and winches of all rows, as they are reckoned with."""
        return self._hoist(ALL, np.zeros(len(self._rise)))

    def _hoist(self, rows: Rows, rope_length: FloatArray) -> HoistFeatures:
        hoists, winch = self._hoists, self._hoists.winch
        return HoistFeatures(
            mass=hoists.mass[rows],
            rope_length=rope_length,
            frequency=hoists.frequency[rows],
            max_rope_speed=winch.radius[rows] * winch.max_speed[rows],
            max_rope_acceleration=winch.radius[rows] * winch.max_acceleration[rows],
            k=self._k[:, rows],
            share=self._gains.share,
            period=hoists.period,
        )

    def _look(self, o: Columns, rows: Rows) -> Float32Array:
        hoists, winch, observer = self._hoists, self._hoists.winch, self._observer
        self._rise[rows] = observer.rises(1)[0, rows]
        velocity, acceleration = observer.pulley()
        hoist = self._hoist(rows, o["rope_length"])
        of_the_load = hoist.of_the_load(np, observer.state()[rows].T)
        of_the_pulley = velocity[rows], acceleration[rows], 0.5 * o["pulley_heave"]
        rope_speed = winch.radius[rows] * winch.speed[rows]
        of_the_winch = hoist.of_the_winch(np, rope_speed, self._rise[rows] / hoists.period)
        foretold = observer.waves.foretold(np.array(AHEAD), np.array(RISES), rows, observer.delay)
        features = np.stack(
            [
                *of_the_load,
                *of_the_winch,
                *of_the_pulley,
                *hoist.constant(),
                *hoist.peaks(np, velocity[rows], foretold[: len(AHEAD)]),
                *foretold,
                10.0 * observer.waves.innovation[rows],
            ],
            axis=1,
        )
        return np.asarray(np.clip(features, -LIMIT, LIMIT), dtype=np.float32)


# For arrays of numpy (``xp`` = numpy) and tensors of torch (``xp`` = torch) alike, all (N,).


@dataclass(frozen=True, kw_only=True)
class HoistFeatures:
    """Features of loads, ropes and winches, not clipped yet."""

    mass: Any
    """kg."""
    rope_length: Any
    """m."""
    frequency: Any
    """Of the loads' bobbing, rad/s."""
    max_rope_speed: Any
    """m/s."""
    max_rope_acceleration: Any
    """m/s²."""
    k: Any
    """(4, N) gains of the regulator."""
    share: float
    """Share of the winch's acceleration that the regulator may use."""
    period: float
    """Control step, s."""

    def of_the_load(self, xp: Any, z: Any) -> tuple[Any, ...]:
        """The first of PRESENT, from the rope's state z, 4 of (N,)."""
        acceleration = self.share * self.max_rope_acceleration
        up = regulated_speed(xp, self.k, acceleration / self.frequency**2, acceleration, z)
        return (
            # Beyond some metres only the side of the error: there the agent does what it has learned nearer.
            4.0 * xp.tanh(0.5 * z[0]),
            2.0 * xp.tanh(10.0 * z[0]),
            5.0 * z[1],
            20.0 * (z[2] - z[0]),
            10.0 * z[3],
            output_for(xp, up, self.max_rope_acceleration),
        )

    def of_the_winch(self, xp: Any, rope_speed: Any, pulley_speed: Any) -> tuple[Any, ...]:
        """The next ones, from the speed of the rope at the drum, and the pulley's in the coming control step, m/s."""
        change = (pulley_speed - rope_speed) / (self.max_rope_acceleration * self.period)
        return rope_speed / self.max_rope_speed, 4.0 * xp.tanh(0.5 * change)

    def peaks(self, xp: Any, velocity: Any, foretold: Any) -> tuple[Any, ...]:
        """The last ones: greatest speed and acceleration to come, as shares of what the winch has.

        Velocity (N,) of the pulley now and what is foretold of it at ``AHEAD``, (A, N) m/s.
        """
        speed, acceleration = abs(velocity), 0.0 * velocity
        before, then = velocity, 0.0
        for time, after in zip(AHEAD, foretold, strict=True):
            speed = xp.maximum(speed, abs(after))
            acceleration = xp.maximum(acceleration, abs(after - before) / (time - then))
            before, then = after, time
        return 2.0 * speed / self.max_rope_speed - 1.0, 2.0 * acceleration / self.max_rope_acceleration - 1.0

    def constant(self) -> tuple[Any, ...]:
        """The next ones, which are the same all along an episode, but for the rope's length."""
        return (
            self.mass / 5.0e4 - 1.2,
            self.rope_length / 1.0e3 - 0.8,
            0.25 * self.frequency - 1.0,
            self.max_rope_speed - 2.0,
            self.max_rope_acceleration - 1.0,
        )


def rope_speed(output: Any, max_rope_acceleration: Any) -> Any:
    """Speed m/s at which the rope's end is to go up for a network's ``output`` in [-1, 1]."""
    return max_rope_acceleration * output * (AUTHORITY + (FAR_AUTHORITY - AUTHORITY) * output * output)


def output_for(xp: Any, up: Any, max_rope_acceleration: Any) -> Any:
    """Output in [-1, 1] at which the rope's end goes up at ``up`` m/s, or as near as may be: inverse of the above."""
    # The real root of (F - A) x³ + A x = y, by Cardano's formula in its hyperbolic form, which loses no digits near 0.
    y = xp.clip(up / max_rope_acceleration, -FAR_AUTHORITY, FAR_AUTHORITY)
    p = AUTHORITY / (FAR_AUTHORITY - AUTHORITY)
    scale = 2.0 * math.sqrt(p / 3.0)
    return scale * xp.sinh(xp.arcsinh(4.0 * y / (scale**3 * (FAR_AUTHORITY - AUTHORITY))) / 3.0)


def wanted_turn(xp: Any, rise: Any, output: Any, radius: Any, max_acceleration: Any, period: float) -> Any:
    """Turn of the drums, rad, while the pulleys ``rise`` m, for a network's ``output`` in [-1, 1]."""
    up = rope_speed(xp.clip(output, -1.0, 1.0), radius * max_acceleration)
    return (rise - period * up) / radius
