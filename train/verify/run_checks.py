"""Checks of releases and of runs with rope, load and ship motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.flexible.readout import FEET, SERVOMOTORS
from aframe_env.flexible_engine import FRAME_DIVISION, FRAME_MODES, FlexibleEngine, Mesh
from aframe_env.rfem.beam import Array
from aframe_env.rfem.energy import energy_balance
from aframe_env.rfem.reference import time_series
from aframe_env.rfem.release import release
from aframe_env.rfem.simulate import DynamicCase, DynamicResult, simulate
from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Crane, Frame
from aframe_env.scenario.motion import COORDINATES, Harmonic, HarmonicMotion
from aframe_env.scenario.sea import Sea, SeaMotion
from train.verify.cases import FINE, columns_of, dynamic_columns
from train.verify.frame_checks import CASES, model, order
from train.verify.report import Check, Row

EVERY_COLUMN = "every column ≤ 1 % of peak-to-peak"
REACTIONS = ("S_R_N", "S_L_N", "RAR1_N", "RAR2_N", "RAR3_N", "RAL1_N", "RAL2_N", "RAL3_N")


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Columns of a run beside those of its reference."""

    here: dict[str, Array]
    there: dict[str, Array]

    def error(self, column: str) -> float:
        """Largest difference over the reference's peak-to-peak."""
        gap = np.max(np.abs(self.here[column] - self.there[column]))
        return float(gap / np.ptp(self.there[column]))

    def offset(self, column: str) -> float:
        """Mean difference."""
        return float(np.mean(self.here[column] - self.there[column]))

    def error_about_mean(self, column: str) -> float:
        """Largest difference less its mean, over the reference's peak-to-peak."""
        gap = self.here[column] - self.there[column]
        return float(np.max(np.abs(gap - np.mean(gap))) / np.ptp(self.there[column]))

    def rows(self, columns: tuple[str, ...]) -> list[Row]:
        """Peak-to-peak of both and the error."""
        return [
            Row.of_ranges(column, self.here[column], self.there[column], f"{self.error(column):.3%}")
            for column in columns
        ]

    def check(
        self, name: str, bar: str, columns: tuple[str, ...], *, judged: tuple[str, ...] | None = None, note: str = ""
    ) -> Check:
        """Check that the ``judged`` of these columns, by default all, are within 1 % of their peak-to-peak."""
        worst = max(self.error(column) for column in judged or columns)
        return Check(
            name=name,
            bar=bar,
            measured=f"{worst:.3%} at worst",
            passed=worst <= 0.01,
            rows=self.rows(columns),
            note=note,
        )


@cache
def ramp_release(leg: int = 120, beam: int = 100, corrected_shear: bool = False) -> Comparison:
    """Simulate a release of 100 t over 0.1 s, 2 s, undamped."""
    frame = model(leg, beam, corrected_shear=corrected_shear)
    history = release(Crane(), CASES["V"], ramp=0.1, step=1e-4, model=frame)
    return Comparison(here=columns_of(history), there=time_series("release_ramp"))


@cache
def paper_run() -> DynamicResult:
    """Simulate the paper's motion (42), drum still, as the command does by default."""
    return simulate(DynamicCase(), model=model(FINE.leg, FINE.beam))


def releases() -> Check:
    """Check the ramped release at the reference's own mesh, and coarser for comparison."""
    columns = ("uS1_m", "uS3_m", *REACTIONS)
    fine = ramp_release()
    worst = max(fine.error(column) for column in columns)
    rows = fine.rows(columns)
    for leg, beam, corrected in ((20, 16, False), (40, 32, False), (60, 50, False), (120, 100, True)):
        errors = [ramp_release(leg, beam, corrected).error(column) for column in columns]
        rows.append(
            Row(
                quantity=f"worst of these at {leg}/{beam}" + ", corrected elements" * corrected,
                measured="",
                reference="",
                error=f"{max(errors):.3%}",
            )
        )
    return Check(
        name="release of 100 t over 0.1 s, 2 s, undamped, the paper's elements, 120/100 (the reference's 0.1 m)",
        bar="deflection of S and reactions ≤ 1 % of peak-to-peak",
        measured=f"{worst:.3%} at worst",
        passed=worst <= 0.01,
        rows=rows,
        note="The reference lumps its mass as the paper's elements do. Corrected elements differ from it by what both "
        "differ from a continuous beam.",
    )


def paper_case() -> list[Check]:
    """Check full against simplified model, and forces, as the independent program has them."""
    there, rigid = time_series("paper_flexible"), time_series("paper_rigid")
    both = Comparison(here=dynamic_columns(paper_run()), there=there)
    here_gap = both.here["xL3_m"] - rigid["xL3_m"]
    there_gap = there["xL3_m"] - rigid["xL3_m"]
    largest, target = float(np.max(np.abs(here_gap))), float(np.max(np.abs(there_gap)))
    apart = float(np.max(np.abs(here_gap - there_gap))) / target
    return [
        Check(
            name="paper's case, 60 s: x_L3 full − simplified (fig. 14)",
            bar="the independent program's difference within 1 % of it",
            measured=f"{largest * 1e3:.2f} mm; the histories of it within {apart:.2%}",
            passed=abs(largest / target - 1.0) <= 0.01 and apart <= 0.01,
            rows=[
                Row(
                    quantity="largest difference, mm",
                    measured=f"{largest * 1e3:.3f}",
                    reference=f"{target * 1e3:.3f}",
                    error=f"{largest / target - 1.0:.3%}",
                ),
                *both.rows(("xL1_m", "xL3_m", "uS1_m", "uS3_m")),
            ],
        ),
        both.check("paper's case: servomotor force and leg reactions (fig. 12)", "≤ 1 % of peak-to-peak", REACTIONS),
    ]


@cache
def shock_run() -> Comparison:
    """Simulate the paper's motion with the load at rest in space, as the command does by default."""
    case = DynamicCase(scenario=Scenario.paper(initial="rest"))
    return Comparison(
        here=dynamic_columns(simulate(case, model=model(FINE.leg, FINE.beam))), there=time_series("shock")
    )


def shocks() -> list[Check]:
    """Check a load at rest in space below a deck that moves, and a load that is let go at once."""
    started = shock_run()
    columns = ("xL1_m", "xL3_m", "T_rope_N", "uS1_m", "uS3_m", "S_R_N", "RAR1_N", "RAR2_N", "RAR3_N")
    stepped = Comparison(here=environment_columns(Scenario.paper(initial="rest")), there=started.there)
    released = Comparison(
        here=columns_of(release(Crane(), CASES["V"], step=1e-4, model=model(FINE.leg, FINE.beam))),
        there=time_series("release_instant"),
    )
    return [
        started.check("shock: load at rest in space, deck moving, 60 s, undamped, by default", EVERY_COLUMN, columns),
        stepped.check("the same in the environment at its default step", EVERY_COLUMN, tuple(stepped.here)),
        released.check(
            "release of 100 t at once, 2 s, undamped, by default",
            "deflection of S ≤ 1 % of peak-to-peak",
            ("uS1_m", "uS3_m"),
            note="Reactions and servomotors are not compared: a step of the force runs through an undamped frame as a "
            "front, and no number of elements has their histories converge (16 % from 120 to 240 elements a leg).",
        ),
    ]


@cache
def sea_run() -> Comparison:
    """The environment's run in a sea of Hs 6 m, all six directions, beside a fine one that stands alone."""
    motion = SeaMotion(sea=Sea(hs=6.0, tp=9.0, heading=2.5, seed=4))
    scenario = Scenario.paper(motion=motion, rope_damping=2e4)
    fine = simulate(DynamicCase(scenario=scenario, step=2.5e-3), model=model(FINE.leg, FINE.beam))
    return Comparison(here=environment_columns(scenario), there={"t_s": fine.time} | dynamic_columns(fine))


def rough_seas() -> Check:
    """Check the environment's full model in a sea of Hs 6 m against a fine run that stands alone."""
    run = sea_run()
    return run.check(
        "sea of Hs 6 m, all six directions, drum still, 60 s: the environment at its default step against a "
        "stand-alone run of 120/100 rfes at 2.5 ms",
        EVERY_COLUMN,
        tuple(run.here),
    )


def environment_columns(scenario: Scenario) -> dict[str, Array]:
    """Run 60 s in the environment's engine of the full model as it is by default; columns of the reference data."""
    engine = FlexibleEngine(1, 0.05, Mesh(FRAME_DIVISION, FRAME_MODES))
    engine.reset_row(0, scenario)
    loads, tensions, frames = [], [], []
    for _ in range(1201):
        loads.append(engine.read_many(at.LOAD_POSITION, 3)[0])
        tensions.append(engine.read(at.TENSION)[0])
        frames.append(engine.read_frames()[0])
        engine.step(np.zeros(1))
    load, frame = np.array(loads), np.array(frames)
    feet = {f"RAR{axis + 1}_N": frame[:, FEET + axis] for axis in range(3)}
    return {
        "xL1_m": load[:, 0],
        "xL3_m": load[:, 2],
        "T_rope_N": np.array(tensions),
        "uS1_m": frame[:, 0],
        "uS3_m": frame[:, 2],
        "S_R_N": frame[:, SERVOMOTORS],
        **feet,
    }


def stiffened(frame: Frame, factor: float) -> Frame:
    """The frame with its material so many times as stiff, and as heavy as it is."""
    steel = frame.structure.material
    steel = replace(steel, young_modulus=factor * steel.young_modulus, shear_modulus=factor * steel.shear_modulus)
    return replace(frame, structure=replace(frame.structure, material=steel))


def stiff_frame() -> Check:
    """Check that a frame 1000 × stiffer moves the load as a rigid one does."""
    stiff = Scenario.paper(crane=Crane(frame=stiffened(Frame(), 1e3)))
    result = simulate(DynamicCase(scenario=stiff, step=1e-3))
    gap = float(np.max(np.abs(result.load[:, 2] - time_series("paper_rigid")["xL3_m"])))
    return Check(
        name="frame 1000 × stiffer, 60 s, step 1 ms",
        bar="the simplified model's x_L3 within 1e-4 m",
        measured=f"{gap:.1e} m",
        passed=gap <= 1e-4,
    )


def energy() -> list[Check]:
    """Check the work of deck and drum against the energy stored and dissipated."""
    case = DynamicCase(step=2.5e-3, output_interval=2.5e-3)
    still = energy_balance(simulate(case)).error
    frame = Crane().frame
    lossy = replace(frame.structure.material, normal_damping=2.1e8, tangential_damping=5e7)
    damped = replace(frame, structure=replace(frame.structure, material=lossy))
    scenario = Scenario.paper(initial="rest", rope_damping=5e4, crane=Crane(frame=damped))
    lost = energy_balance(simulate(replace(case, scenario=scenario)))
    worst = max(still, lost.error)
    rough = Scenario.paper(motion=rough_sea(), rope_damping=2e4)
    sea = energy_balance(
        simulate(replace(case, scenario=rough, duration=30.0, step=1.25e-3, output_interval=1.25e-3), model=model(5, 2))
    )
    return [
        Check(
            name="energy balance over 60 s, step 2.5 ms",
            bar="1e-5 relative",
            measured=f"undamped {still:.1e}; frame and rope damped {lost.error:.1e} "
            f"({lost.dissipated[-1] / 1e3:.0f} kJ lost)",
            passed=worst <= 1e-5,
        ),
        Check(
            name="energy balance in a rough sea, all six directions, 30 s, 5/2 rfes, step 1.25 ms",
            bar="1e-5 relative",
            measured=f"{sea.error:.1e} of {np.max(np.abs(sea.input)) / 1e6:.1f} MJ put in",
            passed=sea.error <= 1e-5,
        ),
    ]


def steps() -> Check:
    """Check the error of x_L3 as the step is halved."""
    shock = Scenario.paper(initial="rest")
    steps = (0.01, 0.005, 0.0025, 0.00125)
    runs = {h: simulate(DynamicCase(scenario=shock, step=h)).load[:, 2] for h in steps}
    finest = runs[0.00125] + (runs[0.00125] - runs[0.0025]) / 3.0
    errors = {h: float(np.max(np.abs(run - finest))) for h, run in runs.items()}
    orders = [order(errors[a], errors[b]) for a, b in ((0.01, 0.005), (0.005, 0.0025))]
    return Check(
        name="halving the step, 10/8 rfes, load at rest in space, x_L3 over 60 s",
        bar="second order or better",
        measured=f"order {min(orders):.2f} … {max(orders):.2f}",
        passed=min(orders) > 1.9,
        rows=[
            Row(
                quantity=f"step {h * 1e3:g} ms: error of x_L3",
                measured=f"{error * 1e3:.4f} mm",
                reference="extrapolated",
                error="",
            )
            for h, error in errors.items()
        ],
    )


def rough_sea(seed: int = 20090601) -> HarmonicMotion:
    """A rough irregular motion in all six directions: 12 harmonics each, periods of 5 to 20 s."""
    random = np.random.default_rng(seed)
    scales = (0.5, 0.5, 0.9, 0.03, 0.02, 0.01)
    return HarmonicMotion(
        harmonics=tuple(
            Harmonic(
                coordinate=coordinate,
                amplitude=float(scale / np.sqrt(6.0) * random.uniform(0.5, 1.5)),
                period=float(random.uniform(5.0, 20.0)),
                phase=float(random.uniform(0.0, 2.0 * np.pi)),
            )
            for coordinate, scale in zip(COORDINATES, scales, strict=True)
            for _ in range(12)
        )
    )


def drift() -> Check:
    """Check feet and cylinders after ten minutes."""
    scenario = Scenario.paper(motion=rough_sea(), rope_damping=2e4)
    case = DynamicCase(scenario=scenario, duration=600.0, step=0.02, output_interval=0.2)
    result = simulate(case, model=model(5, 2))
    moved = result.frame.constraint_violation()
    heave = float(np.ptp(result.deck.position[:, 2]))
    minute = round(60.0 / case.output_interval)
    beyond = second_order_lengths(result)
    return Check(
        name="600 s in a rough sea, all six directions, step 20 ms",
        bar="feet within 1 µm of their pins; lengths of the servomotors, linear as the frame is, to 1 µm",
        measured=f"{moved:.1e} m, by elimination of the constrained coordinates (heave {heave:.1f} m peak-to-peak)",
        passed=moved < 1e-6,
        rows=[
            Row(
                quantity=f"{name}: displaced points, beyond the linear length; first minute, last minute, at most",
                measured=", ".join(f"{1e6 * np.max(part):.0f}" for part in (gaps[:minute], gaps[-minute:], gaps))
                + " µm",
                reference="left out, as all that is of second order in the displacements; no drift",
                error="",
            )
            for name, gaps in beyond.items()
        ],
    )


def second_order_lengths(result: DynamicResult) -> dict[str, Array]:
    """Lengthening of the servomotors (C–N) and the legs' chords (A–N) between the displaced points, beyond that of
    the linear frame, (k,), m, the larger of both sides."""
    frame, to_deck = result.frame.model.frame, result.frame.model.to_deck
    found: dict[str, list[Array]] = {"servomotors C–N": [], "legs' chords A–N": []}
    for side, y in (("R", -frame.half_width), ("L", frame.half_width)):
        end = to_deck @ np.array([0.0, y, frame.servomotor_height])
        moved = result.frame.displacement(f"N_{side}")
        starts = ((frame.servomotor_deck_x, y, 0.0), (0.0, y, 0.0))
        for gaps, start in zip(found.values(), starts, strict=True):
            link = end - np.array(start)
            length = np.linalg.norm(link)
            gaps.append(np.linalg.norm(link + moved, axis=1) - length - moved @ link / length)
    return {name: np.maximum(*gaps) for name, gaps in found.items()}
