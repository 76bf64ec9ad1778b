"""Loads in water on heavy ropes: cases from TOML files, and their histories."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.scenario import Crane, Harmonic, HarmonicMotion, LoadShape, Rope, Scenario, Water, Winch
from aframe_env.scenario.crane import GRAVITY
from aframe_env.serialization import strict_converter, structure
from aframe_env.validation import InvalidValue, require_number

FloatArray = npt.NDArray[np.float64]

FORMAT = """\
--rope-case, a load in water on a heavy rope, the pulley S heaving, the drum still or prescribed; the keys of a case
in aframe_env/data/reference/water/cases.json, SI units:
  L0_unstretched_below_S_m = 1000.0
  beta_s = 0.01                loss time of the rope's material
  duration_s = 120.0
  step_s = 0.005               longest inner step (not in cases.json)
  [load]                       m_kg; V_m3, m_a_kg, CdA_m2 (0)
  [heave]                      t_r_s: build-up, a quintic; harmonics_T_a_phase: [[T, a, phase], ...] for the sum of
                               a cos(2 pi t/T + phase), m and rad
  [pay_out]                    p(t) = gain zeta(t - lag_s) + v_m_s times the integral of a quintic step from t0_s over
                               tv_s; without the table the drum is still
  [common]                     g_m_s2 = 9.81, rho_water_kg_m3 = 1025.0
  [common.rope]                EA_N = 2e8, mu_kg_m = 19.55, d_eq_m = 0.056, C_t = 0.008, breaking_load_N = 1e12
"""
SAMPLE: Final = 0.05
"""Interval of the columns, s."""
COLUMNS: Final = ("t_s", "z_S_m", "l_paid_out_m", "z_load_m", "v_load_m_s", "T_top_N", "T_load_N")
DERIVED: Final[Mapping[str, tuple[str, ...]]] = {
    "": (
        "lambda_D_drum_part_unstretched_m",
        "l0_paid_out_m",
        "EA_beta_Ns",
        "static",
        "range",
        "program",
        "agreement",
        "note",
        "cruder_models_off_by",
        "end_minus_static_at_end_length_mean_last_period_m",
    ),
    "load": ("W_sub_N",),
    "heave": ("kind",),
    "pay_out": ("kind",),
    "common": ("units", "z_S0_m", "d_SH_m", "submergence", "slack", "start", "sampling_Hz", "columns"),
    "rope": ("w_N_m", "area_m2", "k_t_N_s2_m3", "wave_speed_m_s"),
}
"""Keys, by table, that cases.json has beside what a case asks for: they follow from it, or say something of it."""


@dataclass(frozen=True)
class _Load:
    m_kg: float
    V_m3: float = 0.0
    m_a_kg: float = 0.0
    CdA_m2: float = 0.0


@dataclass(frozen=True)
class _Heave:
    t_r_s: float = 0.0
    harmonics_T_a_phase: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True)
class _PayOut:
    gain: float = 0.0
    lag_s: float = 0.0
    v_m_s: float = 0.0
    t0_s: float = 0.0
    tv_s: float = 1.0

    def __post_init__(self) -> None:
        require_number("lag_s", self.lag_s, "s", low=0.0, high=1e4)
        require_number("tv_s", self.tv_s, "s", low=1e-3, high=1e6)


@dataclass(frozen=True)
class _Rope:
    EA_N: float = 2e8
    mu_kg_m: float = 19.55
    d_eq_m: float = 0.056
    C_t: float = 0.008
    breaking_load_N: float = 1e12


@dataclass(frozen=True)
class _Common:
    g_m_s2: float = GRAVITY
    rho_water_kg_m3: float = 1025.0
    rope: _Rope = field(default_factory=_Rope)


@dataclass(frozen=True)
class RopeCase:
    """A case: rope, load, heave of the pulley and what the drum pays out."""

    L0_unstretched_below_S_m: float
    load: _Load
    duration_s: float
    beta_s: float = 0.0
    step_s: float = 0.005
    heave: _Heave = field(default_factory=_Heave)
    pay_out: _PayOut = field(default_factory=_PayOut)
    common: _Common = field(default_factory=_Common)

    def __post_init__(self) -> None:
        require_number("L0_unstretched_below_S_m", self.L0_unstretched_below_S_m, "m", low=1.0, high=1e5)
        require_number("duration_s", self.duration_s, "s", low=SAMPLE, high=1e5)
        require_number("step_s", self.step_s, "s", low=1e-5, high=SAMPLE)
        require_number("m_kg", self.load.m_kg, "kg", low=1e-3, high=1e7)

    def scenario(self) -> Scenario:
        """Return the scenario whose load hangs at rest at the case's length of rope."""
        given, load = self.common.rope, self.load
        rope = Rope(
            axial_stiffness=given.EA_N,
            breaking_load=given.breaking_load_N,
            mass_per_length=given.mu_kg_m,
            solid_diameter=given.d_eq_m,
            tangential_drag=given.C_t,
            loss_time=self.beta_s,
        )
        gravity, water = self.common.g_m_s2, Water(density=self.common.rho_water_kg_m3)
        below, weight = self.L0_unstretched_below_S_m, (load.m_kg - water.density * load.V_m3) * gravity
        own = rope.weight_per_length(gravity, water.density)
        hanging = below + (weight * below + 0.5 * own * below**2) / rope.axial_stiffness
        # The drum is prescribed: its limits are out of the way.
        winch = Winch(min_rope_length=1e-3, max_rope_length=1e5, max_rope_speed=1e3, max_rope_acceleration=1e6)
        crane = Crane(rope=rope, winch=winch)
        heave = (
            Harmonic(coordinate="heave", amplitude=a, period=period, phase=phase + 0.5 * math.pi)
            for period, a, phase in self.heave.harmonics_T_a_phase
        )
        return Scenario(
            crane=crane,
            motion=HarmonicMotion(harmonics=tuple(heave)),
            load_mass=load.m_kg,
            target_level=crane.pulley_position[2] - hanging,
            ramp=self.heave.t_r_s,
            initial="rest",
            gravity=gravity,
            water=water,
            load=LoadShape(
                volume=load.V_m3,
                added_mass_vertical=load.m_a_kg,
                added_mass_horizontal=load.m_a_kg,
                drag_area_vertical=load.CdA_m2,
                drag_area_horizontal=load.CdA_m2,
            ),
        )

    def paid_out(self, times: FloatArray) -> FloatArray:
        """Rope paid out since the start, m, at ``times`` s."""
        law, heave = self.pay_out, self.heave
        t = np.maximum(times - law.lag_s, 0.0)
        s = np.minimum(t / heave.t_r_s, 1.0) if heave.t_r_s else np.ones_like(t)
        zeta = np.zeros_like(t)
        for period, a, phase in heave.harmonics_T_a_phase:
            zeta += a * np.cos(2.0 * np.pi * t / period + phase)
        u = (times - law.t0_s) / law.tv_s
        inside = np.clip(u, 0.0, 1.0)
        lowered = 2.5 * inside**4 - 3.0 * inside**5 + inside**6 + np.maximum(u - 1.0, 0.0)
        build_up = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        return np.asarray(law.gain * build_up * zeta + law.v_m_s * law.tv_s * lowered)

    def run(self) -> dict[str, FloatArray]:
        """Run the case on the simplified model: COLUMNS, every SAMPLE s from the static equilibrium."""
        scenario = self.scenario()
        every = max(1, math.ceil(SAMPLE / self.step_s - 1e-9))
        period, samples = SAMPLE / every, math.floor(self.duration_s / SAMPLE + 1e-9)
        times = period * np.arange(samples * every + 1)
        lengths = self.paid_out(np.asarray(times, dtype=np.float64))
        # Between these times the drum's speed is linear, as the prescribed one is but for O(period²).
        speeds = np.gradient(lengths, period, edge_order=2) / scenario.crane.winch.drum_radius
        engine = Engine(1, period)
        engine.reset_row(0, scenario)
        found = np.empty((samples + 1, len(COLUMNS)))
        slots = (at.PULLEY + 2, at.LOAD_POSITION + 2, at.LOAD_VELOCITY + 2, at.TENSION, at.LOAD_TENSION)
        for k, time in enumerate(times):
            if k % every == 0:
                pulley, *rest = (engine.read(slot)[0] for slot in slots)
                found[k // every] = [time, pulley, scenario.free_length + lengths[k], *rest]
            if k + 1 < len(times):
                change = abs(speeds[k + 1] - engine.read(at.DRUM_SPEED)[0])
                engine.blocks[0, at.MAX_ACCELERATION] = max(change / period, 1e-9)
                engine.step(speeds[k + 1 : k + 2])
        return dict(zip(COLUMNS, found.T, strict=True))


def rope_case(data: Mapping[str, Any], source: str) -> RopeCase:
    """Make a case of what a file says. Raises ``InvalidValue`` that names ``source`` and the key of what is wrong."""
    crane = Crane()
    for key, own in (("z_S0_m", crane.pulley_position[2]), ("d_SH_m", crane.drum_to_pulley)):
        given = data.get("common", {}).get(key, own) if isinstance(data.get("common"), Mapping) else own
        require_number(f"{source}: [common] {key}", given, "m, the reference crane's", low=own - 1e-6, high=own + 1e-6)
    return structure(strict_converter(), _asked(data, ""), RopeCase, source)


def _asked(table: Mapping[str, Any], name: str) -> dict[str, Any]:
    """What a table of a case asks for, without what cases.json derives from it."""
    return {
        key: _asked(value, key) if isinstance(value, Mapping) else value
        for key, value in table.items()
        if key not in DERIVED.get(name, ())
    }


def run_rope_case(data: Mapping[str, Any], _: Path) -> dict[str, object]:
    """Run a case that a file says: one list a column."""
    columns = rope_case(data, "rope case").run()
    if not all(np.isfinite(column).all() for column in columns.values()):
        raise InvalidValue("rope case: its history is not finite: make step_s smaller")
    return {name: column.tolist() for name, column in columns.items()}
