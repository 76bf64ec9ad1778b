"""The longest wave of a response table: there every ship does the same, whatever its hull, and units and signs show.

A ship goes with the particles and the slope of a wave that is long against it: surge -i cos β, sway -i sin β, heave 1,
roll -i k sin β, pitch i k cos β in ``Vessel``'s conventions, k = ω²/g. A table that says otherwise was written in other
units or with other signs. In shallow water surge, sway, roll and pitch are more by one factor, the reciprocal of
tanh(k × depth), which is allowed for.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.scenario.crane import GRAVITY

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

LONGEST: Final = 0.4
"""rad/s: a table that begins above (waves of 385 m and less) is not judged."""
UNIFORM: Final = 1.15
"""Greatest heave over least, among the headings: with more the wave is not long for the ship."""
STEEP: Final = -1.5
"""Slope of log amplitude over log frequency below which a motion is above its resonance, and no longer follows."""
COHERENT: Final = 0.6
"""Correlation with the limit over the headings, at the least."""
HEAVE_RANGE: Final = (0.6, 1.7)
DRIFT_RANGE: Final = (0.4, 40.0)
"""Of surge and sway: 40 is 10 m of water in waves of 0.025 rad/s."""
ANGLE_RANGE: Final = (0.25, 8.0)
"""Of roll and pitch, in units of surge and sway: their resonances are near."""

_SIGNS: Final = {
    "z points down (must be up)": (1, 1, -1, 1, 1),
    "headings count towards starboard (must be towards port)": (1, -1, 1, -1, 1),
    "y points to starboard and z down (must be to port and up)": (1, -1, -1, 1, -1),
    "phases go by the trough (must be by the crest)": (-1, -1, -1, -1, -1),
    "pitch is positive with the bow up (must be with the bow down)": (1, 1, 1, 1, -1),
    "roll is positive with starboard up (must be with port up)": (1, 1, 1, -1, 1),
    "sway is positive to starboard (must be to port)": (1, -1, 1, 1, 1),
    "surge is positive aft (must be forward)": (-1, 1, 1, 1, 1),
}
_REVERSED: Final = (-1, -1, 1, -1, -1)
"""Lags for leads, coming from for going to, or half a turn of the axes: the limit is the same for all three."""
_LAGS: Final = "phases are lags behind the wave (must be leads)"
_FROM: Final = (
    "headings say where the waves come from (must be where they travel to), or x points aft and y to starboard (must "
    "be forward and to port)"
)
_LENGTHS: Final = {
    0.5: "amplitudes are by wave height (must be by wave amplitude)",
    2.0: "amplitudes are from crest to trough (must be from the mean)",
    1.0 / 0.3048: "lengths are in ft (must be in m)",
    100.0: "lengths are in cm (must be in m)",
    1000.0: "lengths are in mm (must be in m)",
}


@dataclass(frozen=True, kw_only=True)
class _Motion:
    """One column of a table beside the long-wave limit."""

    name: str
    factor: complex
    """What the limit is to be multiplied by, for the best fit over the headings."""
    coherence: float
    """Correlation with the limit over the headings, from 0 to 1."""
    follows: bool
    """False for a column of zeros, and for a motion at or above a resonance of its own."""
    usual: tuple[float, float]
    """Range of the factor's modulus that a ship may have."""

    @property
    def aligned(self) -> bool:
        """Whether the factor is nearly real, of either sign."""
        return abs(self.factor.real) > 0.5 * abs(self.factor)

    @property
    def departure(self) -> str:
        """Words for what is wrong; none where nothing is."""
        if self.coherence < COHERENT:
            return f"{self.name} does not go with the heading as it should"
        size, angle = abs(self.factor), math.degrees(cmath.phase(self.factor))
        wrong = []
        if not self.usual[0] <= size <= self.usual[1]:
            wrong.append(f"{size:.3g} times what it should be")
        if abs(angle) > 60.0:
            wrong.append(f"turned by {180.0 if self.aligned else angle:.0f}°")
        return f"{self.name} is {' and '.join(wrong)}" if wrong else ""


def long_wave_remark(frequencies: FloatArray, headings: FloatArray, amplitudes: FloatArray, phases: FloatArray) -> str:
    """Say how a table departs from the limit at its longest wave, and why, most likely; nothing where it does not.

    ``frequencies`` (F,) rad/s, rising; ``headings`` (D,) rad; ``amplitudes`` and ``phases`` (F, D, 6) as they stand in
    the table. A table whose longest wave is not long, and motions that have a resonance there, are not judged.
    """
    heave = amplitudes[0, :, 2]
    if frequencies[0] > LONGEST or heave.max() > UNIFORM * heave.min():
        return ""
    causes = []
    factors, coherence = _fits(frequencies, headings, amplitudes, phases)
    motions = _motions(frequencies, factors, coherence)
    departures = [motion.departure for motion in motions if motion.follows and motion.departure]
    if np.abs(phases).max() > 2.0 * math.pi:
        others = _fits(frequencies, headings, amplitudes, np.radians(phases))
        if _alignment(*others) > _alignment(factors, coherence):
            factors, coherence = others
            motions = _motions(frequencies, factors, coherence)
            causes.append("phases are in degrees (must be in rad)")
            departures = departures or ["phases do not go with the wave as they should"]
    if not departures:
        return ""
    turned, motions = _upright(motions)
    causes += turned + _unit_causes(motions, frequencies[0]) + _sign_causes(motions, factors[:, 3])
    likely = f"; likely {', and '.join(causes)}" if causes else ""
    return f"{', '.join(departures)}{likely}"


def _fits(
    frequencies: FloatArray, headings: FloatArray, amplitudes: FloatArray, phases: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """What the limit is to be multiplied by (F, 5) to fit the table (F, D, 6), and how well it fits (F, 5)."""
    k = frequencies[:, None] ** 2 / GRAVITY
    c, s = np.cos(headings), np.sin(headings)
    limit = np.stack(np.broadcast_arrays(-1j * c, -1j * s, 1.0 + 0.0 * k * c, -1j * k * s, 1j * k * c), axis=2)
    response: ComplexArray = (amplitudes * np.exp(1j * phases))[..., :5]
    product = np.sum(np.conj(limit) * response, axis=1)
    power, own = np.sum(np.abs(limit) ** 2, axis=1), np.sum(np.abs(response) ** 2, axis=1)
    return product / power, np.abs(product) / np.sqrt(power * np.maximum(own, 1e-300))


def _alignment(factors: ComplexArray, coherence: FloatArray) -> float:
    """Share of the motions in the longest wave that is in phase with the limit, or against it."""
    size = np.maximum(np.abs(factors[0]), 1e-300)
    return float(np.mean(np.abs(factors[0].real) / size * coherence[0]))


def _motions(frequencies: FloatArray, factors: ComplexArray, coherence: FloatArray) -> list[_Motion]:
    """The five motions in the longest wave."""
    # Of the motion, whether or not it goes with the limit.
    size = np.abs(factors[:2]) / np.maximum(coherence[:2], 1e-12)
    present = size.min(axis=0) > 1e-3
    slope = np.log(np.where(present, size[1] / np.maximum(size[0], 1e-300), 1.0)) / np.log(
        frequencies[1] / frequencies[0]
    )
    shallow = size[0, :2].max()
    shallow = shallow if 1.0 <= shallow <= DRIFT_RANGE[1] else 1.0
    angles = ANGLE_RANGE[0] * shallow, ANGLE_RANGE[1] * shallow
    usual = (DRIFT_RANGE, DRIFT_RANGE, HEAVE_RANGE, angles, angles)
    factor = factors[0]
    aligned = np.abs(factor.real) > 0.5 * np.abs(factor)
    follows = present & ((slope > STEEP) | (size[0] > DRIFT_RANGE[1]))
    # A turned phase, or a roll that is great and against the pitch, is a resonance.
    follows[3:] &= aligned[3:] | ~aligned[2]
    follows[3] &= size[0, 3] < 2.0 * size[0, 4] or factor[3].real * factor[4].real > 0.0
    motions = []
    for i, name in enumerate(("surge", "sway", "heave", "roll", "pitch")):
        motion = _Motion(
            name=name,
            factor=complex(factor[i]),
            coherence=float(coherence[0, i]),
            follows=bool(follows[i]),
            usual=usual[i],
        )
        motions.append(motion)
    return motions


def _upright(motions: list[_Motion]) -> tuple[list[str], list[_Motion]]:
    """Cause and motions without it, where all are turned by a quarter."""
    following = [motion for motion in motions if motion.follows]
    if not following or any(motion.aligned for motion in following):
        return [], motions
    heave = motions[2].factor
    quarter = 1j if heave.imag > 0.0 else -1j
    cause = "phases go by the wave's zero crossing (must be by its crest)"
    return [cause], [replace(motion, factor=motion.factor / quarter) for motion in motions]


def _unit_causes(motions: list[_Motion], frequency: float) -> list[str]:
    causes = []
    heave = motions[2]
    length = abs(heave.factor) if not HEAVE_RANGE[0] <= abs(heave.factor) <= HEAVE_RANGE[1] else 1.0
    causes += [words for factor, words in _LENGTHS.items() if factor / 1.15 < length < factor * 1.15]
    angles = [abs(m.factor) for m in motions[3:] if m.follows and not m.usual[0] <= abs(m.factor) <= m.usual[1]]
    if angles:
        slope = GRAVITY / frequency**2
        known = {
            180.0 / math.pi: "roll, pitch and yaw are in deg/m (must be in rad/m)",
            slope: "roll, pitch and yaw are by the wave's slope (must be by its amplitude, rad/m)",
            slope * 180.0 / math.pi: "roll, pitch and yaw are in deg by the wave's slope (must be in rad/m)",
            math.pi / 180.0: "roll, pitch and yaw were turned to radians twice",
        }
        factor = min(known, key=lambda each: abs(math.log(min(angles) / each)))
        if abs(math.log(min(angles) / factor)) < math.log(3.0):
            causes.append(known[factor])
    return causes


def _sign_causes(motions: list[_Motion], roll: ComplexArray) -> list[str]:
    """Conventions that have the signs of the motions; the fewest."""
    known = {_reversal(roll): _REVERSED, **_SIGNS}
    for count in (1, 2, 3):
        for names in combinations(known, count):
            signs = np.prod([known[name] for name in names], axis=0)
            pairs = [(m.factor.real, sign) for m, sign in zip(motions, signs, strict=True) if m.follows and m.aligned]
            if all(value > 0.0 for value, _ in pairs):
                return []
            if all(value * sign > 0.0 for value, sign in pairs):
                return list(names)
    return []


def _reversal(roll: ComplexArray) -> str:
    """What has reversed the motions: at resonance the roll (F,) falls behind the wave, and a lag that is read as a lead
    goes ahead."""
    peak = roll[np.argmax(np.abs(roll))] / roll[0] if abs(roll[0]) > 0.0 else 1.0
    if peak.imag > 0.3 * abs(peak):
        return _LAGS
    return _FROM if peak.imag < -0.3 * abs(peak) else f"{_LAGS}, or {_FROM}"
