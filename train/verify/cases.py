"""Load cases, releases and dynamic runs from TOML files, and their results as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aframe_env.rfem.history import FrameHistory
from aframe_env.rfem.model import FrameModel, frame_model
from aframe_env.rfem.release import release
from aframe_env.rfem.simulate import DynamicCase, DynamicResult, simulate
from aframe_env.rfem.statics import LOADED_POINTS, LoadCase, static
from aframe_env.rfem.structure import Division
from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Crane, Frame
from aframe_env.scenario.cross_sections import Servomotor
from aframe_env.scenario.file import scenario_of
from aframe_env.validation import InvalidValue, require_choice, require_number, shown

FORMAT = """\
Files are TOML, SI units. Keys of every kind of file (all optional):

  rfes = [120, 100]            primary elements of a leg and of the top beam (the beam's even)
  layout = "one_chain"         or "three_beams", the paper's previous model
  corrected_shear = true       static deflections exact at any number of elements, and a mass that is
                               consistent with them; false: the paper's elements

--load-case and --release, the crane:
  servomotors = "rigid"        or "elastic", then also
  servomotor_stiffness = 3e8   N/m, each
  servomotor_damping = 0.0     N s/m, each, elastic only
  [frame]                      half_width, height, servomotor_height, servomotor_deck_x (m),
                               luffing_angle (rad)

--load-case, static:
  own_weight = true            own weight of legs and beam
  rope_tension = 0.0           N, at S along both rope legs: down to the load, and to the drum
  second_order = false         true: what is of second order in the displacements too (P-Delta)
  rope_follows = false         true: the rope to the drum turns as S moves; with second_order only
  [forces]                     N, in {D}: x outboard, z up
  S = [0.0, 0.0, -981000.0]    and N_R, N_L, B_R, B_L

--release: the keys of --load-case say what loads the frame before; its forces and rope tension go,
its own weight stays; undamped:
  ramp = 0.1                   s, half a cosine; 0 (default) releases at once
  duration = 2.0               s
  output_interval = 0.005      s
  step = 0.0001                s

--dynamic, the load on the rope, the ship moving, the drum still, the frame luffing if asked for:
  duration = 60.0              s
  output_interval = 0.05       s
  step = 0.0025                s
  second_order = false         true: the frame with the geometric stiffness (P-Delta) of its state at rest,
                               of a frame that luffs at each angle of its modes
                               and the keys of a scenario file, among them
  load_mass = 100000.0         kg
  target_level = -300.0        m, h: the load's height at rest with the frame rigid
  initial = "comoving"         or "rest"
  rope_damping = 0.0           N s/m, d_R
  ramp = 0.0                   s, over which the ship's motion builds up
  gravity = 9.81               m/s²
  [motion]                     without it: motion (42), surge 1 m/6 s and heave 2 m/12 s
  kind = "harmonic"            or "sea", or "recorded" with file = "x.csv"
  [[motion.harmonics]]         one table a harmonic, amplitude sin(2 pi t/period + phase)
  coordinate = "heave"         surge, sway, heave (m), roll, pitch, yaw (rad)
  amplitude = 2.0
  period = 12.0                s
  phase = 0.0                  rad
  [crane.frame]                half_width, height, servomotor_height, servomotor_deck_x (m),
                               luffing_angle (rad)
  [crane.frame.structure.servomotor]
  stiffness = 3e8              N/m, each; without it: rigid
  damping = 0.0                N s/m, each
  [luffing]                    a frame that luffs on rigid servomotors; without it, it holds
  points = [[1, 25.0], [21, -20.0]]
                               s and degrees, the first those of luffing_angle; max_speed, max_acceleration
"""

FINE = Division(leg=120, beam=100)
"""The default division: elements of 0.1 m in the reference crane."""

_MODEL = {"rfes", "layout", "corrected_shear"}
_RUN = {"duration", "output_interval", "step"}
_DYNAMIC = _RUN | {"second_order"}
_CRANE = {"servomotors", "servomotor_stiffness", "servomotor_damping", "frame"}
_STATIC = {"own_weight", "rope_tension", "forces"}
_SECOND_ORDER = {"second_order", "rope_follows"}


def _only(data: Mapping[str, Any], allowed: set[str], where: str = "") -> None:
    for key in data:
        if key not in allowed:
            raise InvalidValue(f"{where}{key}: unknown key; must be one of {', '.join(sorted(allowed))}")


def _flag(data: Mapping[str, Any], name: str, default: bool) -> bool:
    value = data.get(name, default)
    if not isinstance(value, bool):
        raise InvalidValue(f"{name} = {shown(value)}: must be true or false")
    return value


def _number(data: Mapping[str, Any], name: str, default: float, unit: str, low: float, low_open: bool = False) -> float:
    value = data.get(name, default)
    require_number(name, value, unit, low=low, low_open=low_open)
    return float(value)


def _table(data: Mapping[str, Any], name: str) -> dict[str, Any]:
    value = data.get(name, {})
    if not isinstance(value, dict):
        raise InvalidValue(f"{name} = {shown(value)}: must be a table, [{name}]")
    return value


def crane_of(data: Mapping[str, Any]) -> Crane:
    """The reference crane with the file's changes of frame and servomotors."""
    given = _table(data, "frame")
    allowed = {item.name for item in fields(Frame)} - {"structure"}
    _only(given, allowed, "frame.")
    frame = Frame(**given)
    kind = data.get("servomotors", "rigid")
    require_choice("servomotors", kind, ("rigid", "elastic"))
    if kind == "elastic" and "servomotor_stiffness" not in data:
        raise InvalidValue('servomotor_stiffness: needed with servomotors = "elastic", in (0, inf) N/m')
    if kind == "rigid" and ("servomotor_stiffness" in data or "servomotor_damping" in data):
        raise InvalidValue('servomotor_stiffness, servomotor_damping: only with servomotors = "elastic"')
    if kind == "elastic":
        require_number("servomotor_stiffness", data["servomotor_stiffness"], "N/m", low=0.0, low_open=True)
        servomotor = Servomotor(
            stiffness=float(data["servomotor_stiffness"]),
            damping=_number(data, "servomotor_damping", 0.0, "N s/m", low=0.0),
        )
        frame = replace(frame, structure=replace(frame.structure, servomotor=servomotor))
    return Crane(frame=frame)


def model_of(data: Mapping[str, Any], crane: Crane) -> FrameModel:
    """Frame model with the file's division."""
    rfes = data.get("rfes", [FINE.leg, FINE.beam])
    if not isinstance(rfes, list) or len(rfes) != 2:
        raise InvalidValue(f"rfes = {shown(rfes)}: must be two integers, [elements of a leg, elements of the beam]")
    layout = data.get("layout", "one_chain")
    return frame_model(
        crane.frame,
        Division(leg=rfes[0], beam=rfes[1]),
        layout=layout,
        corrected_shear=_flag(data, "corrected_shear", True),
    )


def _load_case(data: Mapping[str, Any]) -> LoadCase:
    forces = _table(data, "forces")
    _only(forces, set(LOADED_POINTS), "forces.")
    return LoadCase(
        own_weight=_flag(data, "own_weight", True),
        forces={name: tuple(value) if isinstance(value, list) else value for name, value in forces.items()},
        rope_tension=_number(data, "rope_tension", 0.0, "N", low=0.0),
        **{name: _flag(data, name, False) for name in sorted(_SECOND_ORDER)},
    )


def static_case(data: Mapping[str, Any]) -> dict[str, object]:
    """Solve a static case: the keys of the reference data's cases, and the section forces along the frame."""
    _only(data, _MODEL | _CRANE | _STATIC | _SECOND_ORDER)
    crane = crane_of(data)
    result = static(crane, _load_case(data), model=model_of(data, crane))
    report = result.reference_case()
    report["units"] = "N, m, rad, N m, Pa; deck frame D"
    report["along"] = [
        {
            "member": station.member,
            "s_m": station.along,
            **dict(zip(("N", "Vy", "Vz", "T", "My", "Mz"), map(float, station.forces), strict=True)),
            "von_mises_Pa": station.von_mises,
        }
        for station in result.along(per_member=25)
    ]
    return report


def columns_of(history: FrameHistory) -> dict[str, npt.NDArray[np.float64]]:
    """Deflection of S, servomotor tensions and reactions with the column names of the reference data."""
    deflection, servomotors, feet = history.displacement("S"), history.servomotors(), history.feet()
    columns = {"t_s": history.time}
    columns |= {f"uS{axis + 1}_m": deflection[:, axis] for axis in range(3)}
    columns |= {f"S_{side}_N": servomotors[:, index] for index, side in enumerate("RL")}
    for index, side in enumerate("RL"):
        columns |= {f"RA{side}{axis + 1}_N": feet[:, index, axis] for axis in range(3)}
    return columns


def dynamic_columns(result: DynamicResult) -> dict[str, npt.NDArray[np.float64]]:
    """Columns of load and rope, and :func:`columns_of` the frame; of one that luffs its angle and the power for it."""
    columns = {f"xL{axis + 1}_m": result.load[:, axis] for axis in range(3)}
    columns |= {f"vL{axis + 1}": result.load_velocity[:, axis] for axis in range(3)}
    columns |= {"T_rope_N": result.tension} | columns_of(result.frame)
    luffed = result.frame.luffed
    if luffed is None:
        return columns
    return columns | {"luffing_rad": luffed.swing.angle, "P_luffing_W": result.frame.luffing_power()}


def release_case(data: Mapping[str, Any]) -> dict[str, object]:
    """Run a release; time series with the column names of the reference data."""
    _only(data, _MODEL | _CRANE | _STATIC | _RUN | {"ramp"})
    crane = crane_of(data)
    history = release(
        crane,
        _load_case(data),
        ramp=_number(data, "ramp", 0.0, "s", low=0.0),
        duration=_number(data, "duration", 2.0, "s", low=0.0, low_open=True),
        step=_number(data, "step", 1e-4, "s", low=0.0, low_open=True),
        output_interval=_number(data, "output_interval", 5e-3, "s", low=0.0, low_open=True),
        model=model_of(data, crane),
    )
    return {name: column.tolist() for name, column in columns_of(history).items()}


def dynamic_case(data: Mapping[str, Any], folder: Path = Path()) -> dict[str, object]:
    """Run a dynamic case; time series with the column names of the reference data.

    Args:
        data: The file's contents.
        folder: Folder of the files that it names.
    """
    keys = {item.name for item in fields(Scenario)}
    _only(data, _MODEL | _DYNAMIC | keys)
    scenario = scenario_of({name: value for name, value in data.items() if name in keys}, folder, "scenario")
    _flag(data, "second_order", False)
    case = DynamicCase(scenario=scenario, **{name: data[name] for name in _DYNAMIC if name in data})
    result = simulate(case, model=model_of(data, scenario.crane))
    return {name: column.tolist() for name, column in dynamic_columns(result).items()}


def without_nan(value: object) -> object:
    """Plain data with None for what is not a finite number, as JSON wants it."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    return [without_nan(item) for item in value] if isinstance(value, list) else value
