"""The paper's "map of basic drive functions": stored optimal drives, approximated in between.

Each node of the map is one regular heave of the crane's tip, a load and a rope; stored is the best pseudo-harmonic
drive for it, as the complex ratio of the rope that it pays out to that heave (its argument is the lead of the drive).
A sea is a sum of harmonics, the crane nearly linear, time nowhere special: the drive for a sea is the sum of the
drives for its harmonics, and phases need no axis of the map.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from safetensors import SafetensorError
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays
from scipy.interpolate import RegularGridInterpolator

from aframe_env.scenario import GRAVITY, Crane, Scenario
from aframe_env.scenario.motion import Harmonic, HarmonicMotion
from aframe_env.serialization import strict_converter, structure
from aframe_env.validation import InvalidValue, require_number
from agents import cards, shipped
from agents.drives.forecast import Harmonics
from agents.drives.functions import RampedDrive
from agents.drives.objectives import Objective, coarse_step
from agents.drives.optimisation import optimise
from agents.policy import FloatArray

FORMAT: Final = 2
ARRAYS: Final = "drive_map.safetensors"
CARD: Final = "drive_map.json"
AXES: Final = ("amplitude", "period", "mass", "length")


@dataclass(frozen=True, kw_only=True)
class Node:
    """A regular heave of the crane's tip, a load and a rope."""

    amplitude: float
    """m."""
    period: float
    """s."""
    mass: float
    """kg."""
    length: float
    """|LS| with the ship at rest, m."""
    damping_ratio: float = 0.03
    """Damping of the load's bobbing on the rope, share of critical."""
    periods: float = 6.0
    """Duration that the drive is optimised over, in periods."""
    crane: Crane = field(default_factory=Crane)

    @property
    def scenario(self) -> Scenario:
        """Scenario of the node: the load starts at rest, the tip moving upwards from the middle of its stroke."""
        heave = Harmonic(coordinate="heave", amplitude=self.amplitude, period=self.period)
        case = Scenario(
            crane=self.crane,
            motion=HarmonicMotion(harmonics=(heave,)),
            load_mass=self.mass,
            target_level=self.crane.pulley_position[2] - self.length,
            initial="rest",
        )
        return replace(case, rope_damping=self.damping_ratio * 2.0 * case.moved_mass * case.rope_frequency)


@dataclass(frozen=True)
class NodeDrive:
    """Optimum of a node."""

    real: float
    """Real and imaginary part of rope paid out over the tip's heave, both at the heave's frequency."""
    imaginary: float
    remaining: float
    """RMS depth error over that with the drum still."""
    evaluations: int


def optimise_node(node: Node) -> NodeDrive:
    """Find the best pseudo-harmonic drive (one harmonic, Ω1) of a node.

    The search starts well off, with half the heave and 0.3 rad late: its result owes nothing to a good guess.
    """
    scenario, duration = node.scenario, node.periods * node.period
    radius = scenario.crane.winch.drum_radius
    start = (0.5 * node.amplitude / radius, 2.0 * np.pi / node.period, -0.3)
    found = optimise("harmonic", scenario, "omega1", duration, harmonics=1, optimiser="gauss-newton", start=start)
    still = Objective(scenario, duration, coarse_step(scenario)).still()
    # Its own frequency may differ a little from the heave's: what counts is its share at the latter.
    times = np.linspace(0.0, duration, 64 * max(1, round(node.periods)) + 1)
    turned = 2.0 * np.pi / node.period * times
    basis = np.stack([np.sin(turned), np.cos(turned), np.ones(len(times))], axis=1)
    sine, cosine, _ = np.linalg.lstsq(basis, found.drive.angle(times), rcond=None)[0].tolist()
    scale = radius / node.amplitude
    return NodeDrive(scale * sine, scale * cosine, found.rms / still.rms, found.evaluations)


@dataclass(frozen=True)
class MapCard:
    """Description of a map, beside its arrays."""

    command: str
    versions: dict[str, str]
    sha256: str
    """sha256 of the file of arrays."""
    format: int = FORMAT


@dataclass(frozen=True, eq=False)
class DriveMap:
    """Optimal pseudo-harmonic drives over amplitude × period × mass × rope length."""

    amplitude: FloatArray
    """(A,) m, rising."""
    period: FloatArray
    """(P,) s, rising."""
    mass: FloatArray
    """(M,) kg, rising."""
    length: FloatArray
    """(L,) m, rising."""
    ratio: npt.NDArray[np.complex128]
    """(A, P, M, L) rope paid out over heave."""
    remaining: FloatArray = field(repr=False)
    """(A, P, M, L) RMS depth error over that with the drum still, at the nodes."""

    def __post_init__(self) -> None:
        for name in AXES:
            axis = getattr(self, name)
            if axis.ndim != 1 or len(axis) < 2 or not (np.all(axis > 0.0) and np.all(np.diff(axis) > 0.0)):
                raise InvalidValue(f"{name}: must be at least 2 rising positive numbers")
        if not self.ratio.shape == self.remaining.shape == self.shape:
            raise InvalidValue(f"ratio {self.ratio.shape}, remaining {self.remaining.shape}: must be {self.shape}")
        if not (np.isfinite(self.ratio).all() and np.isfinite(self.remaining).all()):
            raise InvalidValue("ratio, remaining: must be finite")

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """(A, P, M, L)."""
        return len(self.amplitude), len(self.period), len(self.mass), len(self.length)

    @cached_property
    def _interpolator(self) -> RegularGridInterpolator:
        axes = (self.amplitude, np.log(self.period), self.mass, np.log(self.length))
        return RegularGridInterpolator(axes, np.stack([self.ratio.real, self.ratio.imag], axis=-1))

    def ratio_at(
        self, amplitude: npt.ArrayLike, period: npt.ArrayLike, mass: npt.ArrayLike, length: npt.ArrayLike
    ) -> npt.NDArray[np.complex128]:
        """Rope paid out over heave, for arrays of one shape [m, s, kg, m]; beyond the grid, that of its edge.

        Linear between the nodes: in amplitude and mass, and in the logarithms of period and length.
        """
        places = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (amplitude, period, mass, length)))
        held = [
            np.clip(place, axis[0], axis[-1])
            for place, axis in zip(places, (getattr(self, name) for name in AXES), strict=True)
        ]
        points = np.stack([held[0], np.log(held[1]), held[2], np.log(held[3])], axis=-1)
        # A logarithm may round to just beyond the grid's end.
        points = np.clip(points, [a[0] for a in self._interpolator.grid], [a[-1] for a in self._interpolator.grid])
        real, imaginary = np.moveaxis(self._interpolator(points), -1, 0)
        return np.asarray(real + 1j * imaginary)

    def light_strain(self, mass: float, axial_stiffness: float) -> float:
        """Strain, of a rope of ``axial_stiffness`` N, that ``ratio_at`` allows for with this mass [kg].

        Rope paid out is longer by it; a heavy rope in water, whose load bobs like that mass, has another one.
        """
        return min(max(mass, float(self.mass[0])), float(self.mass[-1])) * GRAVITY / axial_stiffness

    def drive(self, scenario: Scenario, heave: Harmonics, duration: float) -> RampedDrive:
        """The drive for a heave of the tip: each harmonic's own, all together, over ``duration`` s.

        Of the scenario it takes the mass that bobs on the rope, rope length, drum radius, and the ramp of the ship's
        motion; with a heavy rope in water also the strain at the pulley.
        """
        require_number("duration", duration, "s", low=0.0, low_open=True)
        count = len(heave.amplitude)
        # A harmonic of a sea goes with the amplitude of the whole: what is not linear depends on that.
        whole = np.full(count, np.sqrt(np.sum(heave.amplitude**2)))
        ratio = self.ratio_at(
            whole,
            2.0 * np.pi / heave.frequency,
            np.full(count, scenario.moved_mass),
            np.full(count, scenario.rope_length),
        )
        if not scenario.is_light:
            light = self.light_strain(scenario.moved_mass, scenario.crane.rope.axial_stiffness)
            ratio *= (1.0 + light) / (1.0 + scenario.pulley_strain)
        amplitude = np.abs(ratio) * heave.amplitude / scenario.crane.winch.drum_radius
        variables = np.stack([amplitude, heave.frequency, heave.phase + np.angle(ratio)], axis=1)
        return RampedDrive(duration=float(duration), variables=variables.ravel(), ramp=scenario.ramp)


def ideal_ratio(scenario: Scenario) -> float:
    """Rope paid out over heave that keeps the tension as it is at rest: 1/(1 + m g / (E_R F_R)), or with W + w L.

    The closed form for a tip that only heaves. The stretched length follows the tip, the unstretched one is less by
    the strain; the load then feels no motion at all, whatever its period, amplitude, or the rope's length.
    """
    return 1.0 / (1.0 + scenario.pulley_strain)


def serialise(drive_map: DriveMap, command: str, versions: dict[str, str]) -> tuple[bytes, str]:
    """Bytes of the safetensors file, and text of the JSON beside it."""
    arrays = {name: np.ascontiguousarray(getattr(drive_map, name)) for name in (*AXES, "remaining")}
    arrays["ratio"] = np.stack([drive_map.ratio.real, drive_map.ratio.imag], axis=-1)
    data = save_arrays(arrays)
    card = MapCard(command, versions, hashlib.sha256(data).hexdigest())
    return data, json.dumps(cards.sealed(asdict(card)), indent=2, ensure_ascii=False) + "\n"


def load(place: str | Path = shipped.DRIVE_MAP) -> DriveMap:
    """Load a map from its folder, or the shipped one. Raises InvalidValue where the files do not belong together."""
    path = shipped.folder(place)
    try:
        data = (path / ARRAYS).read_bytes()
    except (OSError, ValueError) as error:
        raise InvalidValue(f"no drive map in {str(path)!r}: {error}") from error
    card = structure(strict_converter(), cards.read(path / CARD, "drive map", FORMAT), MapCard, str(path / CARD))
    if hashlib.sha256(data).hexdigest() != card.sha256:
        raise InvalidValue(f"{path / ARRAYS}: does not match the sha256 in {CARD}: damaged or not its file")
    try:
        arrays = load_arrays(data)
        ratio = arrays["ratio"][..., 0] + 1j * arrays["ratio"][..., 1]
        amplitude, period, mass, length = (arrays[name] for name in AXES)
        return DriveMap(amplitude, period, mass, length, ratio, arrays["remaining"])
    except (SafetensorError, KeyError, IndexError) as error:
        raise InvalidValue(f"{path / ARRAYS}: not a drive map: {error}") from error
