"""Preview: what a wave radar foretells of the pulley's heave, the worse the further ahead.

A radar sees the waves on their way to the ship, and a computer carries each of them on at its frequency. That is known
with an error, as are the speed and direction that it comes from, so that a wave's phase is the further off the further
ahead it is told; what the ship makes of the waves is told truly.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import kernel
from aframe_env.dynamics.motion import smooth_ramp
from aframe_env.dynamics.random import draw_seed, normal
from aframe_env.scenario.motion import Coordinate, has_components
from aframe_env.scenario.scenario import Scenario
from aframe_env.validation import InvalidValue, require_number

FloatArray = npt.NDArray[np.float64]

MOST_LEADS: Final = 1000
STREAM: Final = 2**48
"""Place of the preview's seeds among the draws of a row's seed of noise, beyond all that the readings come to."""


@dataclass(frozen=True, kw_only=True)
class Preview:
    """A wave radar's preview of the pulley's heave, at leads of ``interval``, 2 ``interval``, … ``horizon``.

    Told at time t is the heave at t + τ, which is the true one and Σ A_i [cos(ω_i (t + τ) + φ_i + δ_i ω_i τ) -
    cos(ω_i (t + τ) + φ_i)] over the waves, A_i and φ_i being the linear response of the pulley's heave. Each wave has
    its error δ_i of the frequency, which an episode keeps: the preview is exact at τ = 0 and off by σ ω_i τ of the
    wave's amplitude, root mean square over episodes, as long as that is small.
    """

    horizon: float = 15.0
    """Furthest lead, s."""
    interval: float = 0.5
    """Step from lead to lead, s; the horizon is a multiple of it."""
    frequency_error: float = 0.028
    """σ, standard deviation of the waves' frequencies as told about the true ones, as a share of these."""
    noise: float = 0.0
    """Standard deviation of an error of each value beside that, white in time and over the leads, m."""

    def __post_init__(self) -> None:
        require_number("horizon", self.horizon, "s", low=0.01, high=600.0)
        require_number("interval", self.interval, "s", low=0.01, high=600.0)
        require_number("frequency_error", self.frequency_error, "of the frequency", low=0.0, high=1.0)
        require_number("noise", self.noise, "m", low=0.0, high=100.0)
        count = self.horizon / self.interval
        if not (1 <= round(count) <= MOST_LEADS and abs(count - round(count)) < 1e-6):
            raise InvalidValue(
                f"horizon = {self.horizon:g} s: must be 1 to {MOST_LEADS} whole intervals of {self.interval:g} s"
            )

    @property
    def leads(self) -> tuple[float, ...]:
        """Leads, s from now."""
        return tuple(self.interval * (k + 1) for k in range(round(self.horizon / self.interval)))


def require_foreseeable(scenario: Scenario) -> None:
    """Raise unless a preview can tell the pulley's heave in a scenario."""
    if not has_components(scenario.motion):
        raise InvalidValue("preview: the scenario follows a recorded motion: must be a sea or harmonics")
    if scenario.luffing is not None:
        raise InvalidValue("preview: the frame luffs: must stand still, for its pulley's heave to be foretold")


class PreviewBank:
    """The previews of many rows, each a function of its scenario, its seed and the time alone."""

    def __init__(self, preview: Preview, rows: int, control_period: float) -> None:
        self._preview, self._period = preview, control_period
        self._count = np.zeros(rows, dtype=np.int64)
        self._frequency = np.zeros((rows, 0))
        # From lead to lead: the waves as they are, and as they are told.
        self._turn, self._drifted = np.zeros((2, rows, 0), dtype=np.complex128)
        self._response = np.zeros((rows, 0, 3), dtype=np.complex128)
        self._pulley = np.zeros((rows, 3))
        self._ramp = np.zeros((rows, 2))
        self._seed = np.zeros(rows, dtype=np.int64)

    def start_row(self, index: int, scenario: Scenario, seed: int) -> None:
        """Let a row follow a scenario; ``seed`` of its noise, from which the errors are drawn, too."""
        require_foreseeable(scenario)
        components = scenario.motion.components()  # type: ignore[union-attr]
        count, preview = len(components.frequency), self._preview
        self._make_room(count)
        own = draw_seed(seed, STREAM)
        error = preview.frequency_error * np.array([normal(own, i) for i in range(count)])
        self._count[index], self._seed[index] = count, draw_seed(seed, STREAM + 1)
        self._frequency[index, :count] = components.frequency
        turn = 1j * preview.interval * components.frequency
        self._turn[index, :count] = np.exp(turn)
        self._drifted[index, :count] = np.exp(turn * (1.0 + error))
        self._response[index, :count] = components.response[:, Coordinate.HEAVE : Coordinate.PITCH + 1]
        self._pulley[index] = scenario.crane.pulley_position
        self._ramp[index] = (1.0 / scenario.ramp, 0.0) if scenario.ramp else (0.0, 1.0)

    def at(self, steps: npt.NDArray[np.int64]) -> FloatArray:
        """Previews (rows, leads) m that are told ``steps`` (rows,) control steps after the start."""
        told = np.empty((len(steps), len(self._preview.leads)))
        _look_ahead()(
            steps,
            self._period,
            self._preview.interval,
            self._preview.noise,
            self._count,
            self._frequency,
            self._turn,
            self._drifted,
            self._response,
            self._pulley,
            self._ramp,
            self._seed,
            told,
        )
        return told

    def _make_room(self, components: int) -> None:
        more = components - self._frequency.shape[1]
        if more > 0:
            wider = ((0, 0), (0, more))
            self._frequency = np.pad(self._frequency, wider)
            self._turn, self._drifted = np.pad(self._turn, wider), np.pad(self._drifted, wider)
            self._response = np.pad(self._response, (*wider, (0, 0)))


@cache
def _look_ahead() -> Callable[..., Any]:
    @kernel
    def look_ahead(  # type: ignore[no-untyped-def]
        steps, period, interval, noise, count, frequency, turn, drifted, response, pulley, ramp, seed, told
    ):
        rows, leads = told.shape
        heave, roll, pitch, error = np.empty(leads), np.empty(leads), np.empty(leads), np.empty(leads)
        for i in range(rows):
            time = steps[i] * period
            x, y, z = pulley[i, 0], pulley[i, 1], pulley[i, 2]
            heave[:], roll[:], pitch[:], error[:] = 0.0, 0.0, 0.0, 0.0
            for c in range(count[i]):
                angle = frequency[i, c] * time
                true = complex(math.cos(angle), math.sin(angle))
                off = true
                up, about_x, about_y = response[i, c, 0], response[i, c, 1], response[i, c, 2]
                linear = up + y * about_x - x * about_y
                for k in range(leads):
                    true *= turn[i, c]
                    off *= drifted[i, c]
                    heave[k] += (up * true).real
                    roll[k] += (about_x * true).real
                    pitch[k] += (about_y * true).real
                    error[k] += (linear * (off - true)).real
            for k in range(leads):
                risen, _, _ = smooth_ramp(time + (k + 1) * interval, ramp[i, 0], ramp[i, 1])
                a, b = risen * roll[k], risen * pitch[k]
                # The pulley's place on the deck, turned by roll and pitch; yaw does not lift it.
                lifted = math.cos(b) * (math.sin(a) * y + math.cos(a) * z) - math.sin(b) * x - z
                told[i, k] = risen * (heave[k] + error[k]) + lifted
                if noise > 0.0:
                    told[i, k] += noise * normal(seed[i], steps[i] * leads + k)

    return look_ahead
