"""The feedback law that the control policies share, and the hoists that it acts on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.scenario.crane import GRAVITY
from aframe_env.task import SENSED, STATE, Quantity
from aframe_env.validation import InvalidValue, require_number
from agents.control.chain import Chains, Hanging
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.lift import LEAST_WEIGHT, Lift, Unweighed, share_under_water, unweighed
from agents.control.rope import RopeModel
from agents.control.winch import WinchModel

QUICKEST: Final = 0.4
"""Quickest poles of a law, as a share of the first frequency of a rope's own waves, π c / L: the laws know the bobbing
alone, and one that is nearer drives the waves on."""
Observation = npt.NDArray[np.float32]
Columns = dict[str, FloatArray]
"""An observation by the names of its quantities, each (N,)."""


def readable(width: int, read: int) -> bool:
    """Whether a policy that reads so many quantities can do with observations of this ``width``.

    Those of the sensors may go on with a preview, which is left alone.
    """
    return width == read or (read == len(SENSED) and width > read and width != len(STATE))


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Gains of the feedback law."""

    effort: float
    """Weight on changes of the rope end's speed, s²: m² of squared depth error per (m/s)²."""
    share: float
    """Share of the winch's acceleration that feedback may use; the rest is the feed-forward's."""
    damping_ratio: float = 0.03
    """Damping of the load's bobbing on the rope that the law is designed for, share of critical."""

    def __post_init__(self) -> None:
        require_number("effort", self.effort, "s²", low=1e-8, high=1e8)
        require_number("share", self.share, "", low=0.0, high=1.0, low_open=True)
        require_number("damping_ratio", self.damping_ratio, "of critical", low=0.0, high=1.0)


@dataclass(frozen=True)
class Regulator:
    """Linear-quadratic regulator of the rope's end, kept within the winch's limits beside the feed-forward.

    A plain linear law winds up where the sea asks for all that the winch has: it asks for more, gets it late, and
    drives the load's bobbing on. So the rope's end moves at most ``amplitude`` to calm the bobbing, and approaches
    its goal no faster than it can be stopped at ``acceleration``.
    """

    k: FloatArray
    """(N, 4) gains on the state z of ``RopeModel``."""
    amplitude: FloatArray
    """(N,) m."""
    acceleration: FloatArray
    """(N,) m/s²."""

    def speed(self, z: FloatArray) -> FloatArray:
        """Speed (N,) m/s that the rope's end should have during the control step, from the state z (N, 4)."""
        e, v, q, p = z.T
        ke, kv, kq, kp = self.k.T
        goal = np.clip((ke * (q - e) + kv * (p - v)) / (ke + kq), -self.amplitude, self.amplitude)
        wanted = (ke + kq) / (kv + kp) * (goal - q)
        braking = np.sqrt(2.0 * self.acceleration * abs(goal - q))
        return np.asarray(p + (kv + kp) * (np.clip(wanted, -braking, braking) - p))


class HoistBatch:
    """Winches, loads and ropes of N rows, as far as a policy may know them from the lift's data and the observation.

    With a heavy rope or in water ``winch.radius`` is that of the drum times 1 + the strain at the pulley: the rope that
    a drum pays out is longer by that.
    """

    def __init__(self, rows: int, control_period: float, quantities: tuple[Quantity, ...]) -> None:
        """``quantities`` of the observations."""
        self.period = control_period
        self.winch = WinchModel(rows, control_period)
        self._columns = {q.name: i for i, q in enumerate(quantities)}
        self._axial_stiffness, self._weight, self.weighed, self.mass, self.frequency = np.ones((5, rows))
        """``weighed`` (N,) kg: mass that would weigh in air as much as hangs on the pulley; ``mass`` (N,) kg that bobs
        on the ropes, the same with a light rope in air; ``frequency`` of the bobbing, rad/s."""
        self.rope_length = np.ones(rows)
        """(N,) m of unstretched rope that all of this is for."""
        self._wet = np.ones(rows)
        self._least_effort = np.zeros(rows)
        self._drum_radius = np.ones(rows)
        self._unweighed = np.zeros((len(Unweighed._fields), rows))
        self._lifts = np.empty(rows, dtype=object)
        self.heavy = np.zeros(rows, dtype=np.bool_)
        """(N,) rows whose rope has mass, or is in water."""

    def start(self, lifts: Sequence[Lift], observation: Observation, rows: Rows = ALL) -> Columns:
        """Begin hoists of these lifts in these rows; return the first observation (n, K) by its names.

        The loads are weighed: a lift begins with the load hanging still on its rope, and what the tension reads then is
        its weight and that of the rope, whatever mass was told.
        """
        self.winch.start([lift.crane for lift in lifts], rows)
        o = self.columns(observation)
        self._lifts[rows] = lifts
        self._axial_stiffness[rows] = [lift.crane.rope.axial_stiffness for lift in lifts]
        self._weight[rows] = np.maximum(o["rope_tension"], LEAST_WEIGHT)
        lengths = o["rope_length"].tolist()
        self._drum_radius[rows] = [lift.crane.drum_radius(x) for lift, x in zip(lifts, lengths, strict=True)]
        self._unweighed[:, rows] = np.array([unweighed(lift) for lift in lifts]).T
        below = (o["rope_length"] - self._unweighed[2, rows]).tolist()
        levels = [lift.crane.pulley_position[2] - x for lift, x in zip(lifts, below, strict=True)]
        wet = list(map(share_under_water, lifts, levels))
        self._tune(o["rope_length"], self._weight[rows], np.array(wet), rows)
        return o

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> FloatArray:
        """Reckon from now on with ropes of ``rope_length`` (N,) m that bear ``growth`` (N,) N more than at the start,
        at rest, and with loads of which shares ``wet`` (N,) are under water; where the length is NaN as before.

        Tensions are read less that growth. Return by what factor the ropes are longer than before, (N,).
        """
        before, rows = self.rope_length.copy(), np.flatnonzero(~np.isnan(rope_length))
        self._tune(rope_length[rows], self._weight[rows] + growth[rows], wet[rows], rows)
        return np.asarray(self.rope_length / before)

    def _tune(self, rope_length: FloatArray, weight: FloatArray, wet: FloatArray, rows: Rows) -> None:
        self.rope_length[rows], self._wet[rows] = rope_length, wet
        self.weighed[rows] = weight / GRAVITY
        fixed, by_length, drum_part, softness, slowness = self._unweighed[:, rows]
        below = rope_length - drum_part
        # A pin that reads less than the rope alone weighs must not make a mass of less than nothing.
        moved = self.weighed[rows] + (wet * fixed + by_length * below)
        self.mass[rows] = np.maximum(moved, LEAST_WEIGHT / GRAVITY)
        self.winch.radius[rows] = self._drum_radius[rows] * (1.0 + softness * weight)
        self.frequency[rows] = np.sqrt(self._axial_stiffness[rows] / (rope_length * self.mass[rows]))
        # A regulator of this effort has its poles at (ω² / √effort / period)^¼.
        slower = (slowness * below / (QUICKEST * np.pi)) ** 4
        self._least_effort[rows] = np.square(self.frequency[rows] ** 2 * slower / self.period)
        self.heavy[rows] = softness > 0.0

    def columns(self, observation: Observation) -> Columns:
        """The observation (N, K) by the names of its quantities."""
        if not readable(observation.shape[1], len(self._columns)):
            raise InvalidValue(
                f"observation: {observation.shape[1]} quantities, the policy reads {len(self._columns)}: "
                f"{', '.join(self._columns)}"
            )
        return {name: observation[:, i].astype(np.float64) for name, i in self._columns.items()}

    def model(self, damping_ratio: float, rows: Rows = ALL) -> RopeModel:
        """Linear model of the loads and ropes."""
        return RopeModel.of(self.frequency[rows], damping_ratio, self.period)

    def chains(self, rows: Rows = ALL) -> Chains:
        """The same with the ropes' mass and the water's drag."""
        known = (self.rope_length, self.mass, self._wet)
        each = zip(self._lifts[rows], *(column[rows].tolist() for column in known), strict=True)
        return Chains.of([Hanging.weighed(*one) for one in each], self.period)

    def regulator(self, gains: Gains) -> Regulator:
        """Feedback law for the loads and ropes."""
        acceleration = gains.share * self.winch.radius * self.winch.max_acceleration
        k = self.model(gains.damping_ratio).gains(self.efforts(gains.effort))
        return Regulator(k, acceleration / self.frequency**2, acceleration)

    def efforts(self, tuned: float, rows: Rows = ALL, quickest: float = QUICKEST) -> FloatArray:
        """Efforts (n,) s² of a law: the one that was ``tuned``, or what keeps it out of the rope's own waves.

        ``quickest``: its poles, as a share of the first frequency of these.
        """
        return np.maximum(tuned, (QUICKEST / quickest) ** 8 * self._least_effort[rows])

    def stretch(self, o: Columns, rows: Rows = ALL) -> FloatArray:
        """Stretch (N,) m of the rope beyond that at rest, as the tension tells."""
        return self.stretch_under(o["rope_tension"] - self._weight[rows], o, rows)

    def stretch_under(self, force: FloatArray, o: Columns, rows: Rows = ALL) -> FloatArray:
        """Stretch (N,) m of the rope by a force (N,) N."""
        return np.asarray(force * o["rope_length"] / self._axial_stiffness[rows])
