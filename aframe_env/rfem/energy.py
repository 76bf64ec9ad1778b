"""Energy balance of a run: work of deck and drum, energy of frame, rope and load, and dissipation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.sparse.linalg import splu

from aframe_env.rfem.beam import Array
from aframe_env.rfem.carriage import axes_states
from aframe_env.rfem.constraints import servomotor_direction
from aframe_env.rfem.deck import DeckStates
from aframe_env.rfem.history import FrameHistory
from aframe_env.rfem.simulate import DrivenDrum, DynamicResult
from aframe_env.rfem.slices import SKEW
from aframe_env.validation import InvalidValue


@dataclass(frozen=True, kw_only=True)
class EnergyBalance:
    """Energies at k times, J, each counted from its value at the first time."""

    stored: Array
    """Kinetic, potential and strain energy of frame, servomotors, rope, load and drum, (k,)."""
    input: Array
    """Work of the deck on feet, servomotors and drum, of the drum's drive, and of servomotors that change their
    length, (k,)."""
    dissipated: Array
    """Dissipation in the frame's material, servomotors and rope, (k,)."""

    @property
    def error(self) -> float:
        """Largest gap between input and stored + dissipated, over the largest energy stored or put in."""
        gap = np.max(np.abs(self.input - self.stored - self.dissipated))
        scale = max(float(np.max(np.abs(self.stored))), float(np.max(np.abs(self.input))))
        return float(gap) / scale


def energy_balance(result: DynamicResult) -> EnergyBalance:
    """Compute the balance of a run whose output interval is its step (powers are integrated by the trapezoidal rule).

    The deck's work is that of the reactions, so this checks them too. They carry the frame as if every force on it
    acted where it is undeformed, eq. (10); a deck that turns and a frame that luffs also work against the moments that
    displacements add. The tension of a servomotor keeps its undeformed direction.

    Raises:
        InvalidValue: The output interval is longer than the step; or the frame luffs with a geometric stiffness, which
            changes from angle to angle by nobody's work.
    """
    case, history = result.case, result.frame
    scenario, crane = case.scenario, case.scenario.crane
    if case.output_interval > case.step * (1.0 + 1e-9):
        raise InvalidValue(
            f"output_interval = {case.output_interval} s: must be the step, {case.step} s, for a balance"
        )
    if case.second_order and scenario.luffing is not None:
        raise InvalidValue("second_order = True: must be False for a balance with luffing")
    model, deck = history.model, result.deck
    luffed = history.luffed
    axes = axes_states(deck, model, luffed)
    moving_frame = _MovingFrame(history, axes)
    kinetic = moving_frame.kinetic() + 0.5 * scenario.load_mass * np.sum(result.load_velocity**2, axis=1)
    potential = moving_frame.potential(scenario.gravity) + scenario.weight * result.load[:, 2]
    strain = 0.5 * np.einsum("ki,ki->k", history.position @ model.stiffness, history.position)
    length = scenario.free_length + crane.winch.drum_radius * result.drum_angle
    strain += 0.5 * result.elastic_tension**2 * length / crane.rope.axial_stiffness
    loss = np.einsum("ki,ki->k", history.velocity @ model.damping, history.velocity)

    # The rope between S and H, and its pull on load and drum, in the base frame.
    moved = history.position @ model.pulley.T
    pulley_place, pulley_rate = np.array([0.0, 0.0, crane.frame.height]) + moved, history.velocity @ model.pulley.T
    pulley = deck.position + _turned(axes.rotation, pulley_place)
    pulley_speed = deck.velocity + _turned(axes.rotation, np.cross(axes.angular_velocity, pulley_place) + pulley_rate)
    drum_place = np.array(crane.drum_position)
    to_drum = deck.position + deck.rotation @ drum_place - pulley
    to_drum /= np.linalg.norm(to_drum, axis=1)[:, None]
    to_load = result.load - pulley
    to_load /= np.linalg.norm(to_load, axis=1)[:, None]

    def speed_of(place: Array) -> Array:
        """Of a point fixed in {D}, in the base frame."""
        return np.asarray(deck.velocity + _turned(deck.rotation, np.cross(deck.angular_velocity, place)))

    rate = np.sum(to_drum * (speed_of(drum_place) - pulley_speed), axis=1)
    rate += np.sum(to_load * (result.load_velocity - pulley_speed), axis=1)
    rate -= crane.winch.drum_radius * result.drum_rate
    loss += (result.tension - result.elastic_tension) * rate

    power = result.tension * np.sum(to_drum * speed_of(drum_place), axis=1)
    feet = history.feet()
    frame, servomotors = model.frame, history.servomotors()
    for column, (side, sign) in enumerate((("R", -1.0), ("L", 1.0))):
        foot = np.array([0.0, sign * frame.half_width, 0.0])
        power += np.sum(_turned(deck.rotation, feet[:, column]) * speed_of(foot), axis=1)
        end = np.array([frame.servomotor_deck_x, sign * frame.half_width, 0.0])
        if luffed is None:
            along = servomotor_direction(frame, side) * np.ones((deck.position.shape[0], 1))
        else:
            along = luffed.line
            # The line turns in {F}, where N moves across it.
            moving = history.velocity @ model.structure.translation(f"N_{side}").T
            power -= servomotors[:, column] * np.sum(along * moving, axis=1)
        power -= servomotors[:, column] * np.sum(speed_of(end) * _turned(axes.rotation, along), axis=1)
    pull = result.tension[:, None] * _turned(axes.rotation.swapaxes(1, 2), to_load + to_drum)
    power -= np.sum(axes.angular_velocity * (moving_frame.moments() + np.cross(moved, pull)), axis=1)
    if luffed is not None:
        power += history.luffing_power()
    elif history.stroke is not None:
        power -= np.sum(servomotors * history.stroke[1], axis=1)
    drum = case.drum
    drawn = result.tension + 0.5 * result.elastic_tension**2 / crane.rope.axial_stiffness
    if isinstance(drum, DrivenDrum):
        kinetic += 0.5 * drum.inertia * result.drum_rate**2
        moments = [
            drum.torque(float(t), float(a), float(w))
            for t, a, w in zip(result.time, result.drum_angle, result.drum_rate, strict=True)
        ]
        power += np.array(moments) * result.drum_rate
    else:
        power -= drawn * crane.winch.drum_radius * result.drum_rate
    stored = kinetic + potential + strain
    return EnergyBalance(
        stored=stored - stored[0],
        input=cumulative_trapezoid(power, result.time, initial=0),
        dissipated=cumulative_trapezoid(loss, result.time, initial=0),
    )


class _MovingFrame:
    """The frame's slices over a run, along {F}."""

    def __init__(self, history: FrameHistory, axes: DeckStates) -> None:
        """``axes``: {F}, which carry it."""
        model = history.model
        self._slices, self._axes, self._field = model.slices, axes, history.field
        self._spin = _skew(axes.angular_velocity)
        self._turning = _skew(axes.angular_acceleration) + self._spin @ self._spin
        forces = history.force - history.position @ model.stiffness - history.velocity @ model.damping
        forces = forces + history.constraint_forces()
        accelerated = splu(model.mass.tocsc()).solve(np.ascontiguousarray(forces.T)).T
        self._moved, self._moving, self._accelerated = (
            [np.moveaxis(part, 2, 0) for part in self._slices.moved(np.ascontiguousarray(motion.T))]
            for motion in (history.position, history.velocity, accelerated)
        )

    def kinetic(self) -> Array:
        """(k,), J: of slices that move by u + θ× y in a frame that turns."""
        slices, spin = self._slices, self._spin
        own = np.einsum("kij,ki->kj", self._axes.rotation, self._axes.velocity)
        place = slices.place + self._moved[0]
        speed = own[:, None] + np.einsum("kij,ksj->ksi", spin, place) + self._moving[0]
        gradient = spin[:, None] @ (np.eye(3) + _skew(self._moved[1])) + _skew(self._moving[1])
        turning = np.einsum("ksij,sjl,ksil->k", gradient, slices.second, gradient)
        return np.asarray(0.5 * (np.einsum("s,ksi,ksi->k", slices.mass, speed, speed) + turning))

    def potential(self, gravity: float) -> Array:
        """(k,), J."""
        place = np.einsum("kj,ksj->ks", self._axes.rotation[:, 2], self._slices.place + self._moved[0])
        return np.asarray(gravity * (self._slices.mass @ (self._axes.position[:, 2] + place.T)))

    def moments(self) -> Array:
        """Moments of weight and inertia that the displacements add, about the deck's origin, (k, 3), N m."""
        slices, turning, coriolis = self._slices, self._turning, 2.0 * self._spin
        felt = self._field[:, None] - np.einsum("kij,ksj->ksi", turning, slices.place + self._moved[0])
        felt -= np.einsum("kij,ksj->ksi", coriolis, self._moving[0]) + self._accelerated[0]
        total = np.einsum("s,ksi->ki", slices.mass, np.cross(self._moved[0], felt))
        turned = _skew(self._moved[1])
        gradient = turning[:, None] @ (np.eye(3) + turned) + coriolis[:, None] @ _skew(self._moving[1])
        gradient += _skew(self._accelerated[1])
        return np.asarray(
            total - np.einsum("iab,ksac,scd,ksbd->ki", SKEW, turned, slices.second, gradient, optimize=True)
        )


def _turned(rotation: Array, vectors: Array) -> Array:
    """Vectors (k, 3) turned by rotations (k, 3, 3)."""
    return np.asarray(np.einsum("kij,kj->ki", rotation, vectors))


def _skew(vectors: Array) -> Array:
    """v× of vectors (…, 3): (…, 3, 3)."""
    return np.asarray(np.einsum("iaj,...a->...ij", SKEW, vectors))
