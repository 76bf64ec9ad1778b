"""What a learner and its rows remember, as named arrays and plain values, and back: nothing is pickled.

Kept is what changes while learning; the rest is built anew from the same options.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from agents.control.kalman import Schedule, WaveBank
from agents.control.predictive import PlanningConfig
from agents.learned.features import FeatureConfig
from agents.learned.network import Actor
from train.learn.learner import Best

FIXED: Final = (Schedule, WaveBank, PlanningConfig, FeatureConfig)
"""Kinds of objects that hold nothing but what was known at the start."""
OURS: Final = ("aframe_env.", "agents.", "train.")
Scalar = bool | int | float | str | None


@dataclass
class Memory:
    """Arrays and values by the places that they belong to."""

    arrays: dict[str, np.ndarray[Any, Any]] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)
    """Plain values, as JSON has them."""

    def under(self, name: str) -> Memory:
        """The part whose places begin with ``name``, without it."""
        prefix = f"{name}/"
        return Memory(
            {key.removeprefix(prefix): value for key, value in self.arrays.items() if key.startswith(prefix)},
            {key.removeprefix(prefix): value for key, value in self.values.items() if key.startswith(prefix)},
        )

    def put(self, name: str, part: Memory) -> None:
        """Add a part under a name."""
        self.arrays |= {f"{name}/{key}": value for key, value in part.arrays.items()}
        self.values |= {f"{name}/{key}": value for key, value in part.values.items()}


@dataclass(frozen=True)
class _Leaf:
    place: str
    value: Any
    replace: Callable[[Any], object] | None
    """Put another value in its place; None where there is no place to put it: an array is then filled."""


def of_object(root: object) -> Memory:
    """What an object of this package remembers, and those that it holds: arrays and plain values."""
    memory = Memory()
    for leaf in _leaves(root):
        if isinstance(leaf.value, np.ndarray):
            memory.arrays[leaf.place] = leaf.value.copy()
        else:
            memory.values[leaf.place] = leaf.value
    return memory


def into_object(root: object, memory: Memory) -> None:
    """Put back what ``of_object`` told of an object that was built alike."""
    for leaf in list(_leaves(root)):
        if isinstance(leaf.value, np.ndarray):
            array = memory.arrays[leaf.place]
            if leaf.value.shape == array.shape and leaf.value.dtype == array.dtype:
                leaf.value[...] = array
            else:
                assert leaf.replace is not None, leaf.place
                leaf.replace(array.copy())
        else:
            assert leaf.replace is not None
            leaf.replace(memory.values[leaf.place])


def _leaves(root: object) -> Iterator[_Leaf]:
    seen: set[int] = set()

    def walk(place: str, value: Any, replace: Callable[[Any], object] | None) -> Iterator[_Leaf]:
        if isinstance(value, np.ndarray):
            if value.flags.writeable:
                yield _Leaf(place, value, replace)
        elif value is None or isinstance(value, Scalar):
            if replace is not None:
                yield _Leaf(place, value, replace)
        elif isinstance(value, list | tuple):
            for i, item in enumerate(value):
                yield from walk(f"{place}/{i}", item, None)
        elif type(value).__module__.startswith(OURS) and not isinstance(value, FIXED) and id(value) not in seen:
            seen.add(id(value))
            frozen = dataclasses.is_dataclass(value) and getattr(value, "__dataclass_params__").frozen  # noqa: B009
            for name, item in vars(value).items():
                setter = None if frozen else lambda new, owner=value, name=name: setattr(owner, name, new)
                yield from walk(f"{place}/{name}" if place else name, item, setter)

    yield from walk("", root, None)


def of_learner(model: BaseAlgorithm) -> Memory:
    """What a learner of Stable-Baselines3 remembers between two rollouts, its replay apart."""
    memory = Memory()
    memory.put("policy", _of_tensors(model.policy.state_dict()))
    for name, optimizer in _optimizers(model).items():
        state = optimizer.state_dict()
        for index, tensors in state["state"].items():
            memory.put(f"{name}/{index}", _of_tensors(tensors))
        memory.values[f"{name}/rates"] = [group["lr"] for group in state["param_groups"]]
    for name, tensor in _tensors(model).items():
        memory.arrays[name] = tensor.detach().numpy().copy()
    for name in _COUNTERS:
        if hasattr(model, name):
            memory.values[name] = getattr(model, name)
    for name in _LAST:
        memory.arrays[name] = np.array(getattr(model, name))
    memory.values["episodes"] = [dict(episode) for episode in model.ep_info_buffer or ()]
    memory.put("generators", _of_generators(model))
    return memory


def into_learner(model: BaseAlgorithm, memory: Memory) -> None:
    """Put back what ``of_learner`` told of a learner that was built alike; its ``learn`` may then go on."""
    model.policy.load_state_dict(_to_tensors(memory.under("policy")))
    for name, optimizer in _optimizers(model).items():
        part = memory.under(name)
        state = optimizer.state_dict()
        indices = sorted({int(key.split("/")[0]) for key in part.arrays})
        state["state"] = {index: _to_tensors(part.under(str(index))) for index in indices}
        for group, rate in zip(state["param_groups"], part.values["rates"], strict=True):
            group["lr"] = rate
        optimizer.load_state_dict(state)
    for name, tensor in _tensors(model).items():
        with torch.no_grad():
            tensor.copy_(torch.from_numpy(memory.arrays[name]))
    for name in _COUNTERS:
        if hasattr(model, name):
            setattr(model, name, memory.values[name])
    for name in _LAST:
        setattr(model, name, memory.arrays[name].copy())
    model.ep_info_buffer = deque(memory.values["episodes"], maxlen=model._stats_window_size)
    model.ep_success_buffer = deque(maxlen=model._stats_window_size)
    _into_generators(model, memory.under("generators"))


def of_best(best: Best) -> Memory:
    """The best agent so far."""
    if best.actor is None:
        return Memory(values={"left": None, "timesteps": 0})
    return Memory(_of_tensors(best.actor.state_dict()).arrays, {"left": best.left, "timesteps": best.timesteps})


def into_best(best: Best, to_actor: Callable[[], Actor], memory: Memory) -> None:
    """Put back the best agent so far; ``to_actor`` makes one of its kind."""
    if memory.values["left"] is not None:
        best.left, best.timesteps, best.actor = memory.values["left"], memory.values["timesteps"], to_actor()
        best.actor.load_state_dict(_to_tensors(memory))


_COUNTERS: Final = ("num_timesteps", "_n_updates", "_episode_num", "_current_progress_remaining")
_LAST: Final = ("_last_obs", "_last_episode_starts")


def _optimizers(model: BaseAlgorithm) -> dict[str, torch.optim.Optimizer]:
    """Optimisers by name: PPO has one, SAC one for the actor, the critics and the entropy's weight."""
    found = {
        "optimizer": getattr(model.policy, "optimizer", None),
        "actor_optimizer": getattr(getattr(model.policy, "actor", None), "optimizer", None),
        "critic_optimizer": getattr(getattr(model.policy, "critic", None), "optimizer", None),
        "entropy_optimizer": getattr(model, "ent_coef_optimizer", None),
    }
    return {name: optimizer for name, optimizer in found.items() if optimizer is not None}


def _tensors(model: BaseAlgorithm) -> dict[str, torch.Tensor]:
    weight = getattr(model, "log_ent_coef", None)
    return {} if weight is None else {"log_ent_coef": weight}


def _of_tensors(tensors: dict[str, Any]) -> Memory:
    return Memory({name: tensor.detach().cpu().numpy().copy() for name, tensor in tensors.items()})


def _to_tensors(memory: Memory) -> dict[str, torch.Tensor]:
    return {name: torch.from_numpy(array.copy()) for name, array in memory.arrays.items()}


def _of_generators(model: BaseAlgorithm) -> Memory:
    # Stable-Baselines3 draws its minibatches from NumPy's global generator.
    _, keys, *rest = np.random.get_state()  # noqa: NPY002
    return Memory(
        {"torch": torch.get_rng_state().numpy().copy(), "numpy": np.array(keys)},
        {
            "numpy": rest,
            "actions": model.action_space.np_random.bit_generator.state,
        },
    )


def _into_generators(model: BaseAlgorithm, memory: Memory) -> None:
    torch.set_rng_state(torch.from_numpy(memory.arrays["torch"].copy()))
    np.random.set_state(("MT19937", memory.arrays["numpy"], *memory.values["numpy"]))  # noqa: NPY002
    model.action_space.np_random.bit_generator.state = memory.values["actions"]
