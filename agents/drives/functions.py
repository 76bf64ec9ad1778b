"""Open-loop drives: the drum angle as a function of time, φ_H(t).

The paper's spline (33) is φ_H = a_i t³ + b_i t² + c_i t + d_i on each interval, with the decision variables (35)
X = [φ_H⁰, φ_H¹, …, φ_H^m], its values at the knots. Its pseudo-harmonic function (34) is
φ_H = A_0 + Σ_i A_i sin(ω_i t + α_i,0), with (36) X = [A_0, A_1, ω_1, α_1,0, …, A_n, ω_n, α_n,0].

There φ_H⁰ and A_0 are variables. A drum that starts elsewhere than at 0 has moved the load before the start, which no
episode of the environment knows, for there the load begins at its level. So the drives here start at φ_H(0) = 0 and
have one variable less, unless they are given that variable: both kinds are offered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from aframe_env.dynamics.compiling import kernel
from aframe_env.dynamics.motion import smooth_ramp
from aframe_env.validation import InvalidValue, require_number

FloatArray = npt.NDArray[np.float64]


@runtime_checkable
class Drive(Protocol):
    """A prescribed drum angle. Positive angles pay out rope."""

    @property
    def duration(self) -> float:
        """Duration t_k that the drive was made for, s."""
        ...

    def angle(self, time: npt.ArrayLike) -> FloatArray:
        """φ_H, rad, at ``time`` s (any shape, in [0, duration])."""
        ...

    def speed(self, time: npt.ArrayLike) -> FloatArray:
        """dφ_H/dt, rad/s."""
        ...

    @property
    def variables(self) -> FloatArray:
        """Vector of decision variables."""
        ...


def _finite(name: str, values: tuple[float, ...]) -> None:
    for i, value in enumerate(values):
        require_number(f"{name}[{i}]", value, "")


@dataclass(frozen=True, kw_only=True)
class SplineDrive:
    """Cubic spline on n equal intervals of [0, t_k], eq. (33); decision variables (35), or those without φ_H⁰.

    It is twice continuously differentiable through its values at the knots t_0 = 0, t_1 .. t_n. Its ends are
    natural (no second derivative at 0 and t_k), which is our choice: the least curved of all interpolants, and the one
    whose speed at t = 0 is free to meet that of a deck already under way.
    """

    duration: float
    """t_k, s."""
    values: tuple[float, ...]
    """φ_H at t_1 .. t_n, rad."""
    first: float | None = None
    """φ_H⁰, φ_H at t_0, rad, where it is a decision variable; None: it is 0, and none."""

    def __post_init__(self) -> None:
        require_number("duration", self.duration, "s", low=0.0, low_open=True)
        if len(self.values) < 3:
            raise InvalidValue(f"values: {len(self.values)} knots: a spline drive needs at least 3 intervals")
        _finite("values", self.values)
        require_number("first", self.first or 0.0, "rad")

    @classmethod
    def from_variables(cls, variables: npt.ArrayLike, duration: float, free_start: bool = False) -> SplineDrive:
        """Drive with the decision variables (n,) rad over ``duration`` s; (n + 1,) with a ``free_start``."""
        values = np.asarray(variables, dtype=np.float64).tolist()
        first = values.pop(0) if free_start and values else None
        return cls(duration=duration, values=tuple(values), first=first)

    @property
    def variables(self) -> FloatArray:
        """Values at the knots t_1 .. t_n, rad: (n,); with the one at t_0 in front of them where it is free."""
        return np.array(self.values if self.first is None else (self.first, *self.values))

    @property
    def intervals(self) -> int:
        """n."""
        return len(self.values)

    @cached_property
    def _spline(self) -> CubicSpline[np.float64]:
        knots = np.linspace(0.0, self.duration, self.intervals + 1)
        return CubicSpline(knots, [self.first or 0.0, *self.values], bc_type="natural")

    def angle(self, time: npt.ArrayLike) -> FloatArray:
        """φ_H, rad, at ``time`` s."""
        return np.asarray(self._spline(np.asarray(time, dtype=np.float64)))

    def speed(self, time: npt.ArrayLike) -> FloatArray:
        """dφ_H/dt, rad/s."""
        return np.asarray(self._spline(np.asarray(time, dtype=np.float64), 1))


def spline_matrices(
    duration: float, intervals: int, times: FloatArray, free_start: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Matrices (T, n) that turn the variables of a ``SplineDrive`` into its angle and speed at ``times``.

    (T, n + 1) with a ``free_start``.
    """
    knots = np.linspace(0.0, duration, intervals + 1)
    spline = CubicSpline(knots, np.eye(intervals + 1)[:, 0 if free_start else 1 :], bc_type="natural")
    return np.ascontiguousarray(spline(times)), np.ascontiguousarray(spline(times, 1))


@dataclass(frozen=True, kw_only=True)
class HarmonicDrive:
    """Pseudo-harmonic drive, eq. (34); decision variables (36), or those without A_0.

    φ_H(t) = A_0 + Σ_i a_i sin(ω_i t + α_i), i = 1 .. n: harmonics of free amplitude, frequency and phase.
    """

    duration: float
    """t_k, s."""
    amplitudes: tuple[float, ...]
    """a_i, rad."""
    frequencies: tuple[float, ...]
    """ω_i, rad/s."""
    phases: tuple[float, ...]
    """α_i, rad."""
    constant: float | None = None
    """A_0, rad, where it is a decision variable; None: it is -Σ_i a_i sin α_i, which makes φ_H(0) = 0, and none."""

    def __post_init__(self) -> None:
        require_number("duration", self.duration, "s", low=0.0, low_open=True)
        require_number("constant", self.constant or 0.0, "rad")
        if not len(self.amplitudes) == len(self.frequencies) == len(self.phases) > 0:
            raise InvalidValue("amplitudes, frequencies, phases: must be of one length, at least 1")
        for name in ("amplitudes", "frequencies", "phases"):
            _finite(name, getattr(self, name))

    @classmethod
    def from_variables(cls, variables: npt.ArrayLike, duration: float, free_start: bool = False) -> HarmonicDrive:
        """Drive with the decision variables (a_1, ω_1, α_1, a_2, ...) over ``duration`` s.

        With a ``free_start`` A_0 stands in front of them.
        """
        v = np.asarray(variables, dtype=np.float64)
        if v.ndim != 1 or len(v) % 3 != int(free_start) or len(v) < 3:
            raise InvalidValue(f"variables: shape {v.shape}: must be ({'3 n + 1' if free_start else '3 n'},)")
        a, w, p = (tuple(part.tolist()) for part in v[int(free_start) :].reshape(-1, 3).T)
        constant = float(v[0]) if free_start else None
        return cls(duration=duration, amplitudes=a, frequencies=w, phases=p, constant=constant)

    @property
    def variables(self) -> FloatArray:
        """(a_1, ω_1, α_1, a_2, ω_2, α_2, ...): (3 n,) rad, rad/s, rad; with A_0 in front of them where it is free."""
        return self._harmonics if self.constant is None else np.array([self.constant, *self._harmonics])

    def angle(self, time: npt.ArrayLike) -> FloatArray:
        """φ_H, rad, at ``time`` s."""
        angle = harmonic_samples(self._harmonics, np.asarray(time, dtype=np.float64))[0]
        return angle if self.constant is None else angle + self.constant + start_of_harmonics(self._harmonics)

    def speed(self, time: npt.ArrayLike) -> FloatArray:
        """dφ_H/dt, rad/s."""
        return harmonic_samples(self._harmonics, np.asarray(time, dtype=np.float64))[1]

    @property
    def _harmonics(self) -> FloatArray:
        return np.stack([self.amplitudes, self.frequencies, self.phases], axis=1).ravel()


@dataclass(frozen=True, kw_only=True)
class RampedDrive:
    """A sum of harmonics that builds up with the ship's motion: φ_H(t) = f(t) s(t) - f(0) s(0).

    s(t) = Σ_i a_i sin(ω_i t + α_i); f is the quintic smoothstep from 0 to 1 over ``ramp`` s, or 1 where that is 0.
    """

    duration: float
    """t_k, s."""
    variables: FloatArray
    """(a_1, ω_1, α_1, a_2, ...): (3 n,) rad, rad/s, rad."""
    ramp: float = 0.0
    """s."""

    def __post_init__(self) -> None:
        require_number("duration", self.duration, "s", low=0.0, low_open=True)
        require_number("ramp", self.ramp, "s", low=0.0)
        if self.variables.ndim != 1 or len(self.variables) % 3 or not np.isfinite(self.variables).all():
            raise InvalidValue(f"variables of shape {self.variables.shape}: must be (3 n,), all finite")

    def angle(self, time: npt.ArrayLike) -> FloatArray:
        """φ_H, rad, at ``time`` s."""
        return self._samples(np.asarray(time, dtype=np.float64))[0]

    def speed(self, time: npt.ArrayLike) -> FloatArray:
        """dφ_H/dt, rad/s."""
        return self._samples(np.asarray(time, dtype=np.float64))[1]

    def _samples(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        turned, speed = harmonic_samples(self.variables, times)
        if not self.ramp:
            return turned, speed
        angle = turned + start_of_harmonics(self.variables)
        ramp = np.array([smooth_ramp(t, 1.0 / self.ramp, 0.0)[:2] for t in times.ravel().tolist()])
        factor, rate = ramp.reshape(-1, 2).T.reshape(2, *times.shape)
        return factor * angle, factor * speed + rate * angle


def start_of_harmonics(variables: FloatArray) -> float:
    """Σ_i a_i sin α_i [rad] of the variables (a_1, ω_1, α_1, a_2, ...): where the harmonics' sum starts."""
    return float(np.sum(variables[0::3] * np.sin(variables[2::3])))


def harmonic_samples(variables: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Angle and speed at ``times`` of the ``HarmonicDrive`` with these variables, from φ_H(0) = 0."""
    angle, speed = np.zeros(times.shape), np.zeros(times.shape)
    for a, w, p in variables.reshape(-1, 3).tolist():
        argument = w * times + p
        angle += a * (np.sin(argument) - math.sin(p))
        speed += a * w * np.cos(argument)
    return angle, speed


def harmonic_jacobian(variables: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Jacobians (T, 3 n) of angle and speed of the ``HarmonicDrive`` by its variables."""
    a, w, p = variables.reshape(-1, 3).T
    t = times[:, None]
    argument = w * t + p
    sine, cosine = np.sin(argument), np.cos(argument)
    angle = (sine - np.sin(p), a * t * cosine, a * (cosine - np.cos(p)))
    speed = (w * cosine, a * (cosine - w * t * sine), -a * w * sine)
    return tuple(np.stack(parts, axis=2).reshape(len(times), -1) for parts in (angle, speed))  # type: ignore[return-value]


@kernel
def uniform_harmonic_samples(variables: FloatArray, step: float, count: int) -> tuple[FloatArray, FloatArray]:
    """``harmonic_samples`` at 0, step, 2 step, ...: each harmonic a turning complex number, no sine in the loop."""
    angle, speed = np.zeros(count), np.zeros(count)
    for i in range(variables.shape[0] // 3):
        a, w, p = variables[3 * i], variables[3 * i + 1], variables[3 * i + 2]
        s, c = math.sin(p), math.cos(p)
        turn_s, turn_c = math.sin(w * step), math.cos(w * step)
        offset = s
        for k in range(count):
            angle[k] += a * (s - offset)
            speed[k] += a * w * c
            s, c = s * turn_c + c * turn_s, c * turn_c - s * turn_s
    return angle, speed
