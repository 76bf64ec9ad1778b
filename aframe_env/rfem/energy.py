"""Energy balance of a run: work of deck and drum, energy of frame, rope and load, and dissipation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from aframe_env.rfem.beam import Array
from aframe_env.rfem.constraints import servomotor_direction
from aframe_env.rfem.simulate import DrivenDrum, DynamicResult
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

    The deck's work is that of the reactions, so this checks them too. On a deck that turns the frame's
    displacements turn with it, and the balance holds to first order in them only, like eq. (10).

    Raises:
        InvalidValue: The output interval is longer than the step.
    """
    case, history = result.case, result.frame
    scenario, crane = case.scenario, case.scenario.crane
    if case.output_interval > case.step * (1.0 + 1e-9):
        raise InvalidValue(
            f"output_interval = {case.output_interval} s: must be the step, {case.step} s, for a balance"
        )
    model, deck = history.model, result.deck
    to_frame = deck.rotation @ model.to_deck
    spin = deck.angular_velocity @ model.to_deck
    carried = np.einsum("kij,ki->kj", to_frame, deck.velocity)

    kinetic = 0.5 * scenario.load_mass * np.sum(result.load_velocity**2, axis=1)
    potential = scenario.weight * result.load[:, 2]
    for index, body in enumerate(model.structure.bodies):
        own = slice(6 * index, 6 * index + 6)
        shift = history.position[:, own][:, :3] @ body.axes.T
        rates = history.velocity[:, own]
        arm = body.centre + shift
        speed = carried + np.cross(spin, arm) + rates[:, :3] @ body.axes.T
        turning = spin @ body.axes + rates[:, 3:]
        kinetic += 0.5 * body.mass * np.sum(speed**2, axis=1) + 0.5 * turning**2 @ body.inertia
        place = deck.position[:, 2] + np.einsum("kj,kj->k", to_frame[:, 2], arm)
        potential += body.mass * scenario.gravity * place
    strain = 0.5 * np.einsum("ki,ki->k", history.position @ model.stiffness, history.position)
    length = scenario.free_length + crane.winch.drum_radius * result.drum_angle
    strain += 0.5 * result.elastic_tension**2 * length / crane.rope.axial_stiffness
    loss = np.einsum("ki,ki->k", history.velocity @ model.damping, history.velocity)

    # The rope between S and H, and its pull on load and drum.
    origin, turn = deck.position, deck.rotation
    drum_place = np.array(crane.drum_position)
    pulley_place = np.array(crane.pulley_position) + history.displacement("S")
    pulley_rate = history.velocity @ (model.to_deck @ model.pulley).T
    to_drum = drum_place - pulley_place
    to_drum /= np.linalg.norm(to_drum, axis=1)[:, None]
    pulley = origin + np.einsum("kij,kj->ki", turn, pulley_place)
    to_load = result.load - pulley
    to_load /= np.linalg.norm(to_load, axis=1)[:, None]
    deck_speed = np.einsum("kij,ki->kj", turn, deck.velocity)

    def speed_of(place: Array) -> Array:
        return np.asarray(deck_speed + np.cross(deck.angular_velocity, place))

    pulley_speed = speed_of(pulley_place) + pulley_rate
    rate = np.einsum("ki,ki->k", to_drum, speed_of(drum_place) - pulley_speed)
    rate += np.einsum("ki,ki->k", to_load, result.load_velocity)
    rate -= np.einsum("kij,ki,kj->k", turn, to_load, pulley_speed)
    rate -= crane.winch.drum_radius * result.drum_rate
    loss += (result.tension - result.elastic_tension) * rate

    power = result.tension * np.einsum("ki,ki->k", to_drum, speed_of(drum_place))
    feet = history.feet()
    frame, servomotors = model.frame, history.servomotors()
    for column, (side, sign) in enumerate((("R", -1.0), ("L", 1.0))):
        foot = np.array([0.0, sign * frame.half_width, 0.0])
        power += np.einsum("ki,ki->k", feet[:, column], speed_of(foot))
        end = np.array([frame.servomotor_deck_x, sign * frame.half_width, 0.0])
        along = model.to_deck @ servomotor_direction(frame, side)
        power -= servomotors[:, column] * (speed_of(end) @ along)
    if history.stroke is not None:
        power -= np.sum(servomotors * history.stroke[1], axis=1)
    drum = case.drum
    pull = result.tension + 0.5 * result.elastic_tension**2 / crane.rope.axial_stiffness
    if isinstance(drum, DrivenDrum):
        kinetic += 0.5 * drum.inertia * result.drum_rate**2
        moments = [
            drum.torque(float(t), float(a), float(w))
            for t, a, w in zip(result.time, result.drum_angle, result.drum_rate, strict=True)
        ]
        power += np.array(moments) * result.drum_rate
    else:
        power -= pull * crane.winch.drum_radius * result.drum_rate
    stored = kinetic + potential + strain
    return EnergyBalance(
        stored=stored - stored[0],
        input=cumulative_trapezoid(power, result.time, initial=0),
        dissipated=cumulative_trapezoid(loss, result.time, initial=0),
    )
