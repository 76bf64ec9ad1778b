"""Features of the learned agents, as in ``features``, for tensors on any device, without a way by the processor."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import torch

from aframe_env.scenario.crane import GRAVITY, Crane
from aframe_env.task import STATE
from aframe_env.validation import InvalidValue
from agents.control.lift import LEAST_WEIGHT
from agents.control.winch import WinchModel
from agents.learned.features import LIMIT, FeatureConfig, lift_features, load_features, wanted_turn

_Invert = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]
"""(wanted turns, drum speeds), both (N,) float64 → commands (N,)."""


class TensorFeatures:
    """``Features`` of N rows on the full state, that all have one crane with a light rope in air."""

    def __init__(
        self, rows: int, crane: Crane, config: FeatureConfig, device: torch.device | str, *, cuda: bool
    ) -> None:
        """``cuda``: whether the tensors are on a CUDA device, or in numba's simulator of one."""
        if config.sensors is not None:
            raise InvalidValue("sensors: the features of tensors must be of the full state")
        if config.action == "predictive":
            raise InvalidValue(f"action = {config.action!r}: no such plans are made for tensors")
        if config.winch:
            raise InvalidValue("winch = True: rows of tensors have one winch for all: must be False")
        self._crane, self._period, self._action = crane, config.control_period, config.action
        self._invert: _Invert
        if cuda:
            from agents.control.winch_cuda import invert_winches

            self._invert = partial(invert_winches, crane.winch, config.control_period)
        else:
            self._invert = _OnTheProcessor(crane, config.control_period)
        self._weight, self._frequency, self._rise, self._speed = torch.ones(
            (4, rows), dtype=torch.float64, device=device
        )
        """(N,) weight N of the loads as the first tension told, frequency rad/s of their bobbing, and, at the last
        look, rise m of the pulley in the coming control step and drum's speed rad/s."""

    def look(self, observation: torch.Tensor, first: torch.Tensor) -> torch.Tensor:
        """Features (N, F) float32 of observations (N, K) float32, one control step after those of the last call.

        ``first`` (N,) bool: rows at the first observation of their episode, whose past is forgotten.
        """
        o = _columns(observation)
        self._weigh(o, first)
        velocity, acceleration = o["pulley_velocity_z"], o["pulley_acceleration_z"]
        self._rise = self._period * (velocity + 0.5 * self._period * acceleration)
        self._speed = o["drum_speed"]
        stretch = (o["rope_tension"] - self._weight) * o["rope_length"] / self._crane.rope.axial_stiffness
        rope_end_speed = velocity - self._crane.winch.drum_radius * self._speed
        z = (o["depth_error"], o["load_velocity_z"], o["depth_error"] + stretch, rope_end_speed)
        features = (
            *load_features(torch, z),
            velocity,
            acceleration,
            *lift_features(o["pulley_heave"], self._weight / GRAVITY, o["rope_length"], self._frequency),
        )
        return torch.clip(torch.stack(features, dim=1), -LIMIT, LIMIT).to(torch.float32)

    def command(self, output: torch.Tensor) -> torch.Tensor:
        """Drum speed commands (N, 1) rad/s for a network's output (N, 1), in [-1, 1], to the last look."""
        winch, outputs = self._crane.winch, output[:, 0].double()
        if self._action == "speed":
            return (torch.clip(outputs, -1.0, 1.0) * winch.max_speed)[:, None].to(torch.float32)
        turn = wanted_turn(torch, self._rise, outputs, winch.drum_radius, winch.max_acceleration, self._period)
        return self._invert(turn, self._speed)[:, None].to(torch.float32)

    def _weigh(self, o: dict[str, torch.Tensor], first: torch.Tensor) -> None:
        """Weigh the loads of the ``first`` rows."""
        # On all rows, and kept in those that begin: a choice of rows would have to wait for the device.
        weight = torch.clip(o["rope_tension"], LEAST_WEIGHT, None)
        frequency = torch.sqrt(self._crane.rope.axial_stiffness / (o["rope_length"] * (weight / GRAVITY)))
        self._weight = torch.where(first, weight, self._weight)
        self._frequency = torch.where(first, frequency, self._frequency)


def _columns(observation: torch.Tensor) -> dict[str, torch.Tensor]:
    """Quantities (N,) float64 by their names."""
    columns = observation.T.double().contiguous()
    return {quantity.name: columns[i] for i, quantity in enumerate(STATE)}


class _OnTheProcessor:
    """``WinchModel`` behind tensors."""

    def __init__(self, crane: Crane, control_period: float) -> None:
        self._crane, self._period = crane, control_period
        self._winches = WinchModel(0, control_period)

    def __call__(self, turn: torch.Tensor, speed: torch.Tensor) -> torch.Tensor:
        if len(self._winches.speed) != len(turn):
            self._winches = WinchModel(len(turn), self._period)
            self._winches.start([self._crane] * len(turn))
        self._winches.speed[:] = speed.numpy()
        return torch.from_numpy(self._winches.invert(turn.numpy()))
