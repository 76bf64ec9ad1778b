"""Remarks on an episode that went badly, each with its figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import detrend, periodogram

from agents.policy import FloatArray
from agents.rollout import Episodes
from train.evaluate.episode_table import Traits
from train.evaluate.run import Comparison

TAIL: Final = 0.05
"""Share of the scenarios at either end that counts as the roughest, the calmest, the shortest."""
AT_LIMIT: Final = 0.01
"""Share of the time at a limit of the winch from which on it is worth a word."""
NEAR: Final = 0.15
"""Relative distance within which two periods are taken as the same."""
START: Final = 10.0
"""s that count as the start."""
FEWEST_SAMPLES: Final = 200
"""Fewest samples of an error worth a remark: after a rope that parts early there are not so many."""


@dataclass(frozen=True)
class Field:
    """The scenarios that an episode is seen against."""

    still_rms: FloatArray
    """(N,) m."""
    traits: tuple[Traits, ...]

    @classmethod
    def of(cls, comparison: Comparison) -> Field:
        """The scenarios of a comparison."""
        return cls(comparison.still.rms, tuple(Traits.of(s) for s in comparison.scenarios))


def intact(episodes: Episodes, index: int) -> int:
    """Count an episode's control steps until the rope parts, or all."""
    tension = episodes.tension[index]
    return 1 + int(np.flatnonzero(tension)[-1]) if episodes.parted[index] and tension.any() else len(tension)


def remarks(comparison: Comparison, field: Field, episodes: Episodes, index: int) -> list[str]:
    """Collect the remarks on one episode, the gravest first; never empty."""
    found = [
        *_rope(episodes, index),
        *_winch(comparison, episodes, index),
        *_scenario(field, index),
        *_residual(episodes, field.traits[index], index),
    ]
    return found or ["Nothing out of the ordinary."]


def _percent(share: float) -> str:
    return f"{100 * share:.0f}\u00a0%"


def _rope(episodes: Episodes, index: int) -> list[str]:
    found = []
    if episodes.parted[index]:
        time = episodes.control_period * intact(episodes, index)
        found.append(f"The rope parted at {time:.1f} s and the load was lost; Ω1 and Ω2 have its free fall in them.")
    events = int(episodes.slack_events[index])
    if events:
        found.append(f"The rope went slack {events} time{'s' if events > 1 else ''}.")
    return found


def _winch(comparison: Comparison, episodes: Episodes, index: int) -> list[str]:
    winch = comparison.scenarios[index].crane.winch
    speed = episodes.drum_speed[index, : intact(episodes, index)].astype(np.float64)
    at_speed = float(np.mean(abs(speed) > 0.999 * winch.max_speed))
    at_acceleration = float(np.mean(abs(np.diff(speed)) > 0.999 * winch.max_acceleration * episodes.control_period))
    found = []
    if at_speed > AT_LIMIT:
        found.append(
            f"The drum was at its speed limit ({winch.max_rope_speed:g} m/s) for {_percent(at_speed)} of the time."
        )
    if at_acceleration > AT_LIMIT:
        limit = f"{winch.max_rope_acceleration:g} m/s²"
        found.append(f"The drum was at its acceleration limit ({limit}) for {_percent(at_acceleration)} of the time.")
    return found


def _scenario(field: Field, index: int) -> list[str]:
    still, traits = field.still_rms, field.traits[index]
    lengths = np.array([t.rope_length for t in field.traits])
    masses = np.array([t.load_mass for t in field.traits])
    found = []
    if still[index] >= np.quantile(still, 1.0 - TAIL):
        found.append(f"One of the {_percent(TAIL)} largest motions: {still[index]:.2f} m RMS with the drum still.")
    if still[index] <= np.quantile(still, TAIL):
        found.append(
            f"One of the {_percent(TAIL)} smallest motions: {100 * still[index]:.1f} cm RMS with the drum still."
        )
    if lengths[index] <= np.quantile(lengths, TAIL):
        found.append(f"One of the {_percent(TAIL)} shortest ropes: {traits.rope_length:.0f} m.")
    if masses[index] <= np.quantile(masses, TAIL):
        found.append(f"One of the {_percent(TAIL)} lightest loads: {traits.load_mass / 1e3:.0f} t.")
    return found


def _residual(episodes: Episodes, traits: Traits, index: int) -> list[str]:
    error: FloatArray = episodes.error[index, : intact(episodes, index)].astype(np.float64)
    square = error**2
    total = float(square.sum())
    if total == 0.0 or len(error) < FEWEST_SAMPLES:
        return []
    found = []
    mean = float(error.mean())
    if mean**2 > 0.5 * total / len(error):
        standing = f"{100 * mean:+.1f}".replace("-", "−")
        found.append(f"Most of the error is a standing one, {standing} cm in the mean.")
    early = float(square[: round(START / episodes.control_period)].sum()) / total
    if early > 0.5:
        found.append(f"{_percent(early)} of Ω1 comes from the first {START:g} s: the start.")
    frequency, density = periodogram(detrend(error), fs=1.0 / episodes.control_period, window="hann")
    peak = 1.0 / float(frequency[1 + np.argmax(density[1:])])
    if abs(peak - traits.rope_period) < NEAR * traits.rope_period:
        found.append(
            f"What is left swings at {peak:.1f} s, the load's own period on its rope ({traits.rope_period:.1f} s): "
            "resonance."
        )
    return found
