import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PPoly

from aframe_env import InvalidValue
from agents.drives.functions import (
    Drive,
    HarmonicDrive,
    SplineDrive,
    harmonic_samples,
    spline_matrices,
    uniform_harmonic_samples,
)

knots = st.lists(st.floats(-20, 20), min_size=3, max_size=30)
harmonics = st.lists(
    st.tuples(st.floats(-5, 5), st.floats(0.01, 5), st.floats(-math.pi, math.pi)), min_size=1, max_size=6
)


@settings(deadline=None, max_examples=50)
@given(values=knots, duration=st.floats(1, 500))
def test_spline_starts_at_zero_and_goes_through_its_values(values, duration):
    drive = SplineDrive.from_variables(values, duration)
    assert isinstance(drive, Drive)
    times = np.linspace(0.0, duration, len(values) + 1)
    np.testing.assert_allclose(drive.angle(times), [0.0, *values], atol=1e-9)


@settings(deadline=None, max_examples=30)
@given(values=knots)
def test_spline_is_twice_continuously_differentiable_with_natural_ends(values):
    """Its pieces are solved here from the tridiagonal system of second derivatives at the knots."""
    n, h = len(values), 0.5
    y = np.array([0.0, *values])
    matrix = np.diag(np.full(n - 1, 4.0)) + np.diag(np.ones(n - 2), 1) + np.diag(np.ones(n - 2), -1)
    second = np.zeros(n + 1)
    second[1:-1] = np.linalg.solve(matrix, 6.0 / h**2 * np.diff(y, 2))
    pieces = np.stack(
        [np.diff(second) / (6 * h), second[:-1] / 2, np.diff(y) / h - h * (2 * second[:-1] + second[1:]) / 6, y[:-1]]
    )
    oracle = PPoly(pieces, np.arange(n + 1) * h)
    drive = SplineDrive.from_variables(values, n * h)
    times = np.linspace(0.0, n * h, 173)
    np.testing.assert_allclose(drive.angle(times), oracle(times), atol=1e-8)
    np.testing.assert_allclose(drive.speed(times), oracle(times, 1), atol=1e-7)


@settings(deadline=None, max_examples=50)
@given(terms=harmonics)
def test_harmonic_drive_starts_at_zero_and_its_speed_is_its_derivative(terms):
    drive = HarmonicDrive.from_variables(np.ravel(terms), 60.0)
    assert drive.angle(0.0) == 0.0
    times, step = np.linspace(0.01, 59.9, 57), 1e-5
    slope = (drive.angle(times + step) - drive.angle(times - step)) / (2 * step)
    np.testing.assert_allclose(drive.speed(times), slope, atol=1e-6)


def test_harmonic_drive_is_the_written_sum():
    drive = HarmonicDrive(duration=10.0, amplitudes=(2.0, 0.3), frequencies=(0.5, 2.0), phases=(0.1, -1.0))
    want = 2.0 * (math.sin(0.5 * 3.0 + 0.1) - math.sin(0.1)) + 0.3 * (math.sin(2.0 * 3.0 - 1.0) - math.sin(-1.0))
    assert float(drive.angle(3.0)) == pytest.approx(want, rel=1e-14)


@settings(deadline=None, max_examples=30)
@given(terms=harmonics, step=st.floats(0.001, 0.1))
def test_turned_samples_equal_the_sines(terms, step):
    variables = np.ravel(terms)
    angle, speed = uniform_harmonic_samples(variables, step, 2000)
    want = harmonic_samples(variables, np.arange(2000) * step)
    np.testing.assert_allclose(angle, want[0], atol=1e-9)
    np.testing.assert_allclose(speed, want[1], atol=1e-9)


def test_spline_matrices_are_the_spline():
    values, times = np.array([1.0, -2.0, 3.0, 0.5]), np.linspace(0.0, 8.0, 99)
    angle, speed = spline_matrices(8.0, 4, times)
    drive = SplineDrive.from_variables(values, 8.0)
    np.testing.assert_allclose(angle @ values, drive.angle(times), atol=1e-12)
    np.testing.assert_allclose(speed @ values, drive.speed(times), atol=1e-12)


def test_variables_survive_the_round_trip():
    spline = SplineDrive.from_variables([1.0, 2.0, 3.0], 9.0)
    assert SplineDrive.from_variables(spline.variables, 9.0) == spline
    harmonic = HarmonicDrive.from_variables([1.0, 0.5, 0.1, 0.2, 1.5, -0.3], 9.0)
    assert HarmonicDrive.from_variables(harmonic.variables, 9.0) == harmonic


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SplineDrive.from_variables([1.0, 2.0], 9.0), "at least 3 intervals"),
        (lambda: SplineDrive.from_variables([1.0, 2.0, math.nan], 9.0), r"values\[2\] = nan"),
        (lambda: SplineDrive.from_variables([1.0, 2.0, 3.0], -9.0), r"duration = -9.0 s: must be in \(0"),
        (lambda: HarmonicDrive.from_variables([1.0, 2.0], 9.0), r"must be \(3 n,\)"),
        (lambda: HarmonicDrive(duration=1.0, amplitudes=(1.0,), frequencies=(), phases=()), "one length"),
    ],
)
def test_bad_drives_are_refused(make, words):
    with pytest.raises(InvalidValue, match=words):
        make()
