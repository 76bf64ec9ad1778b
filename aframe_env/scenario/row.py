"""A scenario as the kernels have it: parameters of a row."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.start import write_heavy, write_lift
from aframe_env.scenario.crane import Frame
from aframe_env.scenario.drive import GEAR_CREEP, TorqueDrive
from aframe_env.scenario.luffing import Luffing
from aframe_env.scenario.scenario import Scenario
from aframe_env.scenario.sea import SeaMotion
from aframe_env.scenario.water import Water

FloatArray = npt.NDArray[np.float64]

NO_BED: Final = -1e9
"""Level of the seabed where there is none, m."""


def fill_parameters(row: FloatArray, scenario: Scenario, segment: float, substeps: int) -> None:
    """Write crane, load, rope and all about them; motion segments of ``segment`` s in ``substeps`` inner steps."""
    crane = scenario.crane
    winch, rope = crane.winch, crane.rope
    row[at.GRAVITY] = scenario.gravity
    row[at.AXIAL_STIFFNESS] = rope.axial_stiffness
    row[at.BREAKING_LOAD] = rope.breaking_load
    row[at.DRUM_TO_PULLEY] = crane.drum_to_pulley
    row[at.DRUM_RADIUS] = crane.drum_radius(scenario.free_length)
    row[at.MAX_SPEED] = winch.max_speed
    row[at.MAX_ACCELERATION] = winch.max_acceleration
    row[at.LAG] = winch.lag
    row[at.PULLEY_ON_DECK : at.PULLEY_ON_DECK + 3] = crane.pulley_position
    row[at.DRUM_ON_DECK : at.DRUM_ON_DECK + 3] = crane.drum_position
    row[at.TIP : at.TIP + 3] = crane.pulley_position
    row[at.REACH] = row[at.REACH_PATH] = crane.drum_to_pulley
    row[at.LUFFING_ANGLE] = crane.frame.luffing_angle
    row[at.RAMP_RATE] = 1.0 / scenario.ramp if scenario.ramp else 0.0
    row[at.RAMP_OFFSET] = 0.0 if scenario.ramp else 1.0
    row[at.CONTROL_PERIOD] = segment
    write_lift(
        row,
        1,
        0,
        scenario.load_mass,
        scenario.target_level,
        scenario.total_rope_damping,
        scenario.free_length,
        winch.min_rope_length,
        winch.max_rope_length,
        substeps,
    )
    if not scenario.is_light:
        _fill_beyond_the_paper(row, scenario)


def _fill_beyond_the_paper(row: FloatArray, scenario: Scenario) -> None:
    """Write what a rope with mass, water, a winch with further limits and a target that moves need."""
    crane, load, half_density = scenario.crane, scenario.load, 0.5 * scenario.density
    winch, rope = crane.winch, crane.rope
    write_heavy(
        row,
        1,
        0,
        scenario.springs,
        scenario.lengths[1],
        (
            rope.mass_per_length,
            scenario.rope_weight,
            half_density * rope.tangential_drag * math.pi * rope.solid_diameter,
            scenario.loss_time,
        ),
        (scenario.load_mass + load.added_mass_horizontal, scenario.load_mass + load.added_mass_vertical),
        scenario.weight,
        (half_density * load.drag_area_horizontal, half_density * load.drag_area_vertical),
        half_density * rope.across_drag * rope.outer_diameter,
    )
    row[at.LEVEL] = scenario.target_level
    if scenario.target_path is not None:
        turns = np.array(scenario.target_path.turns)
        row[at.CORNERS], row[at.CORNER_TIME] = len(turns), scenario.target_path.corner_time
        for part in range(2):
            first = at.PROFILE + part * at.PROFILE_MOST
            row[first : first + len(turns)] = turns[:, part]
    if scenario.luffing is not None:
        _fill_luffing(row, scenario.luffing, crane.frame)
    row[at.RATED_ACCELERATION] = winch.max_acceleration
    row[at.MAX_POWER], row[at.MAX_TORQUE], row[at.DRUM_INERTIA] = winch.max_power, winch.max_torque, winch.inertia
    row[at.LAYER : at.LAYER + 4] = *crane.layer, winch.drum_radius, winch.max_rope_length
    row[at.LENGTH_LIMITS : at.LENGTH_LIMITS + 2] = winch.min_rope_length, winch.max_rope_length
    row[at.SHEAVE_FRICTION] = crane.sheave_friction
    if crane.compensator is not None:
        cylinder = crane.compensator
        preload = cylinder.preload or scenario.hanging_weight
        row[at.GAS : at.GAS + 4] = preload, cylinder.gas_length, cylinder.exponent, cylinder.damping
        row[at.HALF_STROKE] = 0.5 * cylinder.stroke
    if winch.drive is not None:
        _fill_drive(row, winch.drive, winch.drum_radius)
    row[at.BED] = NO_BED
    if scenario.water is not None:
        _fill_water(row, scenario, scenario.water)


def _fill_luffing(row: FloatArray, luffing: Luffing, frame: Frame) -> None:
    """Write the way of a frame that luffs."""
    strokes = luffing.strokes(frame)
    row[at.LUFFING_POINTS] = len(strokes)
    for part in range(2):
        first = at.LUFFING + part * at.LUFFING_MOST
        row[first : first + len(strokes)] = [stroke[part] for stroke in strokes]
    row[at.LUFFING_FRAME : at.LUFFING_FRAME + 3] = frame.servomotor_height, frame.servomotor_deck_x, frame.height


def _fill_drive(row: FloatArray, drive: TorqueDrive, radius: float) -> None:
    """Write what turns a drum with inertia."""
    row[at.DRIVE] = drive.inertia
    row[at.GAIN], row[at.INTEGRAL_RATE] = drive.gain, 1.0 / drive.integral_time
    row[at.FEEDFORWARD] = drive.tension_feedforward
    row[at.FILTER_RATE] = 1.0 / drive.tension_filter if drive.tension_filter else 0.0
    row[at.MOTOR : at.MOTOR + 2] = drive.torque, drive.motor_power
    row[at.GEAR : at.GEAR + 3] = *drive.gear, GEAR_CREEP / radius
    row[at.BRAKE] = drive.brake_torque


def _fill_water(row: FloatArray, scenario: Scenario, water: Water) -> None:
    """Write what the water is to a load."""
    load = scenario.load
    current = np.array(water.current).reshape(-1, 3)
    row[at.CURRENT_POINTS] = len(current)
    row[at.CURRENT : at.CURRENT + len(current)] = water.surface_level - current[:, 0]
    for axis in (1, 2):
        first = at.CURRENT + axis * at.CURRENT_MOST
        row[first : first + len(current)] = current[:, axis]
    row[at.SURFACE_LEVEL] = water.surface_level
    row[at.START_SHARE] = scenario.share_under_water
    row[at.DISPLACED] = water.density * load.volume
    row[at.BUOYANCY] = water.density * load.volume * scenario.gravity
    row[at.ADDED_MASS : at.ADDED_MASS + 2] = load.added_mass_horizontal, load.added_mass_vertical
    row[at.HALF_HEIGHT], row[at.INVERSE_HEIGHT] = 0.5 * load.height, 1.0 / load.height if load.height else 0.0
    row[at.SLAM] = 0.5 * water.density * load.slam_area
    row[at.SLAM + 1] = 0.5 * water.density * load.exit_area
    if water.seabed is not None:
        row[at.BED : at.BED + 3] = scenario.bed_level, water.seabed.stiffness, water.seabed.damping


def fill_waves(row: FloatArray, scenario: Scenario, motion: SeaMotion) -> None:
    """Write the waves that move the water about the load: those of the sea under the pulley at rest."""
    x, y, _ = scenario.crane.pulley_position
    elevation, way = motion.waves_under(x, y, scenario.gravity)
    row[at.WAVES] = len(elevation)
    for slot, values in (
        (at.ELEVATION_RE, elevation.real),
        (at.ELEVATION_IM, elevation.imag),
        (at.TOWARDS_X, way[:, 0]),
        (at.TOWARDS_Y, way[:, 1]),
    ):
        row[at.ROW_SLOTS + slot :: at.COMPONENT_SLOTS][: len(values)] = values
