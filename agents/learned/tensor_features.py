"""Features of the learned agents, as in ``features``, for tensors on any device, without a way by the processor."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import torch

from aframe_env.scenario.crane import GRAVITY, Crane
from aframe_env.task import STATE
from agents.control.winch import WinchModel
from agents.learned.features import LIMIT, STATE_FEATURES, coming_rise, of_the_state, wanted_turn

_Invert = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]
"""(wanted turns, drum speeds), both (N,) float64 → commands (N,)."""


class TensorStateFeatures:
    """``StateFeatures`` of N rows that all have one crane. It has no memory: every call stands for itself."""

    names = STATE_FEATURES

    def __init__(self, crane: Crane, control_period: float, *, cuda: bool) -> None:
        """``cuda``: whether the tensors are on a CUDA device, or in numba's simulator of one."""
        self._crane = crane
        self._period = control_period
        self._invert: _Invert
        if cuda:
            from agents.control.winch_cuda import invert_winches

            self._invert = partial(invert_winches, crane.winch, control_period)
        else:
            self._invert = _OnTheProcessor(crane, control_period)

    def look(self, observation: torch.Tensor) -> torch.Tensor:
        """Features (N, F) float32 of observations (N, K) float32."""
        o = _columns(observation)
        radius, axial_stiffness = self._crane.winch.drum_radius, self._crane.rope.axial_stiffness
        mass, length = o["load_mass"], o["rope_length"]
        first_length = length - radius * o["drum_angle"]
        features = of_the_state(
            torch,
            o,
            radius,
            stretch=(o["rope_tension"] - mass * GRAVITY) * length / axial_stiffness,
            frequency=torch.sqrt(axial_stiffness / (first_length * mass)),
        )
        return torch.clip(torch.stack(features, dim=1), -LIMIT, LIMIT).to(torch.float32)

    def command(self, observation: torch.Tensor, output: torch.Tensor) -> torch.Tensor:
        """Drum speed commands (N, 1) rad/s for a network's output (N, 1), in [-1, 1], to observations (N, K)."""
        o, winch = _columns(observation), self._crane.winch
        rise = coming_rise(o, self._period)
        turn = wanted_turn(torch, rise, output[:, 0].double(), winch.drum_radius, winch.max_acceleration, self._period)
        return self._invert(turn, o["drum_speed"])[:, None].to(torch.float32)


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
