"""The load on a rope with mass, in water: its bobbing and the first waves in the rope, sampled every control step.

``agents.control.rope`` has the bobbing alone. Here the rope below the pulley S is a bar of finite elements with the
load at its end, the rope from S to the drum a spring above it, all in deviations from rest. Its upper end q is moved;
the modes follow it by η'' + β ω² η' + ω² η = -Γ q'' + φ F, with φ the load's part in a mode, Γ the mode's part in a
motion of all of it, β the material's loss time, and F = -½ ρ C_d A |v| v the water's force on the load. The depth error
is q + Σ φ η, the tension at S beyond that at rest -Σ Γ ω² (η + β η'), of which β's part is left out. A rope without
mass has one mode, the bobbing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import eigh, expm

from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import GRAVITY, Rope
from agents.control.filters import FloatArray, Rows
from agents.control.lift import LEAST_WEIGHT, Lift, share_under_water

MODES: Final = 2
"""Modes of a rope with mass, the load's bobbing among them."""
STATE: Final = 2 * MODES + 1
"""Numbers of a state: depth error, its rate and where the rope's end is, m and m/s; the rest tells the higher modes."""
ELEMENTS: Final = 12
"""Finite elements of a rope below the pulley."""

LEAST_BELOW: Final = 1.0
"""Least rope below the pulley that is reckoned with, m."""


class Hanging(NamedTuple):
    """What hangs from a drum."""

    rope: Rope
    below: float
    """Unstretched rope below the pulley, m."""
    drum_part: float
    """Rope from there to the drum, m."""
    inertia: float
    """Load with its added mass, kg."""
    drag: float
    """½ ρ C_d A of the load, with what has as much work of the water along the rope, N s²/m²."""
    loss_time: float
    """β, s."""

    @classmethod
    def of(cls, scenario: Scenario) -> Hanging:
        """What truly hangs in a scenario."""
        below, drum_part = scenario.lengths
        share = share_under_water(scenario, scenario.target_level)
        inertia = scenario.load_mass + share * scenario.load.added_mass_vertical
        return cls(scenario.crane.rope, below, drum_part, inertia, drag_of(scenario, below, share), scenario.loss_time)

    @classmethod
    def weighed(cls, lift: Lift, rope_length: float, mass: float, share: float) -> Hanging:
        """What is known on board: the lift, unstretched rope from drum to load, m, the mass that bobs, kg, and the
        share of the load that is under water."""
        rope, drum_part = lift.crane.rope, lift.crane.drum_to_pulley
        below = max(rope_length - drum_part, LEAST_BELOW)
        # A pin that reads less than the rope alone weighs must not make a load of less than nothing.
        inertia = max(mass - rope.mass_per_length * below / 3.0, LEAST_WEIGHT / GRAVITY)
        return cls(rope, below, drum_part, inertia, drag_of(lift, below, share), rope.loss_time)


def drag_of(lift: Lift, below: float, share: float) -> float:
    """½ ρ C_d A [N s²/m²] of a load of which a ``share`` is wet, with what has as much work of the water along
    ``below`` m of rope."""
    if lift.water is None:
        return 0.0
    rope = lift.crane.rope
    # Along the rope the speed falls from the load's to that of the still pulley, and the work with its cube.
    along = rope.tangential_drag * math.pi * rope.solid_diameter * below / 4.0
    return 0.5 * lift.water.density * (share * lift.load.drag_area_vertical + along)


class Chains(NamedTuple):
    """N loads on their ropes."""

    transition: FloatArray
    """(N, S, S + 1): state after a step, of the state before it and the mean speed of the rope's end."""
    drag: FloatArray
    """(N, S): what drag adds to it for each |v| v, v the load's mean speed."""
    pull: FloatArray
    """(N, S): tension at the pulley beyond that at rest, N, of the state."""

    @classmethod
    def of(cls, all_of_them: Sequence[Hanging], period: float) -> Chains:
        """Of what hangs from N drums, sampled every ``period`` s."""
        return cls(*map(np.stack, zip(*(_sampled(each, period) for each in all_of_them), strict=True)))

    def replace(self, rows: Rows, other: Chains) -> None:
        """Put the rows of others in the place of these."""
        for mine, theirs in zip(self, other, strict=True):
            mine[rows] = theirs

    def advance(self, state: FloatArray, speed: FloatArray) -> FloatArray:
        """State (N, S) a step after ``state`` (N, S), the rope's end going up at a mean ``speed`` (N,) m/s."""
        moved = np.concatenate([state, speed[:, None]], axis=1)
        after = (self.transition @ moved[:, :, None])[:, :, 0]
        # The load's mean speed, of which drag takes half of what it takes by the step's end.
        free = 0.5 * (state[:, 1:2] + after[:, 1:2])
        velocity = 2.0 * free / (1.0 + np.sqrt(1.0 - 2.0 * self.drag[:, 1:2] * abs(free)))
        return np.asarray(after + self.drag * (abs(velocity) * velocity))


class _Modes(NamedTuple):
    """Modes, slowest first, (m,)."""

    frequency: FloatArray
    """rad/s."""
    load: FloatArray
    """φ, 1/√kg."""
    participation: FloatArray
    """Γ, √kg."""


def _modes(hanging: Hanging) -> _Modes:
    rope, element = hanging.rope, hanging.below / ELEMENTS
    if not rope.mass_per_length:
        root, length = math.sqrt(hanging.inertia), hanging.below + hanging.drum_part
        return _Modes(*(np.array([each]) for each in (math.sqrt(rope.axial_stiffness / length) / root, 1 / root, root)))
    stiffness, mass = np.zeros((2, ELEMENTS + 1, ELEMENTS + 1))
    for i in range(ELEMENTS):
        both = slice(i, i + 2)
        stiffness[both, both] += rope.axial_stiffness / element * np.array([[1.0, -1.0], [-1.0, 1.0]])
        mass[both, both] += rope.mass_per_length * element / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    mass[0, 0] += hanging.inertia
    stiffness[-1, -1] += rope.axial_stiffness / hanging.drum_part
    square, shapes = eigh(stiffness, mass, subset_by_index=(0, MODES - 1))
    load, participation = shapes[0], mass.sum(axis=0) @ shapes
    # The load goes along with its rope's end when all modes do: the last stands for those that are left out.
    participation[-1] += (1.0 - load @ participation) / load[-1]
    return _Modes(np.sqrt(square), load, participation)


def _sampled(hanging: Hanging, period: float) -> Chains:
    """One load on its rope, without the axis of the rows."""
    frequency, load, participation = _modes(hanging)
    count = len(frequency)
    size = 2 * count + 1
    # The rope's end q, all η, and all η' + Γ q', which no jump of q' changes; then q' itself and F.
    rate = np.zeros((size + 2, size + 2))
    shape, speed = np.arange(1, count + 1), np.arange(count + 1, size)
    loss = hanging.loss_time * frequency**2
    rate[0, size] = 1.0
    rate[shape, speed], rate[shape, size] = 1.0, -participation
    rate[speed, shape], rate[speed, speed], rate[speed, size] = -(frequency**2), -loss, loss * participation
    rate[speed, size + 1] = load
    sampled = expm(rate * period)
    # Depth error and its rate in the place of the first mode.
    into = np.eye(size)
    into[1, 0], into[1, shape], into[count + 1, speed] = 1.0, load, load
    into = into[[1, count + 1, 0, *shape[1:], *speed[1:]]]
    out = np.linalg.inv(into)
    pull = np.zeros(size)
    pull[shape] = -participation * frequency**2
    # Ropes without mass have as many numbers, and do without the last.
    transition, drag, told = np.zeros((STATE, STATE + 1)), np.zeros(STATE), np.zeros(STATE)
    transition[:size, :size] = into @ sampled[:size, :size] @ out
    transition[:size, -1] = into @ sampled[:size, size]
    drag[:size] = -hanging.drag * (into @ sampled[:size, size + 1])
    told[:size] = pull @ out
    return Chains(transition, drag, told)
