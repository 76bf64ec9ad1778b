"""The rope's law."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env.dynamics.load import tension


@settings(max_examples=100, deadline=None)
@given(
    st.floats(-10.0, 10.0),
    st.floats(-5.0, 5.0),
    st.floats(1.0, 3000.0),
    st.floats(1e6, 1e9),
    st.floats(0.0, 1e6),
)
def test_a_rope_pulls_and_never_pushes(
    elongation: float, rate: float, length: float, stiffness: float, damping: float
) -> None:
    force = tension(elongation, rate, stiffness / length, damping)
    linear = stiffness * elongation / length + damping * rate
    assert force >= 0.0
    if linear > 0:
        assert abs(force - linear) <= 1e-9 * (abs(stiffness * elongation / length) + abs(damping * rate))
    else:
        assert force <= 1e-9 * (abs(stiffness * elongation / length) + abs(damping * rate))


def test_slack_and_shortening() -> None:
    assert tension(-1e-6, 0.0, 2e8 / 300.0, 1e4) == 0.0
    assert tension(0.1, -100.0, 2e8 / 300.0, 1e4) == 0.0
    assert tension(1.5, 0.0, 2e8 / 300.0, 0.0) == 1e6
