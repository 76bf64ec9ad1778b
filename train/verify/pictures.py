"""Pictures of the checks, each figure beside its reference."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from aframe_env.rfem.beam import Array
from aframe_env.rfem.model import FrameModel
from aframe_env.rfem.modes import frame_modes
from aframe_env.rfem.reference import natural_frequencies, static_cases, time_series
from aframe_env.rfem.statics import static
from aframe_env.scenario.crane import Crane
from train.shared.run_folder import write_atomically
from train.verify.cases import dynamic_columns
from train.verify.drive_checks import torque_run
from train.verify.frame_checks import CASES, model
from train.verify.luffing_checks import swing_run
from train.verify.run_checks import paper_run, ramp_release, sea_run, shock_run
from train.verify.water_checks import PERIOD

HERE, REFERENCE, SECOND_ORDER = "#1f77b4", "#d62728", "#2ca02c"


def save(figure: Figure, path: Path) -> None:
    """Write a PNG under a temporary name, then rename it."""
    # No software version in the file: the same figures give the same bytes.
    write_atomically(path, lambda to: figure.savefig(to, format="png", dpi=110, metadata={"Software": None}))


def _nodes(frame: FrameModel) -> tuple[Array, list[tuple[int, Array]]]:
    """Places along the axis of the frame, in {D}, and the rfe that each moves with."""
    places, carriers = [], []
    for index, body in enumerate(frame.structure.bodies):
        for segment in body.segments:
            for position in (segment.low, segment.high):
                place = segment.point(position)
                places.append(frame.to_deck @ place)
                carriers.append((index, place))
    return np.array(places), carriers


def _moved(frame: FrameModel, position: Array, factor: float) -> Array:
    places, carriers = _nodes(frame)
    shifts = [
        frame.to_deck @ frame.structure.bodies[index].displacement(place) @ position[6 * index : 6 * index + 6]
        for index, place in carriers
    ]
    return np.asarray(places + factor * np.array(shifts))


def _views(axes: tuple[Axes, Axes], frame: FrameModel, position: Array, factor: float) -> None:
    rest, moved = _moved(frame, position, 0.0), _moved(frame, position, factor)
    for axis, across, label in ((axes[0], 1, "y, m"), (axes[1], 0, "x (outboard), m")):
        axis.plot(rest[:, across], rest[:, 2], color="0.7", label="undeformed")
        axis.plot(moved[:, across], moved[:, 2], color=HERE, label="deformed, enlarged")
        axis.set_xlabel(label)
        axis.set_ylabel("z, m")
        axis.set_aspect("equal")


def deformed_frame() -> Figure:
    """Draw load cases G, V, L1: undeformed and deformed frame from behind and from the side."""
    frame = model(20, 16)
    figure = Figure(figsize=(12, 9), layout="constrained")
    grid = figure.subplots(2, 3)
    for column, (name, case) in enumerate(CASES.items()):
        result = static(Crane(), case, model=frame)
        factor = 800.0 if name == "G" else 80.0
        _views((grid[0, column], grid[1, column]), frame, result.position, factor)
        rest, deflection = np.array(Crane().pulley_position), np.array(static_cases()[name]["u_S_D"])
        target = rest + factor * deflection
        grid[0, column].plot(target[1], target[2], "x", color=REFERENCE, label="S of the reference")
        grid[1, column].plot(target[0], target[2], "x", color=REFERENCE)
        height = result.displacement["S"][2] * 1e3
        grid[0, column].set_title(
            f"{name} (× {factor:g}): $u_{{S,z}}$ = {height:.3f} mm (reference {deflection[2] * 1e3:.3f})",
            fontsize=9,
        )
    grid[0, 0].legend(fontsize=8, loc="center")
    return figure


def moment_diagrams() -> Figure:
    """Draw bending moments and normal force along the frame, 20/16 rfes, with the reference at N, B, S."""
    frame = model(20, 16)
    figure = Figure(figsize=(12, 9), layout="constrained")
    grid = figure.subplots(3, 3, sharex=True)
    marks = {"NR": 4.8, "BR": 12.0, "S": 17.0, "BL": 22.0, "NL": 29.2}
    for column, (name, case) in enumerate(CASES.items()):
        stations = static(Crane(), case, model=frame).along()
        along = np.array([station.along for station in stations])
        forces = np.array([station.forces for station in stations])
        rows = ((4, "My", "M2 = My, kN m"), (5, "Mz", "M3 = Mz, kN m"), (0, "N", "N, kN"))
        for row, (component, key, label) in enumerate(rows):
            axis = grid[row, column]
            axis.plot(along, forces[:, component] / 1e3, color=HERE, label="rfem 20/16")
            for point, place in marks.items():
                for side in ("before", "after"):
                    value = static_cases()[name][f"sec_{side}_{point}"][key] / 1e3
                    axis.plot(place, value, "x", color=REFERENCE, label=None)
            for corner in (12.0, 22.0):
                axis.axvline(corner, color="0.85", zorder=0)
            axis.set_ylabel(label)
        grid[0, column].set_title(name)
        grid[2, column].set_xlabel("along A_R – B_R – B_L – A_L, m")
    grid[0, 0].plot([], [], "x", color=REFERENCE, label="reference")
    grid[0, 0].legend(fontsize=8)
    return figure


def mode_shapes() -> Figure:
    """Draw the first eight mode shapes, 20/16 rfes."""
    frame = model(20, 16)
    modes = frame_modes(Crane(), 8, model=frame)
    reference = natural_frequencies()
    figure = Figure(figsize=(13, 12), layout="constrained")
    grid = figure.subplots(4, 4)
    for index in range(8):
        shape = modes.shape[:, index]
        size = np.max(np.linalg.norm(_moved(frame, shape, 1.0) - _moved(frame, shape, 0.0), axis=1))
        row, column = divmod(index, 2)
        axes = (grid[row, 2 * column], grid[row, 2 * column + 1])
        _views(axes, frame, shape, 1.5 / size)
        here = modes.frequency[index]
        axes[0].set_title(f"mode {index + 1}: {here:.3f} Hz, reference {reference[index]:.3f} Hz", fontsize=9)
        axes[1].set_title("the same from the side", fontsize=9)
        axes[0].set(xlim=(-8.0, 8.0), ylim=(-0.5, 13.0))
        axes[1].set(xlim=(-1.0, 8.0), ylim=(-0.5, 13.0))
    return figure


class Panel(NamedTuple):
    """One quantity of a picture of histories."""

    column: str
    what: str
    symbol: str
    unit: str
    scale: float


OUTBOARD = Panel("uS1_m", "Deflection of S outboard", "$u_{S,x}$", "mm", 1e3)
UPWARDS = Panel("uS3_m", "Deflection of S upwards", "$u_{S,z}$", "mm", 1e3)
LOAD = Panel("xL3_m", "Level of the load", "$x_{L3}$", "m", 1.0)
TENSION = Panel("T_rope_N", "Tension of the rope", "$T$", "kN", 1e-3)
SERVOMOTOR = Panel("S_R_N", "Tension of the right servomotor", "$S_R$", "kN", 1e-3)
REACTIONS = tuple(
    Panel(f"RAR{axis + 1}_N", f"Reaction of the right foot, {along}", f"$R_{{AR,{letter}}}$", "kN", 1e-3)
    for axis, (letter, along) in enumerate((("x", "outboard"), ("y", "sideways"), ("z", "upwards")))
)


def _histories(
    time: Array,
    here: dict[str, Array],
    there: dict[str, Array],
    panels: list[Panel],
    names: tuple[str, str],
    second_order: dict[str, Array] | None = None,
) -> Figure:
    figure = Figure(figsize=(11, 2.6 * len(panels)), layout="constrained")
    grid = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, panel in zip(grid, panels, strict=True):
        ours, theirs = here[panel.column], there[panel.column]
        axis.plot(time, theirs * panel.scale, color=REFERENCE, linewidth=2.2, alpha=0.6, label=names[1])
        axis.plot(time, ours * panel.scale, color=HERE, linewidth=0.9, label=names[0])
        gap = np.max(np.abs(ours - theirs)) / np.ptp(theirs)
        title = f"{panel.what}: largest difference {gap:.2%} of peak-to-peak"
        about_mean = np.max(np.abs(ours - theirs - np.mean(ours - theirs))) / np.ptp(theirs)
        if about_mean < 0.5 * gap:
            title += f"; {about_mean:.2%} apart from a constant"
        if second_order is not None:
            closer = second_order[panel.column]
            axis.plot(time, closer * panel.scale, color=SECOND_ORDER, linewidth=0.9, label="with second order")
            title += f"; with second order {np.max(np.abs(closer - theirs)) / np.ptp(theirs):.2%}"
        axis.set_title(title, fontsize=9)
        axis.set_ylabel(f"{panel.symbol}, {panel.unit}")
    grid[0].legend(fontsize=8, loc="upper right")
    grid[-1].set_xlabel("t, s")
    return figure


def release_histories() -> Figure:
    """Draw a release over 0.1 s: deflection of S, servomotor force, reactions."""
    run = ramp_release()
    panels = [OUTBOARD, UPWARDS, SERVOMOTOR, *REACTIONS[1:]]
    names = ("rfem 120/100", "finite elements of 0.1 m")
    return _histories(run.here["t_s"], run.here, run.there, panels, names)


_FLEXIBLE = ("rfem 120/100", "independent program")


def figure_11() -> Figure:
    """Draw the deflection of S in the paper's case."""
    here, there = dynamic_columns(paper_run()), time_series("paper_flexible")
    return _histories(here["t_s"], here, there, [OUTBOARD, UPWARDS], _FLEXIBLE)


def figure_12() -> Figure:
    """Draw servomotor force and leg reactions in the paper's case."""
    here, there = dynamic_columns(paper_run()), time_series("paper_flexible")
    return _histories(here["t_s"], here, there, [SERVOMOTOR, *REACTIONS], _FLEXIBLE)


def shock_histories() -> Figure:
    """Draw the first six seconds of a load that starts at rest in space below a deck that moves."""
    run = shock_run()
    first = slice(0, 121)
    here, there = ({name: column[first] for name, column in each.items()} for each in (run.here, run.there))
    return _histories(here["t_s"], here, there, [OUTBOARD, UPWARDS, SERVOMOTOR, *REACTIONS], _FLEXIBLE)


def sea_histories() -> Figure:
    """Draw a sea of Hs 6 m with the drum still: load, rope, deflection of S, servomotor force, reactions."""
    run = sea_run()
    panels = [LOAD, TENSION, OUTBOARD, UPWARDS, SERVOMOTOR, *REACTIONS]
    names = ("environment", "stand-alone run, 120/100 rfes")
    return _histories(run.there["t_s"], run.here, run.there, panels, names)


def swing_histories() -> Figure:
    """Draw a frame that luffs from −20° to 25°, linear and of second order: load, deflection of S, forces."""
    run = swing_run()
    names = ("rfem 20/16, linear", "geometrically exact beams")
    panels = [LOAD, OUTBOARD, UPWARDS, SERVOMOTOR, *REACTIONS]
    figure = _histories(
        run.here["t_s"], run.here, run.there, panels, names, second_order=swing_run(second_order=True).here
    )
    figure.axes[0].legend(fontsize=8, loc="lower left")
    return figure


def torque_histories() -> Figure:
    """Draw a drum with inertia under torque below the flexible frame: load, drum, rope, deflection of S."""
    run = torque_run()
    panels = [
        LOAD,
        Panel("drum_rad_s", "Speed of the drum", r"$\dot\varphi_H$", "rad/s", 1.0),
        TENSION,
        OUTBOARD,
        UPWARDS,
    ]
    times = PERIOD * np.arange(len(run.here["xL3_m"]), dtype=np.float64)
    return _histories(times, run.here, run.there, panels, ("environment", "stand-alone run"))


def figure_14() -> Figure:
    """Draw x_L3 in the full and the simplified model, and their difference."""
    here, there, rigid = (
        dynamic_columns(paper_run()),
        time_series("paper_flexible"),
        time_series("paper_rigid"),
    )
    figure = Figure(figsize=(11, 6), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    time = here["t_s"]
    top.plot(time, rigid["xL3_m"], color="0.5", linewidth=2.2, label="simplified model (reference run)")
    top.plot(time, here["xL3_m"], color=HERE, linewidth=1.0, label="full model, rfem 120/100")
    top.set_ylabel("$x_{L3}$, m")
    top.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    bottom.plot(
        time,
        (there["xL3_m"] - rigid["xL3_m"]) * 1e3,
        color=REFERENCE,
        linewidth=2.2,
        alpha=0.6,
        label="independent program",
    )
    bottom.plot(time, (here["xL3_m"] - rigid["xL3_m"]) * 1e3, color=HERE, linewidth=0.9, label="rfem 120/100")
    bottom.set_ylabel("full − simplified, mm")
    bottom.set_xlabel("t, s")
    bottom.legend(fontsize=8, loc="upper left")
    return figure


def draw_all(folder: Path) -> list[Path]:
    """Write every picture into ``folder``; returns their paths."""
    drawn = []
    with mpl.rc_context({"axes.grid": True, "grid.alpha": 0.3, "font.size": 9}):
        for name, draw in (
            ("frame_deformed", deformed_frame),
            ("moment_diagrams", moment_diagrams),
            ("mode_shapes", mode_shapes),
            ("release_ramp", release_histories),
            ("shock", shock_histories),
            ("rough_sea", sea_histories),
            ("swing", swing_histories),
            ("drum_under_torque", torque_histories),
            ("figure_11_deflection", figure_11),
            ("figure_12_forces", figure_12),
            ("figure_14_load", figure_14),
        ):
            path = folder / f"{name}.png"
            save(draw(), path)
            drawn.append(path)
    return drawn
