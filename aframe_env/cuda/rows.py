"""The rows of the task, resident on a CUDA device."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import torch

from aframe_env import task
from aframe_env.cuda.device import stream, view
from aframe_env.cuda.drawing import tables_of
from aframe_env.cuda.kernels import kernels
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.layout import LANES
from aframe_env.engine import Engine
from aframe_env.scenario import Scenario, ScenarioDistribution, ScenarioSource
from aframe_env.scenario.motion import has_components
from aframe_env.simulation import Simulation
from aframe_env.validation import InvalidValue


class CudaRows:
    """Rows of the task on a device. No call waits for the device, and nothing but kernels' arguments goes there."""

    def __init__(self, host: Simulation, rows: int, device: torch.device) -> None:
        """``host``: one row of the same task on the processor, which has checked the arguments."""
        self.device = device
        self._rows = rows
        self._duration = host.episode_duration
        self._blocks_of_threads = -(-rows // LANES)
        source = host.source
        if not isinstance(source, Scenario):
            source.nominal().require_light("scenarios drawn on a CUDA device")
            source.require_known_crane("scenarios drawn on a CUDA device")
        elif source.as_told.load_mass != source.load_mass:
            raise InvalidValue(
                f"told: load_mass = {source.as_told.load_mass!r} kg: rows on a CUDA device observe the true mass: must "
                f"be {source.load_mass!r} kg"
            )
        self._components = _count_components(source)
        self._kernels = kernels()
        self._advance = self._kernels.advance if host.config.nominal.is_light else self._kernels.advance_any
        engine = Engine(1, host.control_period, self._components, host.config.max_inner_step)
        vector = engine.row_vector(host.config.nominal)
        self._room = (len(vector) - at.ROW_SLOTS) // at.COMPONENT_SLOTS
        self._segments = round(host.control_period / vector[at.CONTROL_PERIOD])
        # A device array cannot be empty; no row follows the line that stands in.
        records = engine.records if len(engine.records) else np.zeros((1, 18))
        # Lanes beyond the last row are never looked at.
        blocks = self._memory = torch.zeros(
            (self._blocks_of_threads, len(vector) * LANES), dtype=torch.float64, device=device
        )
        self._state = torch.zeros((rows, len(task.STATE)), dtype=torch.float64, device=device)
        self._results = torch.zeros((rows, task.RESULTS), dtype=torch.float64, device=device)
        self._episodes = torch.zeros(rows, dtype=torch.int64, device=device)
        box = host.observation_space
        self._blocks, self._records = view(blocks), self._constant(records)
        self._outputs = (view(self._state), view(self._results), self._constant(box.low), self._constant(box.high))
        if isinstance(source, Scenario):
            self._tables = (self._constant(vector),)
        else:
            self._tables = tuple(
                self._constant(table) for table in tables_of(source, vector, host.config.max_inner_step)
            )
        self._random = not isinstance(source, Scenario)
        self._seed = 0

    def _constant(self, array: npt.NDArray[Any]) -> Any:
        return view(torch.from_numpy(np.ascontiguousarray(array)).to(self.device))

    def seed(self, seed: int) -> None:
        """Let the rows' scenarios start from a seed anew, at the next restart."""
        self._seed = seed
        self._episodes.zero_()

    def restart(self, finished: torch.Tensor, observation: torch.Tensor) -> torch.Tensor:
        """Put the rows that have ``finished`` (N,) bool at the start of new scenarios; observation (N, 14) of all."""
        observation = observation.clone()
        outputs = (*self._outputs, view(observation))
        mask = view(finished.view(torch.uint8))
        if self._random:
            self._launch(
                self._kernels.draw,
                self._blocks,
                self._room,
                self._components,
                self._records,
                mask,
                self._seed,
                view(self._episodes),
                *self._tables,
                *outputs,
            )
        else:
            self._launch(self._kernels.repeat, self._blocks, mask, *self._tables, *outputs)
        return observation

    def advance(self, actions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Advance by one control step: observation (N, 14), cost (N,) m² s, whose ropes have parted (N,)."""
        observation = torch.empty((self._rows, len(task.STATE)), dtype=torch.float32, device=self.device)
        self._launch(
            self._advance,
            self._blocks,
            self._room,
            self._segments,
            self._records,
            view(actions),
            self._duration,
            *self._outputs,
            view(observation),
        )
        return observation, self._results[:, task.COST], self._results[:, task.PARTED] > 0.0

    def get_state(self) -> dict[str, torch.Tensor]:
        """Everything that the rows' rest depends on, as copies."""
        return {name: tensor.clone() for name, tensor in self._tensors().items()} | {"seed": torch.tensor(self._seed)}

    def set_state(self, state: Mapping[str, torch.Tensor]) -> None:
        """Go back to a state that ``get_state`` returned."""
        self._seed = int(state["seed"])
        for name, tensor in self._tensors().items():
            tensor.copy_(state[name])

    def _tensors(self) -> dict[str, torch.Tensor]:
        return {
            "engine": self._memory,
            "state": self._state,
            "results": self._results,
            "episodes": self._episodes,
        }

    def _launch(self, kernel: Any, *arguments: Any) -> None:
        kernel[self._blocks_of_threads, LANES, stream(self.device)](*arguments)


def _count_components(source: ScenarioSource) -> int:
    if isinstance(source, ScenarioDistribution):
        return source.components
    return len(source.motion.components().frequency) if has_components(source.motion) else 0
