"""The native vector environment of AFrameHeave-v0: many rows of one engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from aframe_env import task
from aframe_env.config import TaskConfig, plain_spec, task_config
from aframe_env.env import EnvState
from aframe_env.rendering import open_renderer
from aframe_env.scenario import Scenario
from aframe_env.simulation import Simulation
from aframe_env.validation import InvalidValue, require_choice, require_integer, require_numbers, shown

if TYPE_CHECKING:
    from aframe_env.rendering.renderer import Renderer

Rows = npt.NDArray[np.bool_]


class AFrameHeaveVectorEnv(VectorEnv[npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[Any]]):
    """``num_envs`` copies of ``AFrameHeaveEnv`` advanced together, each with its own generator and scenarios.

    Row k, seeded with ``reset(seed=s)``, is bit-equal to the scalar environment seeded with s + k. Arguments as for
    ``AFrameHeaveEnv``, and:

    - ``autoreset_mode``: NEXT_STEP (Gymnasium's default: the step after the end resets; its action is ignored, its
      reward 0), SAME_STEP (the last observation is in ``infos["final_obs"]``) or DISABLED (reset the rows that ended
      with ``reset(options={"reset_mask": ...})``).
    - ``max_episode_steps``: overrides ``episode_duration``.
    - ``render_mode``: None or "rgb_array": ``render()`` returns one picture for each row.

    ``reset(options={"scenario": ...})`` takes one ``Scenario`` for all rows, or a sequence of one for each.
    """

    def __init__(
        self,
        num_envs: int = 1,
        config: TaskConfig | Mapping[str, Any] | None = None,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        require_integer("num_envs", num_envs, low=1, high=2**24)
        if render_mode is not None:
            require_choice("render_mode", render_mode, ("rgb_array",))
        try:
            self._autoreset = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = ", ".join(repr(mode.value) for mode in AutoresetMode)
            raise InvalidValue(f"autoreset_mode = {autoreset_mode!r}: must be one of {modes}") from None
        self.num_envs = num_envs
        self.render_mode = render_mode
        self._simulation = Simulation(num_envs, task_config(config, arguments).lasting(max_episode_steps))
        self._spec: EnvSpec | None = None
        self.single_observation_space = self._simulation.observation_space
        self.single_action_space = self._simulation.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": 1.0 / self._simulation.control_period,
            "autoreset_mode": self._autoreset,
        }
        self._renderer: Renderer | None = None
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._seeds: list[int] = [-1] * num_envs
        self._ended = np.zeros(num_envs, dtype=np.bool_)
        self._everything = np.ones(num_envs, dtype=np.bool_)
        self._final_state: npt.NDArray[np.float64] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the renderer: a copy opens its own, whose history begins anew."""
        return {**self.__dict__, "_renderer": None}

    @property
    def spec(self) -> EnvSpec | None:
        """What makes the environment again, as plain data."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = plain_spec(spec, self._simulation.config)

    @property
    def simulation(self) -> Simulation:
        """The simulation behind the environment, for reading."""
        return self._simulation

    @property
    def last_state(self) -> npt.NDArray[np.float64]:
        """Full states (num_envs, 14) at the end of the last step, for reading: of the rows that SAME_STEP restarted
        since, the ones that they ended in."""
        return self._simulation.state if self._final_state is None else self._final_state

    @property
    def scenarios(self) -> tuple[Scenario | None, ...]:
        """The rows' present scenarios, the true ones; what a policy may know is their ``as_told``."""
        return tuple(self._simulation.scenarios)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The rows' generators."""
        return tuple(self._generator(i) for i in range(self.num_envs))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The rows' seeds, -1 where unknown."""
        return tuple(self._seeds)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Start episodes in all rows, or in those of ``options["reset_mask"]`` (num_envs,) bool."""
        options = dict(options or {})
        mask = self._reset_mask(options.pop("reset_mask", None))
        scenarios = self._scenario_option(options.pop("scenario", None))
        if options:
            raise InvalidValue(f"options: unknown key {sorted(options)[0]!r}: must be 'scenario' or 'reset_mask'")
        seeds = self._seed_list(seed)
        for index in np.flatnonzero(mask).tolist():
            if seeds[index] is not None:
                self._generators[index], self._seeds[index] = seeding.np_random(seeds[index])
        self._restart(mask, scenarios)
        self._ended &= ~mask
        self._final_state = None
        self._record()
        return self._simulation.observe(), self._infos(mask)

    def step(
        self, actions: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float64], Rows, Rows, dict[str, Any]]:
        """Advance every row by one control step with ``actions`` (num_envs, 1) rad/s held."""
        simulation = self._simulation
        if simulation.scenarios[0] is None:
            raise gymnasium.error.ResetNeeded("step() before the first reset()")
        if self._autoreset is AutoresetMode.DISABLED and self._ended.any():
            raise gymnasium.error.ResetNeeded(
                f"rows {np.flatnonzero(self._ended).tolist()[:8]} have ended: reset them with options['reset_mask']"
            )
        simulation.advance(self._commands(actions))
        rewards = -simulation.results[:, task.COST]
        terminations = simulation.results[:, task.PARTED] > 0.0
        truncations = simulation.steps >= simulation.episode_steps
        if self._autoreset is AutoresetMode.NEXT_STEP and self._ended.any():
            fresh = self._ended
            self._restart(fresh, None)
            rewards[fresh] = 0.0
            terminations[fresh] = False
            truncations[fresh] = False
        self._ended = terminations | truncations
        final: dict[str, Any] = {}
        self._final_state = None
        if self._autoreset is AutoresetMode.SAME_STEP and self._ended.any():
            self._final_state = simulation.state.copy()
            final = self._finals(self._ended)
            self._restart(self._ended, None)
            self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        self._record()
        return (
            simulation.observe(),
            rewards,
            terminations,
            truncations,
            {**self._infos(self._everything), **final},
        )

    def get_state(self) -> tuple[EnvState, ...]:
        """Return everything that the rows' further life depends on (not between an end and its reset step)."""
        return tuple(
            EnvState(self._simulation.copy_row(i), self._generator(i).bit_generator.state) for i in range(self.num_envs)
        )

    def set_state(self, state: Sequence[EnvState]) -> None:
        """Go back to a state that ``get_state`` returned."""
        if len(state) != self.num_envs:
            raise InvalidValue(f"set_state(): {len(state)} rows for an environment of {self.num_envs}")
        for i, row in enumerate(state):
            self._simulation.write_row(i, row.row)
            self._generator(i).bit_generator.state = row.generator
        steps = self._simulation.steps >= self._simulation.episode_steps
        self._ended = steps | (self._simulation.results[:, task.PARTED] > 0.0)
        self._record()

    def render(self) -> tuple[npt.NDArray[np.uint8], ...] | None:
        """Return the pictures of all rows in render mode "rgb_array"."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() without a render mode: give one when making the environment")
            return None
        if self._renderer is None:
            self._renderer = open_renderer(self._simulation)
        return tuple(self._renderer.frame(row) for row in range(self.num_envs))

    def _record(self) -> None:
        """Add the present to the pictures' history, if there is one yet."""
        if self._renderer is not None:
            self._renderer.record()

    def _generator(self, index: int) -> np.random.Generator:
        generator = self._generators[index]
        if generator is None:
            generator, self._seeds[index] = seeding.np_random(None)
            self._generators[index] = generator
        return generator

    def _restart(self, mask: Rows, scenarios: Sequence[Scenario | None] | None) -> None:
        indices = np.flatnonzero(mask)
        drawn = [
            self._simulation.draw(self._generator(i), None if scenarios is None else scenarios[i])
            for i in indices.tolist()
        ]
        self._simulation.reset_rows(indices, drawn)

    def _commands(self, actions: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        commands = require_numbers("actions", actions, "rad/s")
        if commands.shape != (self.num_envs, 1):
            raise InvalidValue(f"actions of shape {commands.shape}: must be of shape ({self.num_envs}, 1), rad/s")
        commands = commands[:, 0]
        if not np.isfinite(commands).all():
            row = int(np.flatnonzero(~np.isfinite(commands))[0])
            raise InvalidValue(f"actions[{row}] = {commands[row]} rad/s: must be finite")
        return commands

    def _reset_mask(self, mask: Any) -> Rows:
        if mask is None:
            return self._everything.copy()
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
            raise InvalidValue(
                f"options['reset_mask'] = {shown(mask)}: must be a bool array of shape ({self.num_envs},)"
            )
        if not mask.any():
            raise InvalidValue("options['reset_mask']: must select at least one row")
        return mask

    def _scenario_option(self, option: Any) -> Sequence[Scenario | None] | None:
        if option is None or isinstance(option, Scenario):
            return None if option is None else [option] * self.num_envs
        if not isinstance(option, Sequence) or len(option) != self.num_envs:
            raise InvalidValue(f"options['scenario']: must be a Scenario or a sequence of {self.num_envs} of them")
        return option

    def _seed_list(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise InvalidValue(f"seed: {len(seed)} seeds for {self.num_envs} rows")
        return seed

    def _infos(self, mask: Rows) -> dict[str, Any]:
        values: dict[str, Any] = dict(task.info(self._simulation.results.copy(), self._simulation.frames()))
        present = mask.copy()
        return values | {f"_{key}": present for key in values}

    def _finals(self, mask: Rows) -> dict[str, Any]:
        observations = np.full(self.num_envs, None, dtype=object)
        rows = self._simulation.observe()
        for index in np.flatnonzero(mask).tolist():
            observations[index] = rows[index]
        present = mask.copy()
        return {
            "final_obs": observations,
            "_final_obs": present,
            "final_info": self._infos(mask),
            "_final_info": present,
        }
