"""Inverse of the winch on a CUDA device, one thread a winch."""

from __future__ import annotations

from functools import cache
from typing import Any

import torch
from numba import cuda

from aframe_env.cuda.device import stream, view
from aframe_env.scenario.crane import Winch
from agents.control.winch import command_for

_THREADS = 128


def invert(turn: Any, speed: Any, limit: float, acceleration: float, lag: float, period: float, command: Any) -> None:
    """Kernel: find ``command`` (N,) of equal winches for wanted turns (N,) in a control step."""
    i = cuda.grid(1)
    if i < turn.shape[0]:
        command[i] = command_for(turn[i], speed[i], limit, acceleration, lag, period)


@cache
def _kernel() -> Any:
    return cuda.jit(invert)


def invert_winches(winch: Winch, period: float, turn: torch.Tensor, speed: torch.Tensor) -> torch.Tensor:
    """Find commands (N,) rad/s that turn equal winches by ``turn`` (N,) rad in ``period`` s, or as near as may be.

    ``speed`` (N,) rad/s: the drums' speed now. All float64, on one device.
    """
    command = torch.empty_like(turn)
    blocks = -(-len(turn) // _THREADS)
    _kernel()[blocks, _THREADS, stream(turn.device)](
        view(turn), view(speed), winch.max_speed, winch.max_acceleration, winch.lag, period, view(command)
    )
    return command
