"""The CUDA device, and numba's views of torch's tensors and streams."""

from __future__ import annotations

import warnings
from importlib.util import find_spec
from typing import Any

import torch
from gymnasium.error import DependencyNotInstalled
from numba.core import config

from aframe_env.validation import InvalidValue


def simulated() -> bool:
    """Return whether numba's simulator stands in for the device; tensors then live in the computer's memory."""
    return bool(config.ENABLE_CUDASIM)


def open_device(name: str) -> torch.device:
    """Return the device ``name`` ("cuda" or "cuda:N"), ready to launch kernels on.

    Raises:
        DependencyNotInstalled: numba-cuda is missing.
        InvalidValue: There is no such device.
    """
    if simulated():
        if not config.DISABLE_JIT:
            raise InvalidValue("NUMBA_ENABLE_CUDASIM = 1: set NUMBA_DISABLE_JIT = 1, too")
        return torch.device("cpu")
    count = torch.cuda.device_count()
    if not count:
        reason = f"sees none (CUDA {torch.version.cuda})" if torch.version.cuda else "is built without CUDA"
        raise InvalidValue(
            f"device = {name!r}: no CUDA device: PyTorch {torch.__version__} {reason}; "
            "device = 'cpu' runs the same environment on the processor"
        )
    if find_spec("numba_cuda") is None:
        raise DependencyNotInstalled('numba-cuda is not installed: pip install "aframe-heave[cuda]"')
    index = torch.device(name).index
    index = torch.cuda.current_device() if index is None else index
    if index >= count:
        raise InvalidValue(f"device = {name!r}: must be 'cuda' or one of 'cuda:0' to 'cuda:{count - 1}'")
    from numba import cuda

    if not cuda.is_available():
        raise InvalidValue(f"device = {name!r}: PyTorch sees it, numba-cuda does not: {cuda.cuda_error()}")
    # Of every launch with fewer than 128 blocks; few rows are no mistake.
    warnings.filterwarnings("ignore", message="Grid size")
    device = torch.device("cuda", index)
    torch.zeros(1, device=device)  # torch makes the device's context, numba joins it
    cuda.select_device(index)
    return device


def view(tensor: torch.Tensor) -> Any:
    """Return the tensor as numba sees it: the same memory."""
    if simulated():
        return tensor.numpy()
    from numba import cuda

    return cuda.as_cuda_array(tensor, sync=False)


def stream(device: torch.device) -> Any:
    """Return torch's present stream as numba sees it: kernels and torch's own work keep their order."""
    if simulated():
        return 0
    from numba import cuda

    handle = torch.cuda.current_stream(device).cuda_stream
    return cuda.external_stream(handle) if handle else 0
