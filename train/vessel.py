"""Compute the default vessel's motion response with Capytaine: ``python -m train.vessel`` (extra ``vessel``).

A parametric supply-ship hull, fuller aft than forward, in deep water at zero speed. Linear potential theory by the
boundary element method, with a lid inside the waterplane against irregular frequencies; viscous roll damping is
added as a share of critical, since potential theory has next to none.
"""

from __future__ import annotations

import csv
import io
import math
import sys
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.progress import track

from aframe_env.scenario.vessel import COLUMNS, Vessel
from aframe_env.validation import InvalidValue, require_integer, require_number
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.run_folder import new_file, user_errors, write_atomically, write_text

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

WATER_DENSITY = 1025.0
GRAVITY = 9.81
DOFS = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")


@dataclass(frozen=True)
class Options:
    """The hull and the calculation."""

    out: Path | None = None
    """CSV to write; by default runs/vessel-DATE-TIME.csv."""
    overwrite: bool = False
    """Write CSV or picture even if there is a file of that name."""
    plot: Path | None = None
    """Picture to draw of a vessel, in place of a calculation."""
    vessel: Path | None = None
    """CSV of the vessel to draw; the package's own by default."""
    compare: Path | None = None
    """CSV of another vessel to draw beside it."""
    length: float = 83.0
    """Length between perpendiculars, m."""
    beam: float = 19.2
    """m."""
    draught: float = 6.0
    """m."""
    displacement: float = 6.362e6
    """kg."""
    metacentric_height: float = 2.144
    """Transverse, m."""
    roll_gyration: float = 0.35
    """Radius of gyration in roll, share of the beam."""
    pitch_gyration: float = 0.25
    """In pitch and yaw, share of the length."""
    roll_damping: float = 0.08
    """Total roll damping at resonance, share of critical."""
    stations: int = 40
    """Panels along the hull."""
    waterlines: int = 8
    """Panels around half a section."""
    frequencies: int = 46
    """Between 0.1 and 2.5 rad/s."""
    heading_step: int = 15
    """Degrees; must divide 180."""

    def __post_init__(self) -> None:
        for name in ("length", "beam", "draught", "displacement", "metacentric_height"):
            require_number(name, getattr(self, name), "m or kg", low=0.0, low_open=True)
        for name in ("roll_gyration", "pitch_gyration"):
            require_number(name, getattr(self, name), "", low=0.05, high=1.0)
        require_number("roll_damping", self.roll_damping, "of critical", low=0.0, high=1.0)
        require_integer("stations", self.stations, low=8, high=400)
        require_integer("waterlines", self.waterlines, low=3, high=100)
        require_integer("frequencies", self.frequencies, low=12, high=500)
        if self.heading_step < 1 or 180 % self.heading_step:
            raise InvalidValue(f"heading_step = {self.heading_step}°: must divide 180°")


FORE_FULLNESS = 3.0
AFT_FULLNESS = 8.0


def half_breadth(options: Options, x: FloatArray, depth: FloatArray) -> FloatArray:
    """Half breadth [m] at x from midships [m, forward] and depth below the waterline [m].

    y = B/2 (1 - |2x/L|^p) (1 - (depth/T)^q): p makes the fore body finer than the aft body, q gives the displacement.
    """
    along = np.abs(2.0 * x / options.length)
    waterline = 1.0 - along ** np.where(x > 0.0, FORE_FULLNESS, AFT_FULLNESS)
    below = np.clip(depth / options.draught, 0.0, 1.0)
    return np.asarray(0.5 * options.beam * waterline * (1.0 - below ** _section_fullness(options)))


def _section_fullness(options: Options) -> float:
    """q, from the displacement."""
    waterplane = 0.5 * sum(p / (p + 1.0) for p in (FORE_FULLNESS, AFT_FULLNESS))
    block = options.displacement / WATER_DENSITY / (options.length * options.beam * options.draught)
    section = block / waterplane
    if not 0.5 < section < 0.99:
        raise InvalidValue(f"displacement = {options.displacement:g} kg: does not go with the hull's dimensions")
    return section / (1.0 - section)


def hull_faces(options: Options) -> FloatArray:
    """Quadrilaterals of the wetted surface, both sides: (panels, 4, 3), normals outward."""
    x = -0.5 * options.length * np.cos(np.linspace(0.0, math.pi, options.stations + 1))
    # Equal arcs around the midship section.
    fine = np.linspace(0.0, options.draught, 2001)
    section = half_breadth(options, np.zeros_like(fine), fine)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(fine), np.diff(section)))])
    depth = np.interp(np.linspace(0.0, arc[-1], options.waterlines + 1), arc, fine)
    grid_x, grid_depth = np.meshgrid(x, depth, indexing="ij")
    y = half_breadth(options, grid_x, grid_depth)
    port = np.stack([grid_x, y, -grid_depth], axis=-1)
    a, b, c, d = port[:-1, :-1], port[:-1, 1:], port[1:, 1:], port[1:, :-1]
    faces = np.stack([a, d, c, b], axis=2).reshape(-1, 4, 3)
    starboard = faces[:, ::-1] * np.array([1.0, -1.0, 1.0])
    return np.concatenate([faces, starboard])


def compute(options: Options, console: Console) -> tuple[FloatArray, FloatArray, ComplexArray, FloatArray]:
    """Frequencies (F,), headings (D,) rad in [0, π], response (F, D, 6), reference point (3,).

    The response refers to the centre of gravity, with the wave's elevation there, in exp(+i ω t).
    """
    try:
        import capytaine as cpt
    except ImportError:
        raise InvalidValue('capytaine is not installed: pip install "aframe-heave[vessel]"') from None
    cpt.set_logging("ERROR")
    faces = hull_faces(options)
    mesh = cpt.Mesh(vertices=faces.reshape(-1, 3), faces=np.arange(4 * len(faces)).reshape(-1, 4))
    volume, buoyancy, waterplane_inertia = _hydrostatics(options)
    height = buoyancy[2] + waterplane_inertia / volume - options.metacentric_height
    gravity_centre = np.array([buoyancy[0], 0.0, height])
    body = cpt.FloatingBody(
        mesh=mesh,
        lid_mesh=mesh.generate_lid(),
        dofs=cpt.rigid_body_dofs(rotation_center=tuple(gravity_centre)),
        center_of_mass=tuple(gravity_centre),
        name="hull",
    )
    mass = WATER_DENSITY * volume
    stiffness = np.asarray(body.compute_hydrostatic_stiffness(rho=WATER_DENSITY, g=GRAVITY).values)
    inertia = np.diag(
        [mass] * 3
        + [
            mass * (options.roll_gyration * options.beam) ** 2,
            *[mass * (options.pitch_gyration * options.length) ** 2] * 2,
        ]
    )
    console.print(
        f"{len(faces)} panels, {mass:.4g} kg, LCB {buoyancy[0]:.2f} m, KG {height + options.draught:.2f} m, "
        f"GM_T {stiffness[3, 3] / (mass * GRAVITY):.3f} m"
    )
    # Fine where ships respond, coarse where they hardly do.
    omega = np.concatenate([np.linspace(0.1, 1.5, options.frequencies - 6), np.linspace(1.6, 2.5, 6)])
    heading = np.radians(np.arange(0.0, 180.1, options.heading_step))
    added = np.empty((len(omega), 6, 6))
    damping = np.empty((len(omega), 6, 6))
    force = np.empty((len(omega), len(heading), 6), dtype=np.complex128)
    solver = cpt.BEMSolver()
    for i, w in enumerate(track(omega, "solving", console=console)):
        problems = [
            cpt.RadiationProblem(body=body, radiating_dof=dof, omega=w, rho=WATER_DENSITY, g=GRAVITY) for dof in DOFS
        ]
        problems += [
            cpt.DiffractionProblem(body=body, wave_direction=b, omega=w, rho=WATER_DENSITY, g=GRAVITY) for b in heading
        ]
        data = cpt.assemble_dataset(solver.solve_all(problems, progress_bar=False))
        order = {"influenced_dof": list(DOFS)}
        pair = {**order, "radiating_dof": list(DOFS)}
        # Capytaine's order of these two axes is (radiating, influenced).
        added[i] = data["added_mass"].sel(pair).transpose("omega", "influenced_dof", "radiating_dof").values[0]
        damping[i] = data["radiation_damping"].sel(pair).transpose("omega", "influenced_dof", "radiating_dof").values[0]
        total = data["Froude_Krylov_force"] + data["diffraction_force"]
        force[i] = total.sel(order).transpose("omega", "wave_direction", "influenced_dof").values[0]
    viscous = _viscous_roll(omega, added[:, 3, 3], damping[:, 3, 3], inertia[3, 3], stiffness[3, 3], options)
    damping[:, 3, 3] += viscous
    response = np.empty_like(force)
    for i, w in enumerate(omega):
        dynamic = -(w**2) * (inertia + added[i]) - 1j * w * damping[i] + stiffness
        response[i] = np.linalg.solve(dynamic, force[i].T).T
    # From exp(-iωt) with the wave's elevation at the origin to exp(+iωt) with its elevation at the reference point.
    wave_number = omega**2 / GRAVITY
    shift = np.exp(1j * np.outer(wave_number, np.cos(heading)) * gravity_centre[0])
    response = np.conj(response / shift[:, :, None])
    # What symmetry makes zero, is zero.
    response[:, np.isclose(np.sin(heading), 0.0)] *= np.array([1, 0, 1, 0, 1, 0])
    return omega, heading, response, gravity_centre


def _hydrostatics(options: Options) -> tuple[float, FloatArray, float]:
    """Displaced volume [m³], centre of buoyancy (3,) [m], transverse second moment of the waterplane [m⁴]."""
    x = np.linspace(-0.5 * options.length, 0.5 * options.length, 2001)
    depth = np.linspace(0.0, options.draught, 401)
    breadth = 2.0 * half_breadth(options, x[:, None], depth[None, :])
    area = np.trapezoid(breadth, depth, axis=1)
    volume = float(np.trapezoid(area, x))
    centre_x = float(np.trapezoid(area * x, x)) / volume
    centre_z = -float(np.trapezoid(np.trapezoid(breadth * depth, depth, axis=1), x)) / volume
    inertia = float(np.trapezoid((0.5 * breadth[:, 0]) ** 3, x)) * 2.0 / 3.0
    return volume, np.array([centre_x, 0.0, centre_z]), inertia


def _viscous_roll(
    omega: FloatArray,
    added: FloatArray,
    damping: FloatArray,
    inertia: float,
    stiffness: float,
    options: Options,
) -> float:
    """Damping to add, N m s: what potential theory lacks of the share of critical at the roll resonance."""
    resonance = math.sqrt(stiffness / (inertia + float(np.median(added))))
    for _ in range(20):
        resonance = math.sqrt(stiffness / (inertia + float(np.interp(resonance, omega, added))))
    critical = 2.0 * (inertia + float(np.interp(resonance, omega, added))) * resonance
    return max(0.0, options.roll_damping * critical - float(np.interp(resonance, omega, damping)))


def to_csv(
    options: Options, omega: FloatArray, heading: FloatArray, response: ComplexArray, reference: FloatArray
) -> str:
    """The response as the text of a vessel's CSV."""
    from importlib.metadata import version

    text = io.StringIO()
    text.write(
        f"""\
# title: supply ship, parametric hull
# reference_point_m: {reference[0]:.4f}, {reference[1]:.4f}, {reference[2]:.4f}
# Hull: Lpp {options.length} m, beam {options.beam} m, draught {options.draught} m, {options.displacement / 1e3:.0f} t,
# GM_T {options.metacentric_height} m, roll damping {options.roll_damping:.0%} of critical; zero speed, deep water.
# Source: computed with Capytaine {version("capytaine")} by python -m train.vessel. Licence: MIT, as the package.
# Axes: x forward, y to port, z up, origin midships on the waterline. heading: direction the waves travel towards,
# from the bow towards port (0 following sea, 90 towards port, 180 head sea). A wave Re(a exp(i w t)) at the
# reference point moves that point of the ship by Re(a amp exp(i (w t + phase))). Amplitudes in m/m and rad/m,
# phases (lead) in rad. Headings 0 to 180 deg; the rest is the mirror image.
"""
    )
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for i, w in enumerate(omega):
        for j, angle in enumerate(heading):
            row: list[Any] = [f"{w:.6g}", f"{math.degrees(angle):g}"]
            for value in response[i, j]:
                row += [f"{abs(value):.6g}", f"{math.atan2(value.imag, value.real):.6g}"]
            writer.writerow(row)
    return text.getvalue()


def draw(vessel: Vessel, other: Vessel | None, path: Path) -> None:
    """Draw the response's amplitudes against period."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.4), layout="constrained")
    axes = figure.subplots(2, 3, sharex=True)
    colours = ("#0b6e99", "#3a7d44", "#d9822b", "#c8553d", "#7a5195")
    for dof, axis in enumerate(axes.flat):
        scale, unit = (1.0, "m/m") if dof < 3 else (math.degrees(1.0), "°/m")
        for angle, colour in zip((0, 45, 90, 135, 180), colours, strict=True):
            for source, style in ((vessel, "-"), (other, ":")):
                if source is None:
                    continue
                j = int(np.argmin(np.abs(source.headings - math.radians(angle))))
                label = f"{angle}°" if source is vessel else None
                period = 2.0 * math.pi / source.frequencies
                axis.plot(
                    period,
                    scale * np.abs(source.response[:, j, dof]),
                    style,
                    color=colour,
                    lw=1.6,
                    label=label,
                )
        axis.set_title(f"{DOFS[dof].lower()}, {unit}", fontsize=11)
        axis.set_xlim(3.0, 20.0)
        axis.set_ylim(bottom=0.0)
        if dof == 3:
            axis.set_ylim(0.0, 14.0)
            axis.annotate(
                "bounded by the damping\nalone: see below",
                (0.97, 0.93),
                xycoords="axes fraction",
                ha="right",
                va="top",
                fontsize=8,
            )
        if dof in (0, 1, 5):
            axis.set_ylim(0.0, 1.2 if dof != 5 else 2.0)
        axis.grid(alpha=0.3)
    for axis in axes[1]:
        axis.set_xlabel("period, s")
    axes[0, 0].legend(title="heading (180° = head sea)", fontsize=8, ncols=2)
    beside = f"; dotted: {other.name}" if other is not None else ""
    figure.suptitle(f"Motion response: {vessel.name}, at its centre of gravity{beside}")
    figure.supxlabel(
        "At its natural period only damping bounds the roll, and potential theory has next to none: the height of the "
        "peak\nis inversely proportional to the damping that was assumed, for the default vessel "
        f"{Options.roll_damping:.0%} of critical.",
        fontsize=9,
    )
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=130))


def run(options: Options, console: Console) -> int:
    """Compute, or draw."""
    if options.plot is not None:
        picture = new_file(options.plot, overwrite=options.overwrite)
        vessel = Vessel.supply() if options.vessel is None else Vessel.from_csv(options.vessel)
        draw(vessel, None if options.compare is None else Vessel.from_csv(options.compare), picture)
        console.print(f"picture: {options.plot}")
        return 0
    out = new_file(
        options.out or Path("runs") / f"vessel-{datetime.now():%Y%m%d-%H%M%S}.csv", overwrite=options.overwrite
    )
    write_text(out, to_csv(options, *compute(options, console)))
    console.print(f"vessel: {out}")
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, "train.vessel", __doc__ or ""), PlainConsole())


if __name__ == "__main__":
    sys.exit(main())
