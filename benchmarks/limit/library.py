"""The C++ limit as a Python object: compiled when first needed, called through ctypes."""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from itertools import accumulate
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from train.shared.run_folder import write_atomically

SOURCE: Final = Path(__file__).with_name("limit.cpp")
FLAGS: Final = ("-O3", "-march=native", "-ffast-math", "-fopenmp", "-fPIC")
LINK_FLAGS: Final = ("-shared", "-fopenmp")
"""Without -ffast-math: that would link code which changes the floating-point mode of whoever loads the library."""
BUILD: Final = Path(__file__).parents[2] / "build" / "benchmarks"

_SIZES: Final = {
    "load_position": 3,
    "load_velocity": 3,
    "drum_angle": 1,
    "drum_speed": 1,
    "omega1": 1,
    "omega2": 1,
    "peak_tension": 1,
    "mass": 1,
    "gravity": 1,
    "target": 1,
    "axial_stiffness": 1,
    "rope_damping": 1,
    "free_length": 1,
    "drum_to_pulley": 1,
    "drum_radius": 1,
    "max_speed": 1,
    "max_acceleration": 1,
    "path": 18,
}
_FIRST: Final = dict(zip(_SIZES, accumulate(_SIZES.values(), initial=0), strict=False))


class NoCompiler(RuntimeError):
    """There is no C++ compiler, or it fails."""


def compiler() -> str:
    """Path of the C++ compiler: $CXX, or g++, or clang++."""
    for name in (os.environ.get("CXX"), "g++", "clang++"):
        found = shutil.which(name) if name else None
        if found is not None:
            return found
    raise NoCompiler("no C++ compiler: set CXX, or install g++ or clang++")


def compiler_version() -> str:
    """First line of the compiler's version."""
    return _run([compiler(), "--version"]).splitlines()[0]


def compile_library() -> Path:
    """Compile the limit unless this source, with this compiler on this machine, has been compiled before."""
    key = hashlib.sha256(SOURCE.read_bytes())
    key.update(" ".join((compiler_version(), platform.node(), *FLAGS, *LINK_FLAGS)).encode())
    path = BUILD / f"limit-{key.hexdigest()[:16]}.so"
    if not path.exists():
        write_atomically(path, _compile)
    return path


def _compile(path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        compiled = str(Path(folder) / "limit.o")
        _run([compiler(), *FLAGS, "-c", "-o", compiled, str(SOURCE)])
        _run([compiler(), *LINK_FLAGS, "-o", str(path), compiled])


def _run(command: list[str]) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except subprocess.CalledProcessError as error:
        raise NoCompiler(f"{Path(command[0]).name}: {error.stderr.strip().splitlines()[0]}") from error
    return done.stdout


class Limit:
    """Rows of the model, without a sea, advanced by compiled C++; quantities by name, SI."""

    def __init__(self, rows: int, substeps: int, period: float, dtype: type = np.float64, threads: int = 1) -> None:
        """``rows`` is a multiple of the lanes of a block; ``substeps`` RK4 steps in a control step of ``period`` s."""
        library = ctypes.CDLL(str(compile_library()))
        self.lanes: Final = int(library.limit_lanes())
        if rows % self.lanes:
            raise ValueError(f"rows = {rows}: must be a multiple of {self.lanes}")
        slots = sum(_SIZES.values())
        assert slots == library.limit_slots()
        self.rows = rows
        self._blocks = np.zeros((rows // self.lanes, slots, self.lanes), dtype=dtype)
        self._step = getattr(library, f"limit_step_{'float' if dtype is np.float32 else 'double'}")
        self._step.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_long, ctypes.c_int, ctypes.c_double]
        self._step.argtypes += [ctypes.c_int]
        self._step.restype = None
        self._rest = (len(self._blocks), substeps, float(period), threads)

    def read(self, name: str) -> npt.NDArray[Any]:
        """Copy a quantity of all rows: (rows, size)."""
        return self._slots(name).transpose(0, 2, 1).reshape(self.rows, -1).copy()

    def write(self, name: str, values: npt.ArrayLike) -> None:
        """Set a quantity of all rows from values that broadcast to (rows, size)."""
        rows = np.broadcast_to(values, (self.rows, _SIZES[name]))
        self._slots(name)[...] = rows.reshape(len(self._blocks), self.lanes, -1).transpose(0, 2, 1)

    def _slots(self, name: str) -> npt.NDArray[Any]:
        return self._blocks[:, _FIRST[name] : _FIRST[name] + _SIZES[name]]

    def step(self, commands: npt.NDArray[Any]) -> None:
        """Make one control step with the drum speed commands (rows,) rad/s, of the limit's own dtype."""
        assert commands.dtype == self._blocks.dtype
        assert commands.shape == (self.rows,)
        blocks, *rest = self._rest
        self._step(self._blocks.ctypes.data, commands.ctypes.data, blocks, *rest)
