"""Features of the learned agents: from observations to a network's inputs, and from its output to a drum speed.

The inputs are numbers of order one, each a fixed function of the observations since the start, so that an agent needs
no running statistics and means the same on every crane and in every sea. A bank of waves, fitted to the pulley's heave
rate as it comes, foretells the pulley's motion; on sensors, Kalman filters tell the present from the readings. The
output says how fast the rope's upper end is to go up or down in space: with the residual action, a feed-forward takes
up what the pulley is about to move meanwhile, so that with an output of zero the drum only follows the pulley; with the
speed action there is nothing below the network, and the output is the drum's speed itself. The agents that correct
predictive control have features of their own: see ``agents.learned.plan_features``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from aframe_env.config import TaskConfig
from aframe_env.scenario import ScenarioDistribution
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE
from aframe_env.validation import InvalidValue, require_choice
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.lateness import require_readings
from agents.control.lift import Lift
from agents.control.observer import observer_for
from agents.control.regulator import Columns, HoistBatch, Observation
from agents.control.winch import WinchModel

Float32Array = npt.NDArray[np.float32]
Action = Literal["residual", "speed", "predictive"]
ACTIONS: Final = ("residual", "speed", "predictive")

LIMIT = 20.0
"""Features are clipped to ± this."""
AUTHORITY = 0.25
"""Speed of the rope's end for an output of 1 over the winch's greatest acceleration, s."""
DAMPING_RATIO: Final = 0.03
"""Damping of the load's bobbing on the rope that is reckoned with, share of critical."""

STATE_FEATURES: Final = (
    "depth_error",
    "depth_error_near_zero",
    "load_velocity_z",
    "stretch_deviation",
    "rope_end_speed",
    "pulley_velocity_z",
    "pulley_acceleration_z",
    "pulley_heave",
    "load_mass",
    "rope_length",
    "bobbing_rate",
)
SENSED_FEATURES: Final = (
    *STATE_FEATURES[:7],
    "pulley_acceleration_to_come",
    "pulley_acceleration_after_that",
    *STATE_FEATURES[7:],
)
WINCH_FEATURES: Final = ("winch_speed", "winch_acceleration", "winch_lag")
"""Limits and lag of the winch, as the operator was told them, for agents that are to meet many winches."""


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
    drum's speed, as a share of the winch's; "predictive": it corrects what predictive control plans."""
    winch: bool = False
    """Append ``WINCH_FEATURES``, for winches that differ; the features of predictive control have its limits anyway."""
    adapts: bool = False
    """With the predictive action on sensors: what is corrected is adaptive predictive control, which reckons how much
    later than told readings and winch are."""
    light: bool = True
    """Whether the lifts are light, as ``Scenario.is_light`` says; what is planned on others looks further ahead, and on
    sensors reckons with the rope's mass and the water's drag."""

    def __post_init__(self) -> None:
        require_action(self.action, self.winch, self.adapts)
        require_readings(self.adapts, self.sensors)

    @classmethod
    def of(
        cls, task: TaskConfig, action: Action = "residual", *, winch: bool = False, adapts: bool = False
    ) -> FeatureConfig:
        """For the agents of a task."""
        return cls(
            control_period=task.control_period,
            sensors=task.sensors,
            waves=ExpectedWaves.of(task.source),
            action=action,
            winch=winch,
            adapts=adapts,
            light=task.nominal.is_light,
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features for the residual and the speed action."""
        return (STATE_FEATURES if self.sensors is None else SENSED_FEATURES) + WINCH_FEATURES * self.winch


def require_action(action: Action, winch: bool, adapts: bool) -> None:
    """Raise where there is no such action, or it does not go with the ``winch`` as features or a base that adapts."""
    require_choice("action", action, ACTIONS)
    if adapts and action != "predictive":
        raise InvalidValue(f"adapts = True: what adapts is predictive control, and action = {action!r}: must be False")
    if winch and action == "predictive":
        raise InvalidValue("winch = True: the features of predictive control have its limits already: must be False")


class Features:
    """Features of N rows for the residual and the speed action, and what their outputs ask of the winches."""

    def __init__(self, rows: int, config: FeatureConfig) -> None:
        self.rows = rows
        self._action, self._winch = config.action, config.winch
        self.names = config.names
        self._hoists = HoistBatch(rows, config.control_period, STATE if config.sensors is None else SENSED)
        self._observer = observer_for(self._hoists, DAMPING_RATIO, config.sensors, config.waves)
        self._rise, self._turned = np.zeros((2, rows))
        """Rise of the pulleys [m] and turn of the drums [rad] in this control step."""
        self._speed_before = np.zeros(rows)
        """Reckoned speed of the drums at its beginning, rad/s."""

    def start(self, observation: Observation, lifts: Sequence[Lift], rows: Rows = ALL) -> Float32Array:
        """Features (n, F) of the first observations (n, K) of these ``rows``, whose past is forgotten."""
        o = self._hoists.start(lifts, observation, rows)
        self._observer.start(o, rows)
        return self._look(o, rows)

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        self._observer.retune(self._hoists.retune(rope_length, growth, wet))

    def advance(self, observation: Observation) -> Float32Array:
        """Features (N, F) of all rows, whose observations (N, K) are one control step later."""
        o = self._hoists.columns(observation)
        self._observer.advance(self._turned, o)
        return self._look(o, ALL)

    def command(self, output: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for a network's output (N,), in [-1, 1]."""
        winch, period = self._hoists.winch, self._hoists.period
        self._speed_before = winch.speed.copy()
        if self._action == "speed":
            command = np.clip(output, -1.0, 1.0) * winch.max_speed
            self._turned = winch.turn(command)
            return command
        turn = wanted_turn(np, self._rise, output, winch.radius, winch.max_acceleration, period)
        command, self._turned = winch.command(turn)
        return command

    def overrule(self, command: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Reckon with commands (N,) rad/s that somebody else gives in place of the last ones.

        Return the drums' speeds (N,) rad/s at the end of the control step under the last commands, and under these.
        """
        winch = self._hoists.winch
        asked = winch.speed.copy()
        winch.speed[:] = self._speed_before
        self._turned = winch.turn(command)
        return asked, winch.speed.copy()

    def _look(self, o: Columns, rows: Rows) -> Float32Array:
        hoists, observer = self._hoists, self._observer
        self._rise[rows] = observer.rises(1)[0, rows]
        velocity, *accelerations = observer.pulley()
        features = (
            *load_features(np, observer.state()[rows].T),
            velocity[rows],
            *(each[rows] for each in accelerations),
            *lift_features(o["pulley_heave"], hoists.mass[rows], o["rope_length"], hoists.frequency[rows]),
        )
        if self._winch:
            features += tuple(each[rows] for each in winch_features(hoists.winch))
        return np.asarray(np.clip(np.stack(features, axis=1), -LIMIT, LIMIT), dtype=np.float32)


# For arrays of numpy (``xp`` = numpy) and tensors of torch (``xp`` = torch) alike, all (N,).


def load_features(xp: Any, z: Any) -> tuple[Any, ...]:
    """The first features, not clipped yet, from the state z of ``RopeModel``, 4 of (N,)."""
    return (
        # Beyond some metres only the side of the error: there the agent does what it has learned nearer.
        4.0 * xp.tanh(0.5 * z[0]),
        2.0 * xp.tanh(10.0 * z[0]),
        5.0 * z[1],
        20.0 * (z[2] - z[0]),
        10.0 * z[3],
    )


def lift_features(pulley_heave: Any, mass: Any, rope_length: Any, frequency: Any) -> tuple[Any, ...]:
    """The last features, not clipped yet; ``frequency`` of the loads' bobbing, rad/s."""
    return 0.5 * pulley_heave, mass / 5.0e4 - 1.2, rope_length / 1.0e3 - 0.8, 0.25 * frequency - 1.0


def winch_features(winch: WinchModel) -> tuple[FloatArray, ...]:
    """``WINCH_FEATURES``, not clipped yet."""
    return 0.5 * winch.radius * winch.max_speed, winch.radius * winch.max_acceleration, 5.0 * winch.lag


def wanted_turn(xp: Any, rise: Any, output: Any, radius: Any, max_acceleration: Any, period: float) -> Any:
    """Turn of the drums, rad, while the pulleys ``rise`` m, for a network's ``output`` in [-1, 1]."""
    up = AUTHORITY * max_acceleration * radius * xp.clip(output, -1.0, 1.0)
    return (rise - period * up) / radius
