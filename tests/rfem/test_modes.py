import numpy as np
import pytest

from aframe_env.rfem.modes import frame_modes
from aframe_env.scenario.crane import Crane
from aframe_env.validation import InvalidValue
from train.verify.frame_checks import model, natural_modes


def test_first_ten_frequencies():
    for check in natural_modes():
        assert check.passed, check.measured


def test_prototype_convergence():
    # Worst of the first ten frequencies, and the highest frequency of all, as another implementation has
    # them.
    frame = model(10, 8, corrected_shear=False)
    modes = frame_modes(Crane(), 166, model=frame)
    assert modes.frequency[-1] == pytest.approx(1337.0, abs=0.5)


def test_shapes_are_orthonormal_and_held():
    frame = model(10, 8)
    modes = frame_modes(Crane(), 12, model=frame)
    gram = modes.shape.T @ (frame.mass @ modes.shape)
    assert np.abs(gram - np.eye(12)).max() < 1e-9
    stiffness = modes.shape.T @ frame.stiffness @ modes.shape
    assert np.diag(stiffness) == pytest.approx((2 * np.pi * modes.frequency) ** 2, rel=1e-8)
    assert np.abs(frame.constraints.matrix @ modes.shape).max() < 1e-12


def test_count_is_checked():
    with pytest.raises(InvalidValue, match="count"):
        frame_modes(Crane(), 0)
