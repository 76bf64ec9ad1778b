"""AFrameHeave for learners on tensors: many rows on a GPU, or on the processor, behind one interface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch
from gymnasium.error import DependencyNotInstalled

from aframe_env import task
from aframe_env.config import TaskConfig, task_config
from aframe_env.dynamics.random import episode_uniforms
from aframe_env.scenario import NUMBERS, Scenario
from aframe_env.scenario.motion import require_coverage
from aframe_env.simulation import RowState, Simulation
from aframe_env.validation import InvalidValue, require_integer

if TYPE_CHECKING:
    from tensordict import TensorDict

GROUP = "policy"
"""The observation's name in a TensorDict."""


@dataclass(frozen=True)
class TorchEnvConfig:
    """The arguments of an ``AFrameHeaveTorchEnv``."""

    num_envs: int
    task: TaskConfig
    device: str
    seed: int


class Rows(Protocol):
    """Rows of the task on some device."""

    device: torch.device

    def seed(self, seed: int) -> None:
        """Let the rows' scenarios start from a seed anew, at the next restart."""
        ...

    def restart(self, finished: torch.Tensor, observation: torch.Tensor) -> torch.Tensor:
        """Put the rows that have ``finished`` (N,) bool at the start of new scenarios; observation (N, 14) of all."""
        ...

    def advance(self, actions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Advance by one control step: observation (N, 14), cost (N,) m² s, whose ropes have parted (N,).

        The cost is the rows' own memory, which the next call changes.
        """
        ...

    def get_state(self) -> dict[str, torch.Tensor]:
        """Everything that the rows' rest depends on, as copies."""
        ...

    def set_state(self, state: Mapping[str, torch.Tensor]) -> None:
        """Go back to a state that ``get_state`` returned."""
        ...


class AFrameHeaveTorchEnv:
    """``num_envs`` rows of AFrameHeave-v0 on the simplified model, with tensors in and out.

    The task is ``AFrameHeaveEnv``'s with its full state observed. On a CUDA device the rows live there and are advanced
    and started anew by the engine's own functions, compiled for it; no call waits for the device. On the processor the
    engine itself runs. The same seed gives the same scenarios on both, and the same episodes but for rounding.

    The interface is what rsl_rl expects of an environment (``rsl_rl.env.VecEnv``), and the observation is in the group
    "policy". A row that ends is started anew within the step: the observation is then that of its new episode, and
    ``extras["final_obs"]`` (N, 14) has what it ended with, as it has every other row's. ``extras["time_outs"]`` (N,)
    says which rows ended because of their time only.

    Arguments, by keyword: those of ``AFrameHeaveEnv`` that have to do with the simplified model and its full state, and

    - ``device``: "cuda", "cuda:N" (extra ``cuda``) or "cpu".
    - ``seed``: of the rows' scenarios, in [0, 2^53).
    """

    num_actions = 1

    def __init__(
        self,
        num_envs: int,
        config: TaskConfig | None = None,
        *,
        device: str | torch.device = "cuda",
        seed: int = 0,
        **arguments: Any,
    ) -> None:
        require_integer("num_envs", num_envs, low=1, high=2**24)
        _require_tensordict()
        kind = _kind(device)
        config = task_config(config, arguments)
        if config.model != "simplified" or config.sensors is not None:
            raise InvalidValue(
                f"model = {config.model!r}, observation = {config.observation!r}: tensors have the full state of the "
                "simplified model only"
            )
        if isinstance(config.source, Scenario):
            require_coverage(config.source.motion, "episode_duration", config.duration)
        simulation = Simulation(num_envs if kind == "cpu" else 1, config)
        self.cfg = TorchEnvConfig(num_envs, config, str(device), seed)
        self.num_envs = num_envs
        self.observation_space = simulation.observation_space
        """Space of one row."""
        self.action_space = simulation.action_space
        """Space of one row, rad/s."""
        self.max_episode_length = simulation.episode_steps
        self._rows = _open_rows(simulation, num_envs, str(device))
        self.device = self._rows.device
        self.episode_length_buf = torch.zeros(num_envs, dtype=torch.int64, device=self.device)
        """(N,) control steps since each row's start; a row ends when it comes to ``max_episode_length``."""
        self._observation = torch.zeros((num_envs, len(task.STATE)), dtype=torch.float32, device=self.device)
        self.reset(seed=seed)

    @property
    def unwrapped(self) -> AFrameHeaveTorchEnv:
        """The environment itself."""
        return self

    def get_observations(self) -> TensorDict:
        """Return the present observation, (N, 14) in the group "policy"."""
        return self._grouped(self._observation)

    def reset(self, rows: torch.Tensor | None = None, *, seed: int | None = None) -> TensorDict:
        """Start new episodes in all rows, or in those of the mask ``rows`` (N,) bool.

        ``seed``: what all rows draw their scenarios from, from now on; by default they go on where they were.
        """
        if seed is not None:
            require_integer("seed", seed, low=0, high=2**53 - 1)
            self._rows.seed(seed)
        if rows is None:
            rows = torch.ones(self.num_envs, dtype=torch.bool, device=self.device)
        self._require("rows", rows, (self.num_envs,), torch.bool)
        self._observation = self._rows.restart(rows, self._observation)
        self.episode_length_buf.masked_fill_(rows, 0)
        return self.get_observations()

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, torch.Tensor]]:
        """Advance every row by one control step with the drum speeds ``actions`` (N, 1) rad/s held.

        Returns the observation, the reward (N,) in m² s, which rows have ended (N,) bool, and the extras. On a GPU
        actions are not checked to be finite, which would mean to wait for it: a row spoils its own episode only.
        """
        self._require("actions", actions, (self.num_envs, 1), None)
        actions = actions.detach().to(torch.float32).contiguous()
        final, cost, parted = self._rows.advance(actions)
        rewards = -cost.to(torch.float32)
        self.episode_length_buf += 1
        time_outs = (self.episode_length_buf >= self.max_episode_length) & ~parted
        dones = parted | time_outs
        self._observation = self._rows.restart(dones, final)
        self.episode_length_buf.masked_fill_(dones, 0)
        extras = {"time_outs": time_outs, "final_obs": final}
        return self.get_observations(), rewards, dones, extras

    def get_state(self) -> dict[str, torch.Tensor]:
        """Return everything that the rest of the rows' episodes, and all later ones, depend on, by name, as copies."""
        own = {"observation": self._observation.clone(), "episode_length": self.episode_length_buf.clone()}
        return own | self._rows.get_state()

    def set_state(self, state: Mapping[str, torch.Tensor]) -> None:
        """Go back to a state that ``get_state`` returned, in this environment or one of the same arguments.

        The tensors may lie on any device.
        """
        mine = {name: tuple(tensor.shape) for name, tensor in self.get_state().items()}
        theirs = {name: tuple(tensor.shape) for name, tensor in state.items()}
        if theirs != mine:
            raise InvalidValue(f"state: tensors of shape {theirs}: must be those of get_state(), {mine}")
        self._observation = state["observation"].to(self.device, copy=True)
        self.episode_length_buf = state["episode_length"].to(self.device, copy=True)
        self._rows.set_state(state)

    def close(self) -> None:
        """Nothing to close."""

    def _grouped(self, observation: torch.Tensor) -> TensorDict:
        from tensordict import TensorDict

        return TensorDict({GROUP: observation}, batch_size=[self.num_envs], device=self.device)

    def _require(self, name: str, tensor: Any, shape: tuple[int, ...], dtype: torch.dtype | None) -> None:
        wanted = f"a {'bool' if dtype else 'float'} tensor of shape {shape} on {self.device}"
        if not isinstance(tensor, torch.Tensor):
            raise InvalidValue(f"{name} = {tensor!r}: must be {wanted}")
        right_kind = tensor.dtype == dtype if dtype else tensor.is_floating_point()
        if not right_kind or tuple(tensor.shape) != shape or tensor.device != self.device:
            raise InvalidValue(
                f"{name}: a {tensor.dtype} tensor of shape {tuple(tensor.shape)} on {tensor.device}: must be {wanted}"
            )


class ProcessorRows:
    """Rows of the task on the processor."""

    device = torch.device("cpu")

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._episodes = np.zeros(simulation.rows, dtype=np.int64)
        self._seed = 0

    def seed(self, seed: int) -> None:
        """Let the rows' scenarios start from a seed anew, at the next restart."""
        self._seed = seed
        self._episodes[:] = 0

    def restart(self, finished: torch.Tensor, observation: torch.Tensor) -> torch.Tensor:
        """Put the rows that have ``finished`` (N,) bool at the start of new scenarios; observation (N, 14) of all."""
        indices = np.flatnonzero(finished.numpy())
        if len(indices):
            self._simulation.reset_rows(indices, [(self._draw(i, int(self._episodes[i])), 0) for i in indices.tolist()])
            self._episodes[indices] += 1
        return torch.from_numpy(self._simulation.observe())

    def advance(self, actions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Advance by one control step: observation (N, 14), cost (N,) m² s, whose ropes have parted (N,)."""
        commands = actions[:, 0].double().numpy()
        if not np.isfinite(commands).all():
            row = int(np.flatnonzero(~np.isfinite(commands))[0])
            raise InvalidValue(f"actions[{row}] = {commands[row]} rad/s: must be finite")
        simulation = self._simulation
        simulation.advance(commands)
        results = torch.from_numpy(simulation.results)
        return torch.from_numpy(simulation.observe()), results[:, task.COST], results[:, task.PARTED] > 0.0

    def get_state(self) -> dict[str, torch.Tensor]:
        """Everything that the rows' rest depends on, as copies."""
        rows = [self._simulation.copy_row(i).engine for i in range(self._simulation.rows)]
        return {
            "engine": torch.from_numpy(np.stack(rows)),
            "steps": torch.from_numpy(self._simulation.steps.copy()),
            "episodes": torch.from_numpy(self._episodes.copy()),
            "seed": torch.tensor(self._seed),
        }

    def set_state(self, state: Mapping[str, torch.Tensor]) -> None:
        """Go back to a state that ``get_state`` returned."""
        engine, steps, episodes = (state[name].cpu().numpy() for name in ("engine", "steps", "episodes"))
        self._seed = int(state["seed"])
        self._episodes[:] = episodes
        for i in range(self._simulation.rows):
            scenario = self._draw(i, int(episodes[i]) - 1)
            self._simulation.write_row(i, RowState(scenario, engine[i], None, int(steps[i])))

    def _draw(self, row: int, episode: int) -> Scenario:
        source = self._simulation.source
        if isinstance(source, Scenario):
            return source
        numbers = np.empty(NUMBERS)
        episode_uniforms(self._seed, row, episode, numbers)
        return source.at(numbers)


def _require_tensordict() -> None:
    try:
        import tensordict  # noqa: F401
    except ImportError as error:
        raise DependencyNotInstalled('tensordict is not installed: pip install "aframe-heave[cuda]"') from error


def _kind(device: str | torch.device) -> str:
    try:
        kind = torch.device(device).type
    except RuntimeError:
        kind = ""
    if kind not in ("cpu", "cuda"):
        raise InvalidValue(f"device = {str(device)!r}: must be 'cuda', 'cuda:N' or 'cpu'")
    return kind


def _open_rows(simulation: Simulation, rows: int, device: str) -> Rows:
    if _kind(device) == "cpu":
        return ProcessorRows(simulation)
    from aframe_env.cuda.device import open_device

    opened = open_device(device)
    from aframe_env.cuda.rows import CudaRows

    return CudaRows(simulation, rows, opened)
