"""The agents' interface as wrappers of Gymnasium, for any learner."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, TypeVar

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space

from aframe_env import task
from aframe_env.env import AFrameHeaveEnv
from aframe_env.simulation import Simulation
from aframe_env.validation import InvalidValue, require_numbers
from aframe_env.vector_env import AFrameHeaveVectorEnv
from agents.control.filters import FloatArray
from agents.learned.features import LIMIT
from agents.learned.interface import Cuts, InterfaceConfig, LearnerFeatures, interface_config

Float32Array = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Face = TypeVar("Face", AFrameHeaveEnv, AFrameHeaveVectorEnv)

_ACTION = spaces.Box(-1.0, 1.0, (1,), np.float32)


class _Named:
    """What both wrappers tell of their features."""

    _features: LearnerFeatures

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Names of the features, in the order of an observation."""
        return self._features.names

    @property
    def actor_inputs(self) -> int:
        """Number of features that are the agent's, the first ones; the rest is for critics alone."""
        return self._features.actor_inputs


class AgentInterface(
    _Named, gymnasium.Wrapper[Float32Array, Float32Array, Float32Array, Float32Array], RecordConstructorArgs
):
    """``AFrameHeave-v0`` as the agents see it: their features, their action, the reward that they are trained with.

    - Observation: ``Box(-20, 20, (F,), float32)``, the features ``feature_names`` of the environment's observation.
    - Action: ``Box(-1, 1, (1,), float32)``: how fast the rope's upper end is to go up in space; 0 follows the pulley.
    - Reward and truncation: see ``InterfaceConfig``, whose fields go by keyword or together as ``config``.

    Infos are the environment's. ``FeaturePolicy`` takes what was learned back to the environment as it is.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], config: InterfaceConfig | None = None, **arguments: Any) -> None:
        gymnasium.Wrapper.__init__(self, env)
        self._simulation = simulation = _bare(env, AFrameHeaveEnv).simulation
        self._config = interface_config(config, arguments)
        RecordConstructorArgs.__init__(self, **asdict(self._config))
        self._features = LearnerFeatures.of(simulation.config, 1, self._config)
        self._cuts = Cuts(1, simulation.control_period, simulation.episode_duration, self._config)
        self.observation_space = _observation_space(self._features)  # type: ignore[assignment]
        self.action_space = _ACTION

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32Array, dict[str, Any]]:
        """Start an episode; arguments as the environment's."""
        observation, info = self.env.reset(seed=seed, options=options)
        _begin(self._features, self._cuts, self._simulation, observation[None], np.zeros(1, dtype=np.int64))
        return self._features.values[0].copy(), info

    def step(self, action: Float32Array) -> tuple[Float32Array, float, bool, bool, dict[str, Any]]:
        """Advance by one control step with ``action`` (1,), an agent's output."""
        command = self._features.command(_outputs("action", action, (1,)))
        observation, reward, terminated, truncated, info = self.env.step(command)  # type: ignore[arg-type]
        state = self._simulation.state
        self._features.advance(observation[None], state)
        cut = bool(self._cuts.advance(state[:, task.DEPTH_ERROR])[0])
        cost = -np.array([reward], dtype=np.float64)
        shaped = float(self._config.rewards(cost, self._simulation.control_period)[0])
        return self._features.values[0].copy(), shaped, terminated, truncated or (cut and not terminated), info


class AgentVectorInterface(_Named, VectorWrapper):
    """``AgentInterface`` for the native vector environment, in each of its autoreset modes.

    Row k is bit-equal to an ``AgentInterface`` on the scalar environment that is seeded as that row is. In SAME_STEP
    mode ``infos["final_obs"]`` has the last features of the rows that ended.
    """

    env: VectorEnv[Any, Any, Any]

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        config: InterfaceConfig | None = None,
        *,
        stagger: bool = False,
        **arguments: Any,
    ) -> None:
        """``stagger``: cut the rows' first episodes at evenly spread times, so that they do not all end at once."""
        super().__init__(env)
        self._bare = _bare(env, AFrameHeaveVectorEnv)
        self._simulation = simulation = self._bare.simulation
        self._config = interface_config(config, arguments)
        self._features = LearnerFeatures.of(simulation.config, self.num_envs, self._config)
        self._cuts = Cuts(self.num_envs, simulation.control_period, simulation.episode_duration, self._config)
        self._autoreset: AutoresetMode = self._bare.metadata["autoreset_mode"]
        self._stagger = stagger
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        """Rows whose episode has ended and that have not been reset yet."""
        self._cut = np.zeros(self.num_envs, dtype=np.bool_)
        """Those of them that the environment does not know to have ended."""
        self.single_observation_space = _observation_space(self._features)
        self.single_action_space = _ACTION
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Float32Array, dict[str, Any]]:
        """Start episodes in all rows, or in those of ``options["reset_mask"]``; arguments as the environment's."""
        observation, infos = self.env.reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask")
        self._begin(observation, np.ones(self.num_envs, dtype=np.bool_) if mask is None else mask)
        if mask is None and self._stagger:
            shares = np.arange(1, self.num_envs + 1) / self.num_envs
            self._cuts.left[:] = np.ceil(self._cuts.horizon * shares).astype(np.int64)
        return self._features.values.copy(), infos

    def step(self, actions: Float32Array) -> tuple[Float32Array, FloatArray, Mask, Mask, dict[str, Any]]:
        """Advance every row by one control step with ``actions`` (num_envs, 1), outputs of an agent."""
        if self._autoreset is AutoresetMode.DISABLED and self._cut.any():
            raise gymnasium.error.ResetNeeded(
                f"rows {np.flatnonzero(self._cut).tolist()[:8]} have ended: reset them with options['reset_mask']"
            )
        outputs = _outputs("actions", actions, (self.num_envs, 1))[:, 0]
        observation, rewards, terminations, truncations, infos = self.env.step(self._features.command(outputs)[:, None])
        rewards = self._config.rewards(-rewards, self._simulation.control_period)
        state = self._bare.last_state
        self._features.advance(_last(observation, infos), state)
        cut = self._cuts.advance(state[:, task.DEPTH_ERROR])
        if self._autoreset is AutoresetMode.NEXT_STEP and self._ended.any():
            fresh = self._ended.copy()
            if self._cut.any():
                observation, infos = self._restart(self._cut.copy(), infos)
            self._begin(observation, fresh)
            rewards[fresh] = 0.0
            for flags in (terminations, truncations, cut):
                flags[fresh] = False
        self._cut = cut & ~terminations & ~truncations
        truncations = truncations | self._cut
        self._ended = terminations | truncations
        if self._autoreset is AutoresetMode.SAME_STEP and self._ended.any():
            ended = self._ended.copy()
            final = self._finals(ended, infos)
            if self._cut.any():
                observation, infos = self._restart(self._cut.copy(), infos)
            self._begin(observation, ended)
            infos = {**infos, **final}
        return self._features.values.copy(), rewards, terminations, truncations, infos

    def _begin(self, observation: Float32Array, mask: Mask) -> None:
        rows = np.flatnonzero(mask)
        _begin(self._features, self._cuts, self._simulation, observation[rows], rows)
        self._ended[rows] = self._cut[rows] = False

    def _restart(self, mask: Mask, infos: dict[str, Any]) -> tuple[Float32Array, dict[str, Any]]:
        """Restart rows that the environment would let go on; observations of all rows, and the step's infos."""
        observation, started = self.env.reset(options={"reset_mask": mask})
        return observation, infos | {name: value for name, value in started.items() if not name.startswith("_")}

    def _finals(self, ended: Mask, infos: dict[str, Any]) -> dict[str, Any]:
        observations = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(ended).tolist():
            observations[row] = self._features.values[row].copy()
        last = infos.get("final_info", infos)
        return {
            "final_obs": observations,
            "_final_obs": ended,
            "final_info": {name: ended if name.startswith("_") else value for name, value in last.items()},
            "_final_info": ended,
        }


def _bare(env: gymnasium.Env[Any, Any] | VectorEnv[Any, Any, Any], kind: type[Face]) -> Face:
    """The environment below ``env``. Raises InvalidValue unless its observations and actions come through as they are.

    The features tell metres from radians by the quantities' places.
    """
    bare = env.unwrapped
    if not isinstance(bare, kind):
        raise InvalidValue(f"env = {env}: must be {kind.__name__}, perhaps within other wrappers")
    if env.observation_space != bare.observation_space or env.action_space != bare.action_space:
        raise InvalidValue(f"env = {env}: must leave observations and actions of {kind.__name__} as they are")
    return bare


def _observation_space(features: LearnerFeatures) -> spaces.Box:
    return spaces.Box(-LIMIT, LIMIT, (len(features.names),), np.float32)


def _begin(
    features: LearnerFeatures,
    cuts: Cuts,
    simulation: Simulation,
    observation: Float32Array,
    rows: npt.NDArray[np.int64],
) -> None:
    """Begin episodes in these ``rows`` of n, whose first observations are (n, K)."""
    scenarios = [scenario for row in rows.tolist() if (scenario := simulation.scenarios[row]) is not None]
    features.start(observation, simulation.state[rows], scenarios, rows)
    cuts.start(rows)


def _last(observation: Float32Array, infos: dict[str, Any]) -> Float32Array:
    """Observations (N, K) at the end of the step, before the rows that ended were restarted."""
    if "final_obs" not in infos:
        return observation
    last = observation.copy()
    for row in np.flatnonzero(infos["_final_obs"]).tolist():
        last[row] = infos["final_obs"][row]
    return last


def _outputs(name: str, action: Any, shape: tuple[int, ...]) -> FloatArray:
    outputs = require_numbers(name, action, "in [-1, 1]")
    if outputs.shape != shape:
        raise InvalidValue(f"{name} of shape {outputs.shape}: must be of shape {shape}, in [-1, 1]")
    if not np.isfinite(outputs).all():
        raise InvalidValue(f"{name} = {action!r}: must be finite, in [-1, 1]")
    return outputs
