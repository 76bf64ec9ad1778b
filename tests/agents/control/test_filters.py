import numpy as np
import pytest

from agents.control.filters import FadingPolynomial

ALL = slice(None)


def test_a_fading_polynomial_is_the_weighted_least_squares_parabola():
    rng = np.random.default_rng(3)
    signal = np.cumsum(rng.normal(size=400))
    memory, period = 0.7, 0.2
    polynomial = FadingPolynomial(1, memory, period)
    polynomial.start(signal[:1], ALL)
    for value in signal[1:]:
        polynomial.advance(np.array([value]))
    ages = -period * np.arange(len(signal))[::-1]
    weights = memory ** (np.arange(len(signal))[::-1] / 2)  # polyfit squares them
    quadratic, rate, value = np.polyfit(ages[-100:], signal[-100:], 2, w=weights[-100:])
    assert polynomial.value(ALL)[0] == pytest.approx(value, rel=1e-6)
    assert polynomial.rate(ALL)[0] == pytest.approx(rate, rel=1e-6)
    assert polynomial.second_derivative(ALL)[0] == pytest.approx(2.0 * quadratic, rel=1e-6)
