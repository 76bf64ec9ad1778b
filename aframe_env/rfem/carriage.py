"""What carries the frame in a stand-alone run: the deck, and its own luffing on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aframe_env.rfem.beam import Array
from aframe_env.rfem.deck import DeckStates, deck_coordinates, deck_states
from aframe_env.rfem.luffed import LuffedFrame
from aframe_env.rfem.model import FrameModel
from aframe_env.rfem.structure import cross_matrix
from aframe_env.scenario import Scenario


def axes_states(states: DeckStates, model: FrameModel, luffed: LuffedFrame | None) -> DeckStates:
    """The frame's axes {F} in place of the deck's: {F} → base frame, and vectors along {F}."""
    if luffed is None:
        return replace(
            states,
            rotation=states.rotation @ model.to_deck,
            angular_velocity=states.angular_velocity @ model.to_deck,
            angular_acceleration=states.angular_acceleration @ model.to_deck,
        )
    about = np.array([0.0, 1.0, 0.0])
    own = luffed.swing.angle_rate[:, None] * about
    spin_up = states.angular_acceleration + luffed.swing.angle_acceleration[:, None] * about
    spin_up = spin_up + np.cross(states.angular_velocity, own)
    return replace(
        states,
        rotation=states.rotation @ luffed.to_deck,
        angular_velocity=np.einsum("kij,ki->kj", luffed.to_deck, states.angular_velocity + own),
        angular_acceleration=np.einsum("kij,ki->kj", luffed.to_deck, spin_up),
    )


class Carriage:
    """Deck and frame's axes {F} at every step, in the shape that the frame wants."""

    def __init__(
        self, scenario: Scenario, model: FrameModel, luffed: LuffedFrame | None, step: float, count: int
    ) -> None:
        self.states = deck_states(deck_coordinates(scenario, step, count))
        axes, crane = axes_states(self.states, model, luffed), scenario.crane
        self.pulley_place, self.pulley_speed = _carried_point(axes, np.array([0.0, 0.0, crane.frame.height]))
        self.drum_place, self.drum_speed = _carried_point(self.states, np.array(crane.drum_position))
        self.rotation = axes.rotation
        """{F} → base frame, (k, 3, 3)."""
        gravity = np.array([0.0, 0.0, -scenario.gravity])
        self.field = np.einsum("kij,ki->kj", self.rotation, gravity - axes.acceleration)
        self.spin, spin_up = axes.angular_velocity, axes.angular_acceleration
        self.turns = bool(np.any(self.spin) or np.any(spin_up))
        skew = np.array([cross_matrix(vector) for vector in self.spin])
        self.turning = np.array([cross_matrix(vector) for vector in spin_up]) + skew @ skew
        self.coriolis = 2.0 * skew


def _carried_point(states: DeckStates, place: Array) -> tuple[Array, Array]:
    """Place and velocity in the base frame, (k, 3) each, of a point fixed at ``place`` in the axes of ``states``."""
    position = states.position + states.rotation @ place
    turning = np.cross(states.angular_velocity, place)
    return position, states.velocity + np.einsum("kij,kj->ki", states.rotation, turning)
