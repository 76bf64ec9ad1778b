"""Checks of beams, static frame and natural frequencies."""

from __future__ import annotations

import math
import time
from itertools import pairwise
from typing import Any

import numpy as np

from aframe_env.rfem.beam import Array, Member
from aframe_env.rfem.model import FrameModel, Layout, frame_model
from aframe_env.rfem.modes import frame_modes
from aframe_env.rfem.reference import natural_frequencies, second_order_cases, static_cases
from aframe_env.rfem.statics import LoadCase, static
from aframe_env.rfem.straight_beam import End, bending_frequencies
from aframe_env.rfem.structure import Division
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.cross_sections import Material, reference_leg_section
from train.verify.closed_forms import exact_frequencies
from train.verify.report import Check, Row

CASES = {
    "G": LoadCase(),
    "V": LoadCase(own_weight=False, forces={"S": (0.0, 0.0, -981e3)}),
    "L1": LoadCase(rope_tension=981e3),
}
"""The load cases of the reference data."""

BEAM_ERRORS: dict[tuple[End, End], dict[int, tuple[float, float, float]]] = {
    ("pinned", "pinned"): {
        5: (-0.03, -0.48, -2.1),
        10: (-0.01, -0.11, -0.57),
        20: (-0.00, -0.03, -0.15),
        40: (-0.00, -0.01, -0.04),
    },
    ("clamped", "free"): {
        5: (0.89, 2.5, 2.3),
        10: (0.22, 0.62, 0.53),
        20: (0.055, 0.15, 0.13),
        40: (0.014, 0.038, 0.033),
    },
}
"""Errors of the first three bending frequencies that are not to be exceeded, %, as rounded."""

DETERMINATE = ("R_AR_D.0", "R_AR_D.2", "R_AL_D.0", "R_AL_D.2", "S_R_tension", "S_L_tension")
"""Reactions that equilibrium alone gives."""


def straight_member() -> Member:
    """The box of the reference crane, 10 m long, bending about its strong axis."""
    return Member(
        name="beam",
        start=np.zeros(3),
        end=np.array([0.0, 0.0, 10.0]),
        out_of_plane=np.array([1.0, 0.0, 0.0]),
        section=reference_leg_section(),
        material=Material(),
    )


def order(coarse: float, fine: float, ratio: float = 2.0) -> float:
    """Order of convergence from two errors, the finer with ``ratio`` times the elements."""
    return math.log(abs(coarse / fine)) / math.log(ratio)


def flat(case: dict[str, Any]) -> dict[str, float]:
    """A static case as one flat table, e.g. ``R_AR_D.0``, ``sec_before_S.My``."""
    table: dict[str, float] = {}
    for key, value in case.items():
        if isinstance(value, dict):
            table |= {f"{key}.{name}": float(item) for name, item in value.items()}
        elif isinstance(value, list):
            table |= {f"{key}.{index}": float(item) for index, item in enumerate(value)}
        else:
            table[key] = float(value)
    return table


def vector_error(case: dict[str, Any], reference: dict[str, Any], keys: tuple[str, ...]) -> float:
    """Largest distance of a vector from its reference over the reference's length."""
    errors = []
    for key in keys:
        value, target = (np.array(list(item[key])) for item in (case, reference))
        errors.append(float(np.linalg.norm(value - target) / np.linalg.norm(target)))
    return max(errors)


def moment_error(case: dict[str, Any], reference: dict[str, Any]) -> float:
    """Largest error of a bending moment at N, B or S over that point's resultant moment or 1 % of the
    largest."""
    points = [key for key in reference if key.startswith("sec_")]
    moments = {key: np.array([reference[key]["My"], reference[key]["Mz"]]) for key in points}
    largest = max(float(np.linalg.norm(value)) for value in moments.values())
    errors = []
    for key, target in moments.items():
        value = np.array([case[key]["My"], case[key]["Mz"]])
        errors.append(float(np.linalg.norm(value - target) / max(float(np.linalg.norm(target)), 0.01 * largest)))
    return max(errors)


def model(leg: int, beam: int, *, corrected_shear: bool = True, layout: Layout = "one_chain") -> FrameModel:
    """The reference frame."""
    division = Division(leg=leg, beam=beam)
    return frame_model(Crane().frame, division, corrected_shear=corrected_shear, layout=layout)


def beam_frequencies() -> Check:
    """Check the straight beam against Timoshenko's closed forms."""
    member, rows, passed, slowest = straight_member(), [], True, math.inf
    for ends, table in BEAM_ERRORS.items():
        exact = exact_frequencies(member, ends, 3)
        errors = {
            n: (bending_frequencies(member, n, ends, corrected_shear=False)[:3] / exact - 1.0) * 100.0 for n in table
        }
        for n, allowed in table.items():
            for mode in range(3):
                text = f"{allowed[mode]:g}"
                digits = len(text.partition(".")[2])
                rounding = 0.5 * 10.0 ** -(max(digits, 2) if abs(allowed[mode]) < 0.1 else digits)
                passed &= bool(abs(errors[n][mode]) <= abs(allowed[mode]) + rounding)
            rows.append(
                Row(
                    quantity=f"{ends[0]}–{ends[1]}, n = {n}: errors of f1, f2, f3",
                    measured=", ".join(f"{value:.3f}" for value in errors[n]) + " %",
                    reference=", ".join(f"{value:g}" for value in allowed) + " %",
                    error="",
                )
            )
        slowest = min(slowest, *(order(errors[20][mode], errors[40][mode]) for mode in range(3)))
    return Check(
        name="straight beam of the paper's elements, first three bending frequencies",
        bar="errors not above the table's; second order",
        measured=f"as the table; order {slowest:.3f} at least",
        passed=passed and slowest > 1.9,
        rows=rows,
    )


def determinate_reactions() -> Check:
    """Check the statically determinate reactions at 5/2 and 20/16."""
    worst = 0.0
    for division in ((5, 2), (20, 16)):
        for name, case in CASES.items():
            here = flat(static(Crane(), case, model=model(*division)).reference_case())
            target = flat(static_cases()[name])
            worst = max(worst, *(abs(here[key] / target[key] - 1.0) for key in DETERMINATE))
    return Check(
        name="static frame: determinate reactions and servomotor forces",
        bar="1e-6 relative",
        measured=f"{worst:.1e} (the reference has nine digits)",
        passed=worst <= 1e-6,
    )


def static_errors(frame: FrameModel, name: str) -> dict[str, float]:
    """Relative errors of a load case against the finite-element program."""
    here, target = static(Crane(), CASES[name], model=frame).reference_case(), static_cases()[name]
    return {
        "deflection of S": vector_error(here, target, ("u_S_D",)),
        "deflection of S, worst component": max(
            abs(flat(here)[key] / flat(target)[key] - 1.0) for key in ("u_S_D.0", "u_S_D.2")
        ),
        "rotation of corners and S": vector_error(here, target, ("rot_S_D", "rot_BR_D", "rot_BL_D")),
        "moments at N, B, S": moment_error(here, target),
        "reactions": vector_error(here, target, ("R_AR_D", "R_AL_D")),
    }


def static_frame() -> list[Check]:
    """Check deflections, rotations and moments at 20/16, their order, and the corrected elements at 5/2."""
    checks = []
    for title, bar, limit, frame in (
        (
            "static frame of the paper's elements, 20/16 rfes",
            "≤ 0.5 % of the finite-element figure",
            5e-3,
            model(20, 16, corrected_shear=False),
        ),
        ("static frame at 5/2 rfes", "≤ 0.1 %", 1e-3, model(5, 2)),
    ):
        rows, worst = [], 0.0
        for name, case in CASES.items():
            errors = static_errors(frame, name)
            worst = max(worst, *errors.values())
            result, target = static(Crane(), case, model=frame).reference_case(), static_cases()[name]
            here, there = flat(result), flat(target)
            for key in ("u_S_D.0", "u_S_D.2", "rot_BR_D.0", "rot_BR_D.1", "rot_BR_D.2", "R_AR_D.1"):
                rows.append(_row(f"{name}: {key}", here[key], there[key]))
            for key in ("sec_before_NR.My", "sec_before_BR.Mz", "sec_before_S.My", "sec_before_S.Mz"):
                rows.append(_row(f"{name}: {key}", here[key], there[key]))
            rows += [
                Row(quantity=f"{name}: worst of {key}", measured="", reference="", error=f"{value:.4%}")
                for key, value in errors.items()
            ]
        checks.append(Check(name=title, bar=bar, measured=f"{worst:.3%} at worst", passed=worst <= limit, rows=rows))
    return [*checks, _static_order()]


def _row(name: str, here: float, there: float) -> Row:
    error = f"{here / there - 1.0:.4%}" if abs(there) > 1e-6 else ""
    return Row(quantity=name, measured=f"{here:.7g}", reference=f"{there:.7g}", error=error)


def _static_order() -> Check:
    reference = np.array(static_cases()["V"]["u_S_D"])
    rows, errors = [], []
    for division in ((5, 4), (10, 8), (20, 16), (40, 32)):
        here = static(Crane(), CASES["V"], model=model(*division, corrected_shear=False)).displacement["S"]
        errors.append((here - reference)[[0, 2]] / reference[[0, 2]])
        rows.append(
            Row(
                quantity=f"V, {division[0]}/{division[1]}: u_S x, z",
                measured=f"{here[0] * 1e3:.4f}, {here[2] * 1e3:.4f} mm",
                reference=f"{reference[0] * 1e3:.4f}, {reference[2] * 1e3:.4f} mm",
                error=f"{errors[-1][0]:.3%}, {errors[-1][1]:.3%}",
            )
        )
    orders = [order(a[k], b[k]) for a, b in pairwise(errors) for k in range(2)]
    equal = model(20, 20, corrected_shear=False)
    twin = static(Crane(), CASES["V"], model=equal).displacement["S"][0] * 1e3
    rows.append(_row("V, 20/20: u_S x, mm, against program B's equal mesh", float(twin), 24.7184))
    return Check(
        name="static frame of the paper's elements: convergence",
        bar="second order; program B's 24.7184 mm at its mesh of 20",
        measured=f"order {min(orders):.2f} … {max(orders):.2f}; {twin:.4f} mm",
        passed=min(orders) > 1.9 and abs(twin - 24.7184) < 6e-5,
        rows=rows,
    )


def second_order() -> Check:
    """Check sway, deflection and servomotors of second order against geometrically exact beams."""
    rows, worst = [], 0.0
    for target in second_order_cases():
        forces = {"S": (0.0, target["side_force"], 0.0)}
        case = LoadCase(rope_tension=981e3, forces=forces, second_order=True, rope_follows=target["rope_follows"])
        result = static(Crane(), case, model=model(20, 16))
        linear = static(Crane(), LoadCase(rope_tension=981e3, forces=forces), model=model(20, 16))
        for index, axis in enumerate("xyz"):
            there = target["u_S_D"][index]
            if there:
                here = float(result.displacement["S"][index])
                worst = max(worst, abs(here / there - 1.0))
                rows.append(_row(f"{target['name']}: u_S {axis}, mm", here * 1e3, there * 1e3))
                rows.append(_row("linear", float(linear.displacement["S"][index]) * 1e3, there * 1e3))
        for side, there in zip("RL", target["servomotors"], strict=True):
            worst = max(worst, abs(result.servomotor_tension[side] / there - 1.0))
            rows.append(_row(f"{target['name']}: S_{side}, kN", result.servomotor_tension[side] / 1e3, there / 1e3))
            rows.append(_row("linear", linear.servomotor_tension[side] / 1e3, there / 1e3))
    return Check(
        name="static frame of second order, 20/16 rfes",
        bar="sway, deflection, servomotors ≤ 0.5 % of geometrically exact beams",
        measured=f"{worst:.3%} at worst",
        passed=worst <= 5e-3,
        rows=rows,
    )


def natural_modes() -> list[Check]:
    """Check the first ten natural frequencies at 20/16."""
    reference, checks = natural_frequencies(), []
    for title, corrected, bar in (("of the paper's elements, ", False, 2.5e-3), ("", True, 1e-3)):
        here: Array = frame_modes(Crane(), 10, model=model(20, 16, corrected_shear=corrected)).frequency
        errors = here / reference - 1.0
        worst = float(np.max(np.abs(errors)))
        checks.append(
            Check(
                name=f"first ten natural frequencies {title}20/16 rfes",
                bar=f"≤ {bar * 100:g} %",
                measured=f"{worst:.3%} at worst",
                passed=worst <= bar,
                rows=[
                    Row(quantity=f"f{k + 1}, Hz", measured=f"{a:.4f}", reference=f"{b:.4f}", error=f"{e:.3%}")
                    for k, (a, b, e) in enumerate(zip(here, reference, errors, strict=True))
                ],
            )
        )
    return checks


def previous_model() -> Check:
    """Check one chain against three beams: same results, fewer unknowns."""
    rows, gap, seconds = [], 0.0, {}
    layouts: tuple[Layout, ...] = ("one_chain", "three_beams")
    for division in ((10, 8), (20, 16)):
        results, counts, frequencies = {}, {}, {}
        for layout in layouts:
            begin = time.perf_counter()
            frame = model(*division, layout=layout)
            results[layout] = flat(static(Crane(), CASES["L1"], model=frame).reference_case())
            frequencies[layout] = frame_modes(Crane(), 10, model=frame).frequency
            seconds[layout] = time.perf_counter() - begin
            counts[layout] = frame.unknowns
        one, three = results["one_chain"], results["three_beams"]
        scale = {key: max(abs(value), 1e-5 if key.startswith(("u_", "rot")) else 1e3) for key, value in one.items()}
        gap = max(gap, *(abs(one[key] - three[key]) / scale[key] for key in one))
        ratio = frequencies["one_chain"] / frequencies["three_beams"] - 1.0
        gap = max(gap, float(np.max(np.abs(ratio))))
        for key in ("n_q", "n_R", "free coordinates"):
            rows.append(
                Row(
                    quantity=f"{division[0]}/{division[1]}: {key}",
                    measured=f"{counts['one_chain'][key]} (one chain)",
                    reference=f"{counts['three_beams'][key]} (three beams)",
                    error="",
                )
            )
        rows.append(
            Row(
                quantity=f"{division[0]}/{division[1]}: statics and modes, s",
                measured=f"{seconds['one_chain']:.3f}",
                reference=f"{seconds['three_beams']:.3f}",
                error="",
            )
        )
    return Check(
        name="previous model (three beams)",
        bar="same results",
        measured=f"largest relative gap {gap:.1e}",
        passed=gap < 1e-6,
        rows=rows,
    )
