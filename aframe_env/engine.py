"""The engine: many rows of the model, advanced together by one control step at a time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.start import (
    hang_load,
    hang_rope,
    inner_steps,
    longest_inner_step,
)
from aframe_env.dynamics.step import StepKernels, step_kernels
from aframe_env.dynamics.wave_components import component_kernels
from aframe_env.memory import require_memory
from aframe_env.scenario import Scenario
from aframe_env.scenario.motion import Components, Coordinate, ShipMotion, TabledMotion, has_components
from aframe_env.scenario.row import fill_parameters, fill_waves
from aframe_env.scenario.sea import SeaMotion
from aframe_env.validation import InvalidValue, require_integer, require_number

FloatArray = npt.NDArray[np.float64]

MAX_SEGMENT: Final = 0.2
"""Longest stretch of time that one quintic of the pulley's path spans, s."""


@dataclass(frozen=True)
class Timing:
    """Division of a control period."""

    segments: int
    """Motion segments in a control period."""
    segment: float
    """Length of a segment, s."""
    substeps: int
    """Inner steps in a segment."""

    @property
    def inner_step(self) -> float:
        """s."""
        return self.segment / self.substeps


def timing(scenario: Scenario, control_period: float, max_inner_step: float | None = None) -> Timing:
    """Divide a control period [s] for a scenario: the stiffer the rope, the finer the inner step."""
    segments = math.ceil(control_period / MAX_SEGMENT - 1e-9)
    segment = control_period / segments
    longest = max_inner_step or longest_inner_step(scenario.rope_frequency, scenario.rope_damping_rate)
    longest = min(longest, scenario.chain_step, scenario.attached_step)
    return Timing(segments, segment, inner_steps(segment, longest))


class RecordTable:
    """Lines of the recorded motions that rows follow: deck coordinates, rates and accelerations, (lines, 18)."""

    def __init__(self) -> None:
        self.lines = np.zeros((0, 18))
        """Used lines, and free ones in between."""
        self._places: dict[TabledMotion, tuple[int, int]] = {}

    def place(self, motion: TabledMotion, period: float, followed: Callable[[], set[float]]) -> tuple[int, int]:
        """First line and length of a motion on a grid of ``period`` s, which is added to the table when new.

        ``followed`` gives the first lines that rows still follow: what no row follows makes room for what comes.
        """
        if motion in self._places:
            return self._places[motion]
        table = motion.table(period)
        first = self._gap(len(table))
        if first is None:
            live = followed()
            self._places = {each: place for each, place in self._places.items() if place[0] in live}
            first = self._gap(len(table))
        if first is None:
            first = max((begin + length for begin, length in self._places.values()), default=0)
            # Doubled, so that the lines are copied only so often.
            count = max(first + len(table), 2 * len(self.lines))
            require_memory(
                f"{len(self._places) + 1} recorded motions at steps of {period:g} s",
                self.lines.nbytes + count * table[0].nbytes + table.nbytes,
            )
            grown = np.zeros((count, 18))
            grown[: len(self.lines)] = self.lines
            self.lines = grown
        self.lines[first : first + len(table)] = table
        self._places[motion] = first, len(table)
        return self._places[motion]

    def _gap(self, size: int) -> int | None:
        """First line of a gap of ``size`` lines."""
        end = 0
        for begin, length in sorted(self._places.values()):
            if begin - end >= size:
                return end
            end = begin + length
        return end if len(self.lines) - end >= size else None


class Engine:
    """Rows of the simplified model side by side, each with its own scenario.

    A row's history depends on its scenario and its commands alone, to the last bit: not on the other rows, their
    number, or its place among them.
    """

    def __init__(
        self, rows: int, control_period: float, components: int = 32, max_inner_step: float | None = None
    ) -> None:
        """Make room for ``rows`` rows of up to ``components`` wave components each (it grows on demand).

        ``control_period`` [s] is in [0.001, 2]; ``max_inner_step`` [s] overrides the choice of the inner step.
        """
        require_integer("rows", rows, low=1, high=2**24)
        require_number("control_period", control_period, "s", low=1e-3, high=2.0)
        if max_inner_step is not None:
            require_number("max_inner_step", max_inner_step, "s", low=1e-6, high=MAX_SEGMENT)
        self.rows = rows
        self.control_period = float(control_period)
        self._max_inner_step = max_inner_step
        self._segments = math.ceil(control_period / MAX_SEGMENT - 1e-9)
        self._lanes = 1 if rows == 1 else at.LANES
        self._use(step_kernels(self._lanes))
        self._components = at.padded(components)
        blocks = -(-rows // self._lanes)
        require_memory(f"num_envs = {rows}", 8 * blocks * self._lanes * self._slots_of_row(self._components))
        self._blocks = np.zeros((blocks, at.slots(self._components) * self._lanes))
        self._records = RecordTable()
        # Lanes beyond the last row hold the paper's case, so that no lane computes with zeros for parameters.
        idle = self.row_vector(Scenario.paper())
        self._fill(idle)

    def _use(self, kernels: StepKernels) -> None:
        self._kernels = kernels
        self._step = kernels.step if self.rows <= at.LANES else kernels.step_parallel

    @property
    def _view(self) -> FloatArray:
        """The rows' quantities: (blocks, slots, lanes)."""
        return self._blocks.reshape(len(self._blocks), -1, self._lanes)

    def read(self, slot: int) -> FloatArray:
        """Copy one quantity (a slot of ``layout``) of all rows: (rows,)."""
        return self._view[:, slot].reshape(-1)[: self.rows].copy()

    def read_many(self, slot: int, size: int) -> FloatArray:
        """Copy ``size`` successive quantities of all rows: (rows, size)."""
        return self._view[:, slot : slot + size].transpose(0, 2, 1).reshape(-1, size)[: self.rows].copy()

    def deck(self) -> FloatArray:
        """Surge, sway, heave [m], roll, pitch, yaw [rad] of all rows: (rows, 6)."""
        coordinates = np.empty((self.rows, 6))
        self._kernels.deck(self._blocks, coordinates)
        return coordinates

    @property
    def blocks(self) -> FloatArray:
        """The array itself, (blocks, slots * lanes); see ``layout``."""
        return self._blocks

    @property
    def lanes(self) -> int:
        """Rows in a block."""
        return self._lanes

    @property
    def records(self) -> FloatArray:
        """Recorded motions that rows follow: lines of deck coordinates, rates and accelerations, (lines, 18)."""
        return self._records.lines

    def step(self, commands: FloatArray) -> None:
        """Advance every row by one control step with the drum speed commands (rows,) rad/s."""
        if self._lanes == 1:
            self._blocks[0, at.COMMAND] = commands[0]
        else:
            full, rest = divmod(self.rows, self._lanes)
            column = self._view[:, at.COMMAND]
            column[:full] = commands[: full * self._lanes].reshape(full, self._lanes)
            if rest:
                column[full, :rest] = commands[full * self._lanes :]
        self._advance()

    def reset_row(self, index: int, scenario: Scenario) -> None:
        """Put a row at the start of a scenario."""
        self.write_row(index, self.row_vector(scenario))

    def write_row(self, index: int, vector: FloatArray) -> None:
        """Overwrite a row with a vector that ``row_vector`` or ``copy_row`` gave."""
        block, lane = divmod(index, self._lanes)
        view = self._view
        view[block, : len(vector), lane] = vector
        view[block, len(vector) :, lane] = 0.0
        if vector[at.SPRINGS] > 0.0:
            self._use(step_kernels(self._lanes, heavy=True))

    def restore_row(self, index: int, vector: FloatArray, scenario: Scenario) -> None:
        """Put back a row of ``scenario`` that ``copy_row`` of this or a like engine gave."""
        self.write_row(index, self._adopt(vector, scenario))

    def copy_row(self, index: int) -> FloatArray:
        """Return everything the engine knows of a row: (slots,)."""
        block, lane = divmod(index, self._lanes)
        return self._view[block, :, lane].copy()

    def row_vector(self, scenario: Scenario) -> FloatArray:
        """Slots of a row at the start of a scenario: (slots,)."""
        times = self._timing(scenario)
        motion: ShipMotion = scenario.motion
        if has_components(motion):
            components = motion.components()
            record, record_length = -1, 0
            segments = self._node_segments(scenario, components, times)
        else:
            components = Components(np.zeros(0), np.zeros((0, 6), dtype=np.complex128))
            record, record_length = self._record(motion, times.segment)
            segments = 1
        self._make_room(len(components.frequency))
        row = np.zeros(at.slots(self._components))
        fill_parameters(row, scenario, times.segment, times.substeps)
        row[at.RECORD], row[at.RECORD_LENGTH] = record, record_length
        row[at.YAW_START] = self._records.lines[record, Coordinate.YAW] if record_length else 0.0
        row[at.NODE_SEGMENTS] = segments
        component_kernels().write(row, components.frequency, components.response, segments * times.segment)
        if scenario.water is not None and scenario.water.waves and isinstance(motion, SeaMotion):
            fill_waves(row, scenario, motion)
        kernels = step_kernels(1, heavy=not scenario.is_light)
        kernels.start(row[None], self._components, self._records.lines)
        hang_load(row, 1, 0, scenario.initial == "comoving")
        hang_rope(row, 1, 0, scenario.initial == "comoving")
        kernels.start(row[None], self._components, self._records.lines)
        return row

    def _slots_of_row(self, components: int) -> int:
        """Numbers that a row takes with room for so many wave components."""
        return at.slots(components)

    def _fill(self, vector: FloatArray) -> None:
        """Put every lane where ``vector`` (slots,) says."""
        self._view[...] = vector[None, :, None]

    def _advance(self) -> None:
        self._step(self._blocks, self._components, self._segments, self._records.lines)

    def _timing(self, scenario: Scenario) -> Timing:
        return timing(scenario, self.control_period, self._max_inner_step)

    def _node_segments(self, scenario: Scenario, components: Components, times: Timing) -> int:
        """Motion segments between two nodes of a scenario's motion: a power of two; one where the frame luffs.

        Where a swing begins or ends, within an interval, a quintic over 0.2 s is off by 2e-6 m for 65° in 20 s.
        """
        if scenario.luffing is not None:
            return 1
        return component_kernels().segments(
            components.frequency,
            components.response,
            scenario.crane.pulley_position,
            times.segment,
            float(scenario.ramp),
        )

    def _adopt(self, vector: FloatArray, scenario: Scenario) -> FloatArray:
        """Make room for a row of another engine, and point it at this engine's tables: (slots,)."""
        times = self._timing(scenario)
        if vector[at.CONTROL_PERIOD] != times.segment or vector[at.SUBSTEPS] != times.substeps:
            raise InvalidValue(
                f"set_state(): the state belongs to an environment with {vector[at.SUBSTEPS]:g} inner steps in "
                f"{vector[at.CONTROL_PERIOD]:g} s: must be {times.substeps} in {times.segment:g} s, as here"
            )
        self._make_room((len(vector) - at.ROW_SLOTS) // at.COMPONENT_SLOTS)
        adopted = vector.copy()
        if not has_components(scenario.motion):
            adopted[at.RECORD], adopted[at.RECORD_LENGTH] = self._record(scenario.motion, times.segment)
        return adopted

    def _record(self, motion: TabledMotion, segment: float) -> tuple[int, int]:
        """First line and length of a recorded motion in the table of records, which it is added to when new."""
        return self._records.place(motion, segment, lambda: set(self._view[:, at.RECORD].ravel().tolist()))

    def _make_room(self, components: int) -> None:
        """Widen the rows when a motion has more components than there is room for."""
        if components <= self._components:
            return
        old = self._blocks
        wider = old.nbytes // at.slots(self._components) * at.slots(at.padded(components))
        require_memory(f"num_envs = {self.rows} with {components} wave components", old.nbytes + wider)
        self._components = at.padded(components)
        self._blocks = np.zeros((len(old), at.slots(self._components) * self._lanes))
        self._blocks[:, : old.shape[1]] = old


__all__ = ["Engine", "InvalidValue", "Timing", "timing"]
