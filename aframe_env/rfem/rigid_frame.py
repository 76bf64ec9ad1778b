"""The rigid frame of the simplified model: what holds and swings it.

Newton and Euler for the whole frame about the feet's axis: the deck carries it, the servomotors turn it, and the rope
pulls at S along both its legs. Of a rope with mass, what its lumps hand on to S across the line to the load is left
out; the servomotors have no mass.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.rfem.beam import Array
from aframe_env.rfem.deck import deck_coordinates, deck_states
from aframe_env.rfem.structure import Division, body_of, one_chain
from aframe_env.scenario import Luffing, Scenario


class FrameForces(NamedTuple):
    """Forces on the rigid frame at k times, vectors along {D}."""

    servomotor_force: Array
    """Thrust of both servomotors together, from the deck on the legs, N: (k,)."""
    luffing_power: Array
    """Power of both together, W; negative where the frame's weight drives them: (k,)."""
    foot_reaction: Array
    """Force of the deck on both feet together, N: (k, 3)."""


def frame_forces(scenario: Scenario, step: float, load: npt.ArrayLike, tension: npt.ArrayLike) -> FrameForces:
    """Forces on the frame of a run: load's place (k, 3) m, base frame, and rope tension (k,) N every ``step`` s from 0.

    The tension is that at the drum; the pulley turns without friction.
    """
    load, tension = np.asarray(load, dtype=np.float64), np.asarray(tension, dtype=np.float64)
    frame, count = scenario.crane.frame, len(load)
    held = Luffing(points=((0.0, frame.luffing_angle), (1.0, frame.luffing_angle)))
    swing = (scenario.luffing or held).at(frame, step * np.arange(count))
    deck = deck_states(deck_coordinates(scenario, step, count))
    chain = one_chain(frame, Division(leg=1, beam=2))
    body = body_of([segment for part in chain.bodies for segment in part.segments])
    sine, cosine = np.sin(swing.angle), np.cos(swing.angle)
    zero, one = np.zeros(count), np.ones(count)
    turned = np.array([[cosine, zero, sine], [zero, one, zero], [-sine, zero, cosine]]).transpose(2, 0, 1)
    axes = turned @ body.axes
    inertia = (axes * body.inertia) @ axes.transpose(0, 2, 1)
    centre = turned @ body.centre
    about = np.array([0.0, 1.0, 0.0])
    own = swing.angle_rate[:, None] * about
    spin = deck.angular_velocity + own
    spin_up = deck.angular_acceleration + swing.angle_acceleration[:, None] * about
    spin_up = spin_up + np.cross(deck.angular_velocity, own)
    felt = deck.acceleration + np.array([0.0, 0.0, scenario.gravity])
    force = _along_deck(deck.rotation, felt) + np.cross(spin_up, centre) + np.cross(spin, np.cross(spin, centre))
    force = body.mass * force
    moment = np.cross(centre, force) + _times(inertia, spin_up) + np.cross(spin, _times(inertia, spin))
    to_load = _along_deck(deck.rotation, load - deck.position) - swing.pulley
    to_drum = np.asarray(scenario.crane.drum_position) - swing.pulley
    pull = tension[:, None] * (_unit(to_load) + _unit(to_drum))
    on_leg = frame.servomotor_height * np.stack([sine, zero, cosine], axis=1)
    along = on_leg - [frame.servomotor_deck_x, 0.0, 0.0]
    length = np.linalg.norm(along, axis=1)
    arm = np.cross(on_leg, _unit(along))[:, 1]
    thrust = (moment - np.cross(swing.pulley, pull))[:, 1] / arm
    # By L L' = -r c cos φ φ', and so the arm is dL/dφ.
    power = thrust * arm * swing.angle_rate
    return FrameForces(thrust, power, force - pull - thrust[:, None] * along / length[:, None])


def _along_deck(rotation: Array, vectors: Array) -> Array:
    """Vectors (k, 3) of the base frame along {D}."""
    return np.asarray(np.einsum("kji,kj->ki", rotation, vectors))


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])
