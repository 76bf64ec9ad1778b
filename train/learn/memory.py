"""What a learner and its rows remember, as named arrays and plain values, and back: nothing is pickled.

Kept is what changes while learning; the rest is built anew from the same options.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from agents.control.predictive import PlanningConfig
from agents.control.wave_bank import Schedule, WaveBank
from agents.learned.features import FeatureConfig

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
    """What an object of this package remembers, and those that it holds: arrays, tensors and plain values."""
    memory = Memory()
    for leaf in _leaves(root):
        if isinstance(leaf.value, np.ndarray):
            memory.arrays[leaf.place] = leaf.value.copy()
        elif isinstance(leaf.value, torch.Tensor):
            memory.arrays[leaf.place] = _to_array(leaf.value)
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
        elif isinstance(leaf.value, torch.Tensor):
            assert leaf.replace is not None, leaf.place
            leaf.replace(torch.from_numpy(memory.arrays[leaf.place].copy()).to(leaf.value.device))
        else:
            assert leaf.replace is not None
            leaf.replace(memory.values[leaf.place])


def _leaves(root: object) -> Iterator[_Leaf]:
    seen: set[int] = set()

    def walk(place: str, value: Any, replace: Callable[[Any], object] | None) -> Iterator[_Leaf]:
        if isinstance(value, np.ndarray):
            # What a lift is does not change, and is handed over anew when the next one begins.
            if value.flags.writeable and value.dtype != object:
                yield _Leaf(place, value, replace)
        elif isinstance(value, torch.Tensor):
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
    memory.put("policy", of_tensors(model.policy.state_dict()))
    for name, optimizer in _optimizers(model).items():
        memory.put(name, of_optimizer(optimizer))
    for name, tensor in _tensors(model).items():
        memory.arrays[name] = _to_array(tensor)
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
    model.policy.load_state_dict(to_tensors(memory.under("policy")))
    for name, optimizer in _optimizers(model).items():
        into_optimizer(optimizer, memory.under(name))
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


def of_optimizer(optimizer: torch.optim.Optimizer) -> Memory:
    """What an optimiser remembers, and its rates."""
    state, memory = optimizer.state_dict(), Memory()
    for index, tensors in state["state"].items():
        memory.put(str(index), of_tensors(tensors))
    memory.values["rates"] = [group["lr"] for group in state["param_groups"]]
    return memory


def into_optimizer(optimizer: torch.optim.Optimizer, memory: Memory) -> None:
    """Put back what ``of_optimizer`` told of an optimiser of like networks."""
    state = optimizer.state_dict()
    indices = sorted({int(key.split("/")[0]) for key in memory.arrays})
    state["state"] = {index: to_tensors(memory.under(str(index))) for index in indices}
    for group, rate in zip(state["param_groups"], memory.values["rates"], strict=True):
        group["lr"] = rate
    optimizer.load_state_dict(state)


def of_torch_generators(device: torch.device) -> Memory:
    """States of torch's global generators: the processor's, and the device's if it is another."""
    memory = Memory({"processor": torch.get_rng_state().numpy().copy()})
    if device.type == "cuda":
        memory.arrays["device"] = torch.cuda.get_rng_state(device).numpy().copy()
    return memory


def into_torch_generators(device: torch.device, memory: Memory) -> None:
    """Put back what ``of_torch_generators`` told."""
    states = to_tensors(memory)
    torch.set_rng_state(states["processor"])
    if device.type == "cuda":
        torch.cuda.set_rng_state(states["device"], device)


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


def of_tensors(tensors: Mapping[str, torch.Tensor]) -> Memory:
    """Tensors by name."""
    return Memory({name: _to_array(tensor) for name, tensor in tensors.items()})


def to_tensors(memory: Memory) -> dict[str, torch.Tensor]:
    """The tensors of ``of_tensors``, on the processor."""
    return {name: torch.from_numpy(array.copy()) for name, array in memory.arrays.items()}


def _to_array(tensor: torch.Tensor) -> np.ndarray[Any, Any]:
    return tensor.detach().cpu().numpy().copy()


def _of_generators(model: BaseAlgorithm) -> Memory:
    # Stable-Baselines3 draws its minibatches from NumPy's global generator.
    _, keys, *rest = np.random.get_state()  # noqa: NPY002
    memory = Memory({"numpy": np.array(keys)}, {"numpy": rest})
    memory.put("torch", of_torch_generators(model.device))
    memory.values["actions"] = model.action_space.np_random.bit_generator.state
    return memory


def _into_generators(model: BaseAlgorithm, memory: Memory) -> None:
    into_torch_generators(model.device, memory.under("torch"))
    np.random.set_state(("MT19937", memory.arrays["numpy"], *memory.values["numpy"]))  # noqa: NPY002
    model.action_space.np_random.bit_generator.state = memory.values["actions"]
