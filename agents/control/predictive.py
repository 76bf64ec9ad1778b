"""Model-predictive control: the regulator's problem over a horizon, with the winch's limits.

Minimise Σ e² + effort c² + zᵀ P z at the horizon's end, over the changes c of the rope end's speed, so that the drum's
speed and acceleration stay within the winch's limits while the pulley moves as predicted. Where the regulator itself
keeps the limits all along the horizon, its answer is the problem's; only the other rows need a quadratic program.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import sparse

from aframe_env.scenario import Scenario
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED
from aframe_env.validation import InvalidValue, require_integer, require_number
from agents.control.observer import KalmanObserver
from agents.control.regulator import HoistBatch, Observation
from agents.control.rope import RopeModel
from agents.policy import FloatArray, Knowledge


class Problem:
    """The quadratic program of one row; its solver starts from its last solution."""

    def __init__(self, a: FloatArray, b: FloatArray, cost_to_go: FloatArray, effort: float, horizon: int) -> None:
        """A (4, 4), B (4,) of the row's model, P (4, 4) of its regulator."""
        free, forced = np.eye(4), np.zeros((4, horizon))
        hessian, self._gradient = effort * np.eye(horizon), np.zeros((horizon, 4))
        for k in range(horizon):
            free, forced = a @ free, a @ forced
            forced[:, k] += b
            weight = np.diag([1.0, 0.0, 0.0, 0.0]) if k < horizon - 1 else cost_to_go
            hessian += forced.T @ weight @ forced
            self._gradient += forced.T @ weight @ free
        self.hessian = hessian
        self.limits = np.concatenate([np.eye(horizon), np.tril(np.ones((horizon, horizon)))])
        """(2 H, H): the changes, and the speeds that they add up to."""
        self._solver: Any = None

    def gradient(self, z: FloatArray) -> FloatArray:
        """Gradient (H,) of the cost at the state z (4,)."""
        return np.asarray(self._gradient @ z)

    def solve(self, z: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        """Changes (H,) m/s, between ``low`` and ``high`` (2 H,) with the speeds that they add up to."""
        if self._solver is None:
            try:
                import osqp
            except ImportError as error:
                raise InvalidValue(
                    "predictive control needs the package osqp: pip install aframe-heave[control]"
                ) from (error)
            self._scale = float(np.trace(self.hessian)) / len(self.hessian)
            self._solver = osqp.OSQP()
            self._solver.setup(
                sparse.csc_matrix(np.triu(self.hessian) / self._scale),
                self.gradient(z) / self._scale,
                sparse.csc_matrix(self.limits),
                low,
                high,
                verbose=False,
                eps_abs=1e-5,
                eps_rel=1e-5,
                max_iter=2000,
                adaptive_rho_interval=50,
            )
        else:
            self._solver.update(q=self.gradient(z) / self._scale, l=low, u=high)
        return np.asarray(self._solver.solve(raise_error=False).x)


@dataclass
class PredictiveControl:
    """Model-predictive control on the sensors; the agents' Kalman filters predict the motion."""

    effort: float = 0.026
    """Weight on changes of the rope end's speed, s²; that of the feedback law beside it."""
    horizon: int = 25
    """Control steps."""
    damping_ratio: float = 0.03
    """Damping of the load's bobbing on the rope that the law is designed for, share of critical."""
    sensors: Sensors = field(default_factory=Sensors)
    """Delay and noise that the law is designed for."""
    name: str = "predictive control"
    knows: Knowledge = field(init=False, default=Knowledge.SENSORS)
    _scenarios: Sequence[Scenario] = field(init=False, repr=False, default=())
    _period: float = field(init=False, repr=False, default=0.1)
    _hoists: HoistBatch | None = field(init=False, repr=False, default=None)
    _model: RopeModel = field(init=False, repr=False)
    _k: FloatArray = field(init=False, repr=False)
    _problems: dict[int, Problem] = field(init=False, repr=False)
    _observer: KalmanObserver = field(init=False, repr=False)
    _turned: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        require_number("effort", self.effort, "s²", low=1e-8, high=1e8)
        require_integer("horizon", self.horizon, low=2, high=1000)
        require_number("damping_ratio", self.damping_ratio, "of critical", low=0.0, high=1.0)

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only the crane is looked at."""
        self._scenarios, self._period, self._hoists = scenarios, control_period, None

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for readings (N, 10)."""
        if self._hoists is None:
            hoists = self._hoists = HoistBatch(len(observation), self._period, SENSED)
            o = hoists.start([s.crane for s in self._scenarios], observation)
            self._observer = KalmanObserver(hoists, self.damping_ratio, self.sensors)
            self._observer.start(o)
            self._model = self._observer.model
            self._k = self._model.gains(self.effort)
            self._problems = {}
        else:
            hoists = self._hoists
            self._observer.advance(self._turned, hoists.columns(observation))
        z, pulley = self._observer.state(), self._observer.rises(self.horizon).T / self._period
        change = self.first_change(z, pulley, hoists.winch.speed)
        speed = pulley[:, 0] - z[:, 3] - change
        command, self._turned = hoists.winch.command(self._period * speed / hoists.winch.radius)
        return command

    def first_change(self, z: FloatArray, pulley: FloatArray, drum_speed: FloatArray) -> FloatArray:
        """Change (N,) m/s of the rope end's speed, from states z (N, 4) and mean pulley speeds (N, H) m/s to come."""
        low, high = self._limits(z, pulley, drum_speed)
        changes = np.empty_like(pulley)
        state = z
        for k in range(self.horizon):
            changes[:, k] = -(self._k * state).sum(axis=1)
            state = self._model.advance(state, changes[:, k])
        both = np.concatenate([changes, np.cumsum(changes, axis=1)], axis=1)
        first = changes[:, 0]
        for i in np.flatnonzero(((both < low) | (both > high)).any(axis=1)).tolist():
            if i not in self._problems:
                model, p = self._model, self._model.row(i).costs_to_go(self.effort)[0]
                self._problems[i] = Problem(model.a[i], model.b[i], p, self.effort, self.horizon)
            first[i] = np.clip(self._problems[i].solve(z[i], low[i], high[i])[0], low[i, 0], high[i, 0])
        return first

    def _limits(self, z: FloatArray, pulley: FloatArray, drum_speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds (N, 2 H) on the changes and on the speeds that they add up to."""
        assert self._hoists is not None
        winch = self._hoists.winch
        # The drum's mean speed in a control step is the pulley's less the rope end's. From its speed now it can
        # come by half of what it can gain in a whole step, and from step to step by all of it.
        gain = (self._period * winch.radius * winch.max_acceleration)[:, None]
        ahead = np.diff(pulley, axis=1)
        now = (pulley[:, 0] - z[:, 3] - winch.radius * drum_speed)[:, None]
        still, most = pulley - z[:, 3:], (winch.radius * winch.max_speed)[:, None]
        low = np.concatenate([now - 0.5 * gain, ahead - gain, still - most], axis=1)
        high = np.concatenate([now + 0.5 * gain, ahead + gain, still + most], axis=1)
        return low, high
