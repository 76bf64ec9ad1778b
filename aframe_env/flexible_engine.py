"""The engine of the full model: rows of ``Engine``, each with a flexible frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.dynamics.flexible.readout import READOUTS, readout_kernel
from aframe_env.dynamics.flexible.step import flexible_kernels
from aframe_env.dynamics.start import inner_steps, longest_inner_step
from aframe_env.engine import Engine, FloatArray, Timing
from aframe_env.rfem.luffed import grid_angles
from aframe_env.rfem.reduction import STATIC_SHAPES, SWING_SHAPES, modal_frame
from aframe_env.rfem.structure import Division
from aframe_env.rfem.tables import passage, readout_table, step_table
from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Frame
from aframe_env.scenario.motion import Components
from aframe_env.validation import InvalidValue, require_integer, shown

FLEXIBLE_STEPS: Final = (0.005, 0.0125)
"""Longest inner step, s, with many modes and with few."""
MODE_PHASE: Final = 3.8
"""Most that the highest natural mode turns in one between these two, rad. What a sudden start does to the frame is then
within 1 % (reactions, deflections) with the default number of modes, and as good as with any step with fewer."""
FRAME_DIVISION: Final = Division(leg=60, beam=50)
"""Default division of the frame."""
FRAME_MODES: Final = 16
"""Default number of natural modes, up to some 120 Hz in the reference crane; static shapes stand for the rest."""
ROPE_PHASE: Final = 0.25
"""Most that the load's bobbing on a light rope turns in one inner step, rad; the scheme is stable up to some 2.4."""
MOST_RFES: Final = 100
"""Most elements of a member: the modes of a finer frame take too long to find."""


@dataclass(frozen=True)
class Mesh:
    """Division of the frame, and the number of modes that are kept."""

    division: Division
    modes: int | None = None
    """None for all."""

    @property
    def room(self) -> int:
        """Most modal coordinates that a frame can have."""
        free = 6 * (2 * self.division.leg + self.division.beam + 1) - 6
        return free if self.modes is None else min(free, self.modes + STATIC_SHAPES + SWING_SHAPES)


def mesh_of(model: str, rfes: Sequence[int] | None, modes: int | None) -> Mesh | None:
    """Mesh that an environment's arguments ask for; None for the simplified model, which takes none of them."""
    if model != "rfem":
        for name, value in (("rfes", rfes), ("rfem_modes", modes)):
            if value is not None:
                raise InvalidValue(f'{name} = {shown(value)}: only with model="rfem"')
        return None
    if modes is not None:
        require_integer("rfem_modes", modes, low=1, high=10_000)
    modes = FRAME_MODES if modes is None else modes
    if rfes is None:
        return Mesh(FRAME_DIVISION, modes)
    if not isinstance(rfes, tuple) or len(rfes) != 2:
        raise InvalidValue(
            f"rfes = {shown(rfes)}: must be a tuple of two integers, the elements of a leg and of the beam"
        )
    require_integer("rfes (leg)", rfes[0], low=1, high=MOST_RFES)
    require_integer("rfes (beam)", rfes[1], low=2, high=MOST_RFES)
    if rfes[1] % 2:
        raise InvalidValue(f"rfes = {shown(rfes)}: the beam's number must be even, for S to lie on its middle rfe")
    return Mesh(Division(leg=rfes[0], beam=rfes[1]), modes)


def longest_rope_step(scenario: Scenario) -> float:
    """Longest inner step that a scenario's rope allows, s; a heavy one is stepped as in the simplified model."""
    if scenario.is_light:
        return ROPE_PHASE / scenario.rope_frequency
    return min(
        scenario.chain_step,
        scenario.attached_step,
        longest_inner_step(scenario.rope_frequency, scenario.rope_damping_rate),
    )


class FlexibleEngine(Engine):
    """Rows of the full model side by side, each with its own scenario; frames may differ from row to row."""

    def __init__(
        self,
        rows: int,
        control_period: float,
        mesh: Mesh,
        components: int = 32,
        max_inner_step: float | None = None,
    ) -> None:
        """Arguments as for ``Engine``, and the mesh. A stiff rope shortens ``max_inner_step`` too."""
        self.mesh = mesh
        self._slots = flex.slots(mesh.room)
        self._lines: dict[tuple[Frame, float, bool], int] = {}
        self._steps: dict[Frame, float] = {}
        self._tables, self._readout_tables = np.zeros((0, 0)), np.zeros((0, 0))
        super().__init__(rows, control_period, components, max_inner_step)
        self._flexible_kernels = flexible_kernels(self._lanes)
        readout = readout_kernel(self._lanes)
        self._readout = readout if rows > at.LANES else readout.serial

    def read_frames(self) -> FloatArray:
        """Deflection of S, reactions, servomotor tensions, utilisation, rotation of all rows: (rows, READOUTS)."""
        result = np.zeros((self.rows, READOUTS))
        self._readout(self._frames, self._readout_tables, result)
        return result

    @property
    def frames(self) -> FloatArray:
        """The frames' array, (blocks, slots * lanes); see ``dynamics.flexible.layout``."""
        return self._frames

    def row_vector(self, scenario: Scenario) -> FloatArray:
        """Slots of a row at the start of a scenario, the frame's first: (frame slots + slots,)."""
        if scenario.luffing is not None:
            scenario.luffing.require_rigid_servomotors(scenario.crane.frame)
        row = super().row_vector(scenario)
        frame = np.zeros(self._slots)
        frame[flex.FRAME] = self._line(scenario)
        frame[flex.DRUM : flex.DRUM + 3] = scenario.crane.drum_position
        frame[flex.PULLEY : flex.PULLEY + 3] = scenario.crane.pulley_position
        frame[flex.LEAN] = 1.0
        comoving = float(scenario.initial == "comoving")
        flexible_kernels(1, heavy=not scenario.is_light).start(row[None], frame[None], self._tables, comoving)
        return np.concatenate([frame, row])

    def _node_segments(self, scenario: Scenario, components: Components, times: Timing) -> int:
        """One: the frame feels the deck's acceleration, which the quintics give less exactly than its place."""
        return 1

    def write_row(self, index: int, vector: FloatArray) -> None:
        """Overwrite a row with a vector that ``row_vector`` or ``copy_row`` gave."""
        block, lane = divmod(index, self._lanes)
        self._frame_view[block, :, lane] = vector[: self._slots]
        super().write_row(index, vector[self._slots :])
        if vector[self._slots + at.SPRINGS] > 0.0:
            self._flexible_kernels = flexible_kernels(self._lanes, heavy=True)

    def copy_row(self, index: int) -> FloatArray:
        """Return everything the engine knows of a row: (frame slots + slots,)."""
        block, lane = divmod(index, self._lanes)
        return np.concatenate([self._frame_view[block, :, lane], super().copy_row(index)])

    @property
    def _frame_view(self) -> FloatArray:
        return self._frames.reshape(len(self._frames), -1, self._lanes)

    def _slots_of_row(self, components: int) -> int:
        return super()._slots_of_row(components) + self._slots

    def _fill(self, vector: FloatArray) -> None:
        self._frames = np.zeros((len(self._blocks), self._slots * self._lanes))
        self._frame_view[...] = vector[None, : self._slots, None]
        super()._fill(vector[self._slots :])

    def _advance(self) -> None:
        kernels = self._flexible_kernels
        step = kernels.step if self.rows <= at.LANES else kernels.step_parallel
        step(self._blocks, self._frames, self._tables, self._components, self._segments, self._records.lines)

    def _adopt(self, vector: FloatArray, scenario: Scenario) -> FloatArray:
        adopted = np.concatenate([vector[: self._slots], super()._adopt(vector[self._slots :], scenario)])
        x, _, z = vector[flex.PULLEY : flex.PULLEY + 3]
        adopted[flex.FRAME] = self._line(scenario, math.atan2(x, z))
        return adopted

    def _timing(self, scenario: Scenario) -> Timing:
        segment = self.control_period / self._segments
        longest = self._max_inner_step or self._frame_step(scenario.crane.frame)
        # Halved rather than fitted, so that a distribution of ropes needs few tables.
        while longest > longest_rope_step(scenario):
            longest *= 0.5
        return Timing(self._segments, segment, inner_steps(segment, longest))

    def _frame_step(self, frame: Frame) -> float:
        """Longest inner step that a frame's modes allow, s."""
        if frame not in self._steps:
            modal = modal_frame(frame, self.mesh.division, self.mesh.modes)
            highest = np.sqrt(modal.square[modal.natural - 1])
            self._steps[frame] = float(np.clip(MODE_PHASE / highest, *FLEXIBLE_STEPS))
        return self._steps[frame]

    def _line(self, scenario: Scenario, angle: float | None = None) -> int:
        """Line of a scenario's frame in the tables, which it is added to when new.

        ``angle``: that for which a frame that luffs is to have it, rad; None for that of its start.
        """
        frame, step = scenario.crane.frame, self._timing(scenario).inner_step
        if scenario.luffing is None or scenario.luffing.holds:
            return self._line_of(frame, step, False)
        start, grid = frame.luffing_angle, grid_angles(scenario.luffing)
        angles = sorted({*grid, start})
        lines: dict[float, int] = {}
        for place, each in enumerate(angles):
            lines[each] = self._line_of(replace(frame, luffing_angle=each), step, True)
            # A row goes from the first angle to the grid, and does not come back to it.
            for other in angles[max(place - 2, 0) : place]:
                if not any(other < between < each for between in grid):
                    self._join(lines, 0, replace(frame, luffing_angle=other), each, grid)
                    self._join(lines, 1, replace(frame, luffing_angle=each), other, grid)
        wanted = start if angle is None else angle
        return lines[min(lines, key=lambda each: abs(each - wanted))]

    def _join(self, lines: dict[float, int], way: int, here: Frame, there: float, grid: list[float]) -> None:
        """Tell the line of a frame that luffs its neighbour up (``way`` 0) or down (1), ``there`` in rad."""
        if there not in grid:
            return
        table = self._tables[lines[here.luffing_angle]]
        first = int(table[flex.SWING])
        if table[first + flex.NEIGHBOUR + way] < 0.0:
            table[first + flex.NEIGHBOUR + way] = lines[there]
            table[first + flex.HALFWAY + way] = math.sin(0.5 * abs(there - here.luffing_angle))
            matrix = passage(here, there, self.mesh.division, self.mesh.modes, table[flex.STEP]).ravel()
            begin = int(table[first + flex.PASSAGE + way])
            table[begin : begin + matrix.size] = matrix

    def _line_of(self, frame: Frame, step: float, luffs: bool) -> int:
        """Line of a frame at its luffing angle, for inner steps of ``step`` s."""
        key = frame, step, luffs
        if key not in self._lines:
            mesh = self.mesh
            self._tables = _with_line(self._tables, step_table(frame, mesh.division, mesh.modes, step, luffs))
            readout = readout_table(frame, mesh.division, mesh.modes, step if luffs else None)
            self._readout_tables = _with_line(self._readout_tables, readout)
            self._lines[key] = len(self._tables) - 1
        return self._lines[key]


def _with_line(table: FloatArray, line: FloatArray) -> FloatArray:
    """Add a line to a table, the shorter ones filled up with zeros."""
    longer = np.zeros((len(table) + 1, max(table.shape[1], line.size)))
    longer[:-1, : table.shape[1]] = table
    longer[-1, : line.size] = line
    return longer
