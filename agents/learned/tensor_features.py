"""Features of the learned agents, as in ``features``, for tensors on any device, without a way by the processor."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt
import torch

from aframe_env.scenario.crane import GRAVITY, Crane
from aframe_env.task import STATE
from aframe_env.validation import InvalidValue
from agents.control.kalman import WaveBank, exponents, foretelling, schedule
from agents.control.regulator import GRID, LEAST_WEIGHT, gain_table
from agents.control.winch import WinchModel
from agents.learned.features import (
    AHEAD,
    LIMIT,
    RISES,
    STATE_REGULATOR,
    FeatureConfig,
    HoistFeatures,
    wanted_turn,
)

_Invert = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]
"""(wanted turns, drum speeds), both (N,) float64 → commands (N,)."""


class TensorFeatures:
    """``Features`` of N rows on the full state, that all have one crane."""

    def __init__(
        self, rows: int, crane: Crane, config: FeatureConfig, device: torch.device | str, *, cuda: bool
    ) -> None:
        """``cuda``: whether the tensors are on a CUDA device, or in numba's simulator of one."""
        if config.sensors is not None:
            raise InvalidValue("sensors: the features of tensors must be of the full state")
        self._crane, self._period, self._action = crane, config.control_period, config.action
        self._invert: _Invert
        if cuda:
            from agents.control.winch_cuda import invert_winches

            self._invert = partial(invert_winches, crane.winch, config.control_period)
        else:
            self._invert = _OnTheProcessor(crane, config.control_period)

        def on_device(array: npt.NDArray[np.float64] | npt.NDArray[np.complex128]) -> torch.Tensor:
            return torch.from_numpy(np.ascontiguousarray(array)).to(device)

        bank = WaveBank.of(config.waves, None)
        gains = schedule(bank, config.control_period, 1)
        self._last_gain = len(gains.rate) - 1
        self._gain = on_device(gains.rate[:, :-1])
        """(K, bands) gains of a reading of the heave rate, the last of which repeats."""
        self._transition = on_device(np.exp(exponents(bank) * config.control_period))
        factors = foretelling(exponents(bank), np.array(AHEAD), np.array(RISES), 0.0)
        # Σ Re(f z) = Re f · Re z - Im f · Im z: one product of real numbers, with the parts of a phasor in turn.
        self._factors = on_device(np.stack([factors.real, -factors.imag], axis=2).reshape(len(factors), -1).T)
        """(2 bands, A + R)."""
        self._grid = on_device(GRID)
        self._table = on_device(gain_table(STATE_REGULATOR.damping_ratio, STATE_REGULATOR.effort, config.control_period))
        self._waves = torch.zeros((rows, len(self._transition)), dtype=torch.complex128, device=device)
        """Oscillators (N, bands), whose real parts' sum is the pulley's heave rate, m/s."""
        self._step = torch.zeros(rows, dtype=torch.int64, device=device)
        """(N,) control steps since each row's start."""
        self._weight, self._frequency, self._rise, self._speed = torch.ones(
            (4, rows), dtype=torch.float64, device=device
        )
        """(N,) weight N of the loads as the first tension told, frequency rad/s of their bobbing, and, at the last
        look, rise m of the pulley in the coming control step and drum's speed rad/s."""
        self._k = torch.zeros((4, rows), dtype=torch.float64, device=device)
        """Gains of the regulator."""

    def look(self, observation: torch.Tensor, first: torch.Tensor) -> torch.Tensor:
        """Features (N, F) float32 of observations (N, K) float32, one control step after those of the last call.

        ``first`` (N,) bool: rows at the first observation of their episode, whose past is forgotten.
        """
        o = _columns(observation)
        self._begin(o, first)
        innovation = self._follow(o["pulley_velocity_z"], first)
        winch, period = self._crane.winch, self._period
        velocity, acceleration = o["pulley_velocity_z"], o["pulley_acceleration_z"]
        self._rise = period * (velocity + 0.5 * period * acceleration)
        self._speed = o["drum_speed"]
        rope_speed = winch.drum_radius * self._speed
        rope = self._crane.rope
        stretch = (o["rope_tension"] - self._weight) * o["rope_length"] / rope.axial_stiffness
        z = (o["depth_error"], o["load_velocity_z"], o["depth_error"] + stretch, velocity - rope_speed)
        hoist = HoistFeatures(
            mass=self._weight / GRAVITY,
            rope_length=o["rope_length"],
            frequency=self._frequency,
            max_rope_speed=torch.full_like(velocity, winch.drum_radius * winch.max_speed),
            max_rope_acceleration=torch.full_like(velocity, winch.drum_radius * winch.max_acceleration),
            k=self._k,
            share=STATE_REGULATOR.share,
            period=period,
        )
        alone = torch.stack(
            [
                *hoist.of_the_load(torch, z),
                *hoist.of_the_winch(torch, rope_speed, self._rise / period),
                velocity,
                acceleration,
                0.5 * o["pulley_heave"],
                *hoist.constant(),
            ],
            dim=1,
        )
        foretold = torch.view_as_real(self._waves).flatten(1) @ self._factors
        features = torch.cat([alone, foretold, 10.0 * innovation[:, None]], dim=1)
        return torch.clip(features, -LIMIT, LIMIT).to(torch.float32)

    def command(self, output: torch.Tensor) -> torch.Tensor:
        """Drum speed commands (N, 1) rad/s for a network's output (N, 1), in [-1, 1], to the last look."""
        winch, outputs = self._crane.winch, output[:, 0].double()
        if self._action == "speed":
            return (torch.clip(outputs, -1.0, 1.0) * winch.max_speed)[:, None].to(torch.float32)
        turn = wanted_turn(torch, self._rise, outputs, winch.drum_radius, winch.max_acceleration, self._period)
        return self._invert(turn, self._speed)[:, None].to(torch.float32)

    def _begin(self, o: dict[str, torch.Tensor], first: torch.Tensor) -> None:
        """Weigh the loads of the ``first`` rows, and look their gains up."""
        # On all rows, and kept in those that begin: a choice of rows would have to wait for the device.
        weight = torch.clip(o["rope_tension"], LEAST_WEIGHT, None)
        frequency = torch.sqrt(self._crane.rope.axial_stiffness / (o["rope_length"] * (weight / GRAVITY)))
        self._weight = torch.where(first, weight, self._weight)
        self._frequency = torch.where(first, frequency, self._frequency)
        above = torch.clip(torch.searchsorted(self._grid, frequency), 1, len(GRID) - 1)
        low, high = self._grid[above - 1], self._grid[above]
        share = torch.clip((frequency - low) / (high - low), 0.0, 1.0)
        k = torch.lerp(self._table[:, above - 1], self._table[:, above], share)
        self._k = torch.where(first, k, self._k)

    def _follow(self, heave_rate: torch.Tensor, first: torch.Tensor) -> torch.Tensor:
        """Take the pulley's heave rate (N,) m/s; return what was not foretold of it, (N,) m/s; 0 in ``first`` rows."""
        self._step = torch.where(first, 0, self._step + 1)
        waves = self._waves * self._transition
        innovation = torch.where(first, 0.0, heave_rate - waves.real.sum(dim=1))
        gain = self._gain[torch.clip(self._step, None, self._last_gain)]
        self._waves = torch.where(first[:, None], 0.0, waves + innovation[:, None] * gain)
        return innovation


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
