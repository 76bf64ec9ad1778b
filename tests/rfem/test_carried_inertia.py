"""Inertial terms of a turning deck, against numerical differentiation of moving point masses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aframe_env.rfem.deck import deck_coordinates, deck_states
from aframe_env.rfem.servomotor_stroke import Stroke
from aframe_env.rfem.simulate import DynamicCase, simulate
from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.motion import Harmonic, HarmonicMotion
from aframe_env.scenario.recorded_motion import RecordedMotion
from aframe_env.validation import InvalidValue
from train.verify.frame_checks import model

TURNING = HarmonicMotion(
    harmonics=(
        *HarmonicMotion.paper().harmonics,
        Harmonic(coordinate="sway", amplitude=0.7, period=7.0, phase=0.4),
        Harmonic(coordinate="roll", amplitude=0.3, period=5.0, phase=0.3),
        Harmonic(coordinate="pitch", amplitude=0.2, period=4.0, phase=1.0),
        Harmonic(coordinate="yaw", amplitude=0.4, period=6.0, phase=-0.7),
    )
)


def test_deck_derivatives():
    step = 1e-4
    times = 3.3 + step * np.arange(-2, 3)
    states = deck_states(TURNING.components().at(times))
    slope = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12 * step)
    for value, rate in (("position", "velocity"), ("velocity", "acceleration")):
        assert slope @ getattr(states, value) == pytest.approx(getattr(states, rate)[2], abs=1e-9)
    assert slope @ states.angular_velocity == pytest.approx(states.angular_acceleration[2], abs=1e-9)
    spin = states.rotation[2].T @ np.einsum("k,kij->ij", slope, states.rotation)
    assert [spin[2, 1], spin[0, 2], spin[1, 0]] == pytest.approx(states.angular_velocity[2], abs=1e-9)


def test_deck_turns_by_yaw_then_pitch_then_roll():
    coordinates = TURNING.components().at([1.3, 4.0])
    expected = Rotation.from_euler("ZYX", coordinates[0][:, :2:-1]).as_matrix()
    assert deck_states(coordinates).rotation == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("recorded", [False, True])
def test_deck_follows_the_ship_with_its_ramp(recorded):
    # Ramp and motion as a polynomial and a sine, multiplied out by differentiating their product.
    step, ramp = 0.01, 4.0
    times = step * np.arange(601)
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="pitch", amplitude=0.2, period=3.0, phase=0.4),))
    if recorded:
        samples = 0.1 * np.arange(61)
        motion = RecordedMotion(times=samples, coordinates=motion.components().at(samples)[0])
    s = np.minimum(times / ramp, 1.0)
    rate = 2.0 * np.pi / 3.0
    built, part = s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 0.2 * np.sin(rate * times + 0.4)
    place, speed, acceleration = deck_coordinates(Scenario(motion=motion, ramp=ramp), step, times.size)
    assert place[:, 4] == pytest.approx(built * part, abs=1e-6)
    assert np.gradient(place[:, 4], step)[1:-1] == pytest.approx(speed[1:-1, 4], abs=5e-5)
    assert np.gradient(speed[:, 4], step)[1:-1] == pytest.approx(acceleration[1:-1, 4], abs=5e-4)
    assert not np.delete(place, 4, axis=1).any()


def test_record_that_is_too_short_is_named():
    times = 0.1 * np.arange(61)
    motion = RecordedMotion(times=times, coordinates=np.zeros((61, 6)))
    with pytest.raises(InvalidValue, match=r"duration = 7 s: must be in \(0, 6\] s"):
        simulate(DynamicCase(scenario=Scenario(motion=motion), duration=7.0))


def test_inertial_terms_equal_those_of_point_masses():
    frame = model(3, 2, corrected_shear=False)
    size = frame.structure.size
    random = np.random.default_rng(3)
    shape, rate = 0.05 * random.normal(size=size), random.uniform(1.0, 3.0, size)

    def coordinates(time):
        return shape * np.sin(rate * time)

    step, now = 2e-3, 2.1
    offsets = np.arange(-2, 3)
    states = deck_states(TURNING.components().at(now + step * offsets))
    second = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12 * step**2)
    expected = np.zeros(size)
    for index, body in enumerate(frame.structure.bodies):
        spread = np.sqrt(3.0 * (0.5 * body.inertia.sum() - body.inertia) / body.mass)
        for axis in range(3):
            for sign in (-1.0, 1.0):
                place = body.centre + sign * spread[axis] * body.axes[:, axis]
                own = body.displacement(place)
                track = [
                    states.position[k]
                    + states.rotation[k]
                    @ frame.to_deck
                    @ (place + own @ coordinates(now + step * offsets[k])[6 * index : 6 * index + 6])
                    for k in range(5)
                ]
                acceleration = frame.to_deck.T @ states.rotation[2].T @ (second @ np.array(track))
                expected[6 * index : 6 * index + 6] += body.mass / 6 * acceleration @ own

    position = coordinates(now)
    velocity, bending = shape * rate * np.cos(rate * now), -(rate**2) * position
    turn = states.rotation[2] @ frame.to_deck
    spin, spin_up = (getattr(states, name)[2] @ frame.to_deck for name in ("angular_velocity", "angular_acceleration"))

    def skew(vector):
        return np.cross(np.eye(3), vector)

    turning = skew(spin_up) + skew(spin) @ skew(spin)
    slices = frame.slices
    here = (
        frame.mass @ bending
        + slices.uniform() @ (turn.T @ states.acceleration[2])
        + slices.of_field(turning)
        + slices.of_motion(turning, position)
        + slices.of_motion(2.0 * skew(spin), velocity)
    )
    assert here == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("strokes", [None, (Stroke.smooth(0.01, 0.2), Stroke.smooth(0.007, 0.15))])
def test_reactions_on_a_turning_deck_carry_the_frame(strokes):
    # Feet, servomotors and rope together give the frame's change of momentum and its weight.
    scenario = Scenario.paper(motion=TURNING, load_mass=1e3)
    # A step that resolves all modes of so coarse a frame.
    step = 5e-5
    case = DynamicCase(scenario=scenario, strokes=strokes, duration=0.15, step=step, output_interval=step)
    frame = model(5, 2)
    result = simulate(case, model=frame)
    history, deck, slices = result.frame, result.deck, frame.slices
    momentum = np.zeros((result.time.size, 3))
    for index, mass in enumerate(slices.mass):
        rows = slice(3 * index, 3 * index + 3)
        shift, rate = (
            frame.to_deck @ (slices.displacement[rows] @ motion.T) for motion in (history.position, history.velocity)
        )
        arm = (frame.to_deck @ slices.place[index])[:, None] + shift
        speed = np.cross(deck.angular_velocity, arm.T) + rate.T
        momentum += mass * (deck.velocity + np.einsum("kij,kj->ki", deck.rotation, speed))
    # Between two ends of a step the forces are as good as straight lines.
    change = np.diff(momentum, axis=0) / step + [0.0, 0.0, 20684.75 * 9.81]
    held = history.feet().sum(axis=1)
    for side, tension in zip(("R", "L"), history.servomotors().T, strict=True):
        index, _ = frame.structure.points[f"N_{side}"]
        row = frame.servomotors["RL".index(side), 6 * index : 6 * index + 3]
        held += np.outer(tension, frame.to_deck @ frame.structure.bodies[index].axes @ row)
    pulley = np.array(Crane().pulley_position) + history.displacement("S")
    for towards in (
        np.array(Crane().drum_position) - pulley,
        np.einsum("kji,kj->ki", deck.rotation, result.load - deck.position) - pulley,
    ):
        held += result.tension[:, None] * towards / np.linalg.norm(towards, axis=1)[:, None]
    base = np.einsum("kij,kj->ki", deck.rotation, held)
    gap = np.abs(0.5 * (base[1:] + base[:-1]) - change)
    assert gap.max() < 2.5e-4 * np.abs(change).max()
