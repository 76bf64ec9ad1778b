"""A full model that luffs: {F} turns with the rigid frame's angle φ(t), so that displacements in it stay small.

What turns in {F} is the line e of the servomotors, and with it the modes of a frame that they hold, e·u_N = 0. Nodes of
the luffing angle, every three degrees or so, have a model and modes each (:mod:`aframe_env.rfem.stage`), and a run goes
from those of one node to those of the next. Between them the line is taken apart: e_0 is that of the node, and n lies
across it in the plane of leg and servomotor. With τ = (e·n)/(e·e_0) and μ = T e·e_0, T a servomotor's tension,

    e_0·u_N = s = −τ n·u_N,    −T e = −μ e_0 − τ μ n:

μ is the reaction of the node's own constraint with a small prescribed stroke s, and τ μ n a force as others are. s̈ and
μ follow from η̈, which follows from them; only what the static shapes add to s̈, of second order in τ, is left out.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aframe_env.rfem.beam import Array
from aframe_env.rfem.constraints import constrain
from aframe_env.rfem.model import FrameModel
from aframe_env.scenario.crane import Frame
from aframe_env.scenario.luffing import Luffing, Swing

SPACING = math.radians(3.0)
"""Most between two nodes of the luffing angle, rad: what the modes of the nearest leave out is then some 3e-5 of the
range of a deflection or reaction."""


class LuffedFrame(NamedTuple):
    """A luffing frame and its servomotors at k times."""

    swing: Swing
    to_deck: Array
    """{F} → {D}, (k, 3, 3)."""
    line: Array
    """e, from C on the deck to N on the leg, along {F}, (k, 3)."""
    turning: Array
    """Its rate of turning in {F}, from x to z, and that one's rate, (k, 2), rad/s and rad/s²."""
    length_rate: Array
    """Rate of a servomotor's length, (k,), m/s."""

    def every(self, stride: int) -> LuffedFrame:
        """Every ``stride``-th of the times from the first."""
        swing, *rest = self
        return LuffedFrame(Swing(*(part[::stride] for part in swing)), *(part[::stride] for part in rest))


def luffed_frame(frame: Frame, luffing: Luffing, times: Array) -> LuffedFrame:
    """The ``frame`` at ``times``, (k,), s."""
    swing = luffing.at(frame, times)
    sine, cosine, zero = np.sin(swing.angle), np.cos(swing.angle), np.zeros(times.size)
    height, deck_x = frame.servomotor_height, frame.servomotor_deck_x
    link = np.stack([-deck_x * cosine, zero, height - deck_x * sine], axis=1)
    length = np.linalg.norm(link, axis=1)
    square, rate = length**2, swing.angle_rate
    turn = deck_x * (deck_x - height * sine) / square
    turn_rate = height * deck_x * cosine * (deck_x**2 - height**2) / square**2
    return LuffedFrame(
        swing=swing,
        to_deck=np.array([[cosine, zero, sine], [zero, zero + 1.0, zero], [-sine, zero, cosine]]).transpose(2, 0, 1),
        line=link / length[:, None],
        turning=np.stack([turn * rate, turn * swing.angle_acceleration + turn_rate * rate**2], axis=1),
        length_rate=-height * deck_x * cosine / length * rate,
    )


def angle_nodes(luffing: Luffing) -> Array:
    """Luffing angles that have modes of their own, the least and the greatest among them, rad."""
    angles = [angle for _, angle in luffing.points]
    least, most = min(angles), max(angles)
    return np.linspace(least, most, 1 + math.ceil((most - least) / SPACING))


def grid_angles(luffing: Luffing) -> list[float]:
    """Luffing angles on the way that have modes of their own behind the environment beside the first, rad, rising.

    Multiples of SPACING, which other ways share.
    """
    angles = [angle for _, angle in luffing.points]
    steps = range(math.ceil(min(angles) / SPACING), math.floor(max(angles) / SPACING) + 1)
    return [step * SPACING for step in steps]


def model_at(model: FrameModel, angle: float) -> FrameModel:
    """The model of the same frame at another luffing angle, rad, without geometric stiffness."""
    frame = replace(model.frame, luffing_angle=angle)
    # Rigid servomotors turn, and nothing that the copy takes over turns with them.
    return model.changed(frame=frame, constraints=constrain(frame, model.structure, model.mass), geometric=None)
