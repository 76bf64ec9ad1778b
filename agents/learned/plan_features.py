"""Features of the agents that correct predictive control: the plan, what it asks of the winch, and the waves to come.

The network's output is added to the plan's first change of the drum's speed, as a share of what the winch can gain or
lose in a control step. On the full state it counts the more the nearer to its limits the winch will come: where it
stays far from them, predictive control leaves nothing to gain. With an output of zero the drum does what predictive
control plans.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from agents.control.filters import ALL, FloatArray, Rows
from agents.control.lift import Lift
from agents.control.predictive import Plan, Planner, PlanningConfig
from agents.control.regulator import Columns, Observation
from agents.learned.features import LIMIT, FeatureConfig, lift_features, load_features

Float32Array = npt.NDArray[np.float32]

FORESEEN: Final = (1, 3, 5, 8, 12, 16, 20, 25, 30, 36, 42, 49)
"""Control steps to come whose waves are features."""
PLANNED: Final = (1, 2, 3)
"""Those whose planned use of the winch's acceleration is one."""
EXPECTED: Final = (5, 10, 20, 30, 45)
"""Those whose expected depth error is one."""
DEMANDED: Final = (2, 10, 25, 49)
"""Those up to which the greatest demand on the winch is one."""

FAR_FROM_LIMITS: Final = 0.6
"""Greatest demand on the winch within the horizon, as a share of its limits, below which outputs on the full state move
nothing; they have their full weight from 1 on."""

PLAN_FEATURES: Final = (
    "depth_error",
    "depth_error_near_zero",
    "load_velocity_z",
    "stretch_deviation",
    "rope_end_speed",
    "pulley_heave",
    "load_mass",
    "rope_length",
    "bobbing_rate",
    "planned_change",
    "regulated_change",
    *(f"planned_change_{k}" for k in PLANNED),
    *(f"depth_error_expected_{k}" for k in EXPECTED),
    "greatest_depth_error_expected",
    *(f"acceleration_demand_{k}" for k in DEMANDED),
    *(f"speed_demand_{k}" for k in DEMANDED),
    *(f"pulley_acceleration_{k}" for k in FORESEEN),
    *(f"pulley_velocity_{k}" for k in FORESEEN),
    "drum_speed",
    "winch_acceleration",
    "winch_speed",
    "winch_acceleration_log",
)


class PlanFeatures:
    """Features of N rows, and what their outputs ask of the winches."""

    names = PLAN_FEATURES

    def __init__(self, rows: int, config: FeatureConfig) -> None:
        self.rows = rows
        self._knows_state = config.sensors is None
        self._weight = np.ones(rows)
        planning = PlanningConfig.of(config.sensors, config.waves, light=config.light, adapts=config.adapts)
        self._planner = Planner(rows, config.control_period, planning)
        self._heave, self._length, self._planned = np.zeros((3, rows))

    def start(self, observation: Observation, lifts: Sequence[Lift], rows: Rows = ALL) -> Float32Array:
        """Features (n, F) of the first observations (n, K) of these ``rows``, whose past is forgotten."""
        self._take(self._planner.start(observation, lifts, rows), rows)
        return self._look()[rows]

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        self._planner.retune(rope_length, growth, wet)

    def advance(self, observation: Observation) -> Float32Array:
        """Features (N, F) of all rows, whose observations (N, K) are one control step later."""
        self._take(self._planner.advance(observation), ALL)
        return self._look()

    def command(self, output: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for a network's output (N,), in [-1, 1]."""
        corrected = np.clip(self._planned + self._weight * np.clip(output, -1.0, 1.0), -1.0, 1.0)
        # Untouched where nothing is added: a plan may ask for more than the winch gives.
        return self._planner.command(self._rope_speed + 0.5 * self._gain * (corrected - self._planned))

    def _take(self, o: Columns, rows: Rows) -> None:
        self._heave[rows], self._length[rows] = o["pulley_heave"], o["rope_length"]

    def _look(self) -> Float32Array:
        hoists, plan = self._planner.hoists, self._planner.plan()
        winch = hoists.winch
        acceleration, fastest = winch.radius * winch.max_acceleration, winch.radius * winch.max_speed
        drum_speed = winch.radius * winch.speed
        self._gain = hoists.period * acceleration
        self._rope_speed = plan.rope_speed
        self._planned = np.clip(2.0 * (plan.rope_speed - drum_speed) / self._gain, -1.0, 1.0)
        demand = np.maximum(plan.acceleration_demand, plan.speed_demand).max(axis=1)
        if self._knows_state:
            self._weight = np.clip((demand - FAR_FROM_LIMITS) / (1.0 - FAR_FROM_LIMITS), 0.0, 1.0)
        regulated = 2.0 * (plan.regulated_rope_speed - drum_speed) / self._gain
        later = plan.drum_change[:, PLANNED] / self._gain[:, None]
        features = (
            *load_features(np, plan.state.T),
            *lift_features(self._heave, hoists.mass, self._length, hoists.frequency),
            self._planned,
            np.clip(regulated, -3.0, 3.0),
            *np.clip(later, -1.0, 1.0).T,
            *np.clip(4.0 * plan.depth_error[:, EXPECTED], -5.0, 5.0).T,
            abs(plan.depth_error).max(axis=1),
            *_greatest(plan.acceleration_demand),
            *_greatest(plan.speed_demand),
            *_waves(plan, hoists.period, acceleration, fastest),
            drum_speed / fastest,
            acceleration,
            0.5 * fastest,
            np.log(acceleration),
        )
        return np.asarray(np.clip(np.stack(features, axis=1), -LIMIT, LIMIT), dtype=np.float32)


def _greatest(demand: FloatArray) -> FloatArray:
    """Greatest demand up to each of ``DEMANDED``, (4, N)."""
    return np.clip(np.maximum.accumulate(demand, axis=1)[:, DEMANDED], 0.0, 4.0).T


def _waves(plan: Plan, period: float, acceleration: FloatArray, fastest: FloatArray) -> tuple[FloatArray, ...]:
    """Accelerations and velocities of the pulley to come, as shares of the winch's greatest ones."""
    change = np.diff(plan.pulley, axis=1, prepend=plan.pulley[:, :1]) / period
    speed = plan.pulley[:, np.array(FORESEEN) - 1]
    return (
        *np.clip(change[:, FORESEEN] / acceleration[:, None], -3.0, 3.0).T,
        *np.clip(speed / fastest[:, None], -3.0, 3.0).T,
    )
