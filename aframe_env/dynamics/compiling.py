"""Compilation of the physics: decorators for scalar functions and kernels, and a cache that is never stale.

numba keeps what it has compiled in ``NUMBA_CACHE_DIR``, else beside the sources, else, where they are read-only, in the
user's cache folder. Where none of these can be written to, each process compiles for itself.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, Final, TypeVar, cast

from numba import njit, types
from numba.core import config, event
from numba.extending import intrinsic
from numba.np.ufunc.parallel import threading_layer

from aframe_env.dynamics.kernel_cache import KernelCache

_LOGGER = logging.getLogger("aframe_env")

_kernels: set[Callable[..., Any]] = set()

F = TypeVar("F", bound=Callable[..., Any])

# No fastmath: a row must give the same bits in a batch, alone, and in any block. Division follows IEEE 754,
# since a check for zero in the inner loop would keep it from being vectorised.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": False,
    "boundscheck": False,
    "nogil": True,
    "no_cfunc_wrapper": True,  # nobody passes a kernel's address on, and it takes time to compile
}


def scalar(function: F) -> F:
    """Compile a function of plain floats that is inlined wherever it is called."""
    return cast(F, njit(forceinline=True, **_OPTIONS)(function))


def kernel(function: F) -> F:
    """Compile a loop over rows, cached on disk."""
    return _cached(function)


def parallel_kernel(function: F) -> SpreadKernel:
    """Compile a loop (``prange``) over rows that spreads over the cores, and one that does not, cached on disk."""
    # Copies, as each takes a name of its own.
    serial, parallel = (
        FunctionType(function.__code__, function.__globals__, function.__name__, None, function.__closure__)
        for _ in range(2)
    )
    return SpreadKernel(_cached(serial), _cached(parallel, parallel=True))


@dataclass(frozen=True)
class SpreadKernel:
    """A loop over independent rows that spreads over the cores where it can, with the same bits.

    It cannot in a process forked from one whose threads have run: the child has none of them, and numba aborts it, or
    waits for ever.
    """

    serial: Callable[..., None]
    """The same loop on the calling thread; compiled when it is first called."""
    parallel: Callable[..., None]

    def __call__(self, *arguments: Any) -> None:
        """Run the loop."""
        if _threads.lost:
            self.serial(*arguments)
        elif _threads.safe:
            self.parallel(*arguments)
        else:
            with _threads.lock:
                self.parallel(*arguments)
                _threads.safe = _layer() in _SAFE_LAYERS


class _Threads:
    """What this process knows of numba's threads."""

    def __init__(self, lost: bool = False) -> None:
        self.lost = lost
        """Whether they have stayed behind in the process that this one was forked from."""
        self.safe = False
        """Whether they are known to take loops from two threads at once; numba chooses the layer at the first loop."""
        self.lock = threading.Lock()


_SAFE_LAYERS: Final = ("tbb", "omp")
"""The third, workqueue, ends the process when two threads run a loop at once."""


def _layer() -> str | None:
    """Name of numba's threading layer; None before the first parallel loop."""
    try:
        return cast(str, threading_layer())  # type: ignore[no-untyped-call]
    except ValueError:
        return None


def _after_fork() -> None:
    # A new lock too: a thread that the child has not may hold the old one.
    global _threads
    _threads = _Threads(lost=_threads.lost or _layer() is not None)


_threads = _Threads()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def _cached(function: F, **options: Any) -> F:
    # numba numbers a function's variants (other sources, other lanes) in one index, without a lock: of two processes
    # that compile at once, one could later be given the other's variant. A name of its own for each keeps them apart.
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    own_source = Path(function.__code__.co_filename).read_bytes()
    described = f"{source_digest()} {cells!r} {function.__code__.co_names} {options} "
    variant = hashlib.sha256(described.encode() + own_source).hexdigest()[:16]
    function.__qualname__ += f"-{variant}"
    _kernels.add(function)
    compiled = njit(**options, **_OPTIONS)(function)
    if not config.DISABLE_JIT:
        with contextlib.suppress(RuntimeError):  # no cache folder can be written to
            compiled._cache = KernelCache(function)
    return cast(F, compiled)


class _Announcer(event.Listener):
    """Announcement, once in a process, of a compilation: nothing else would be seen for many seconds."""

    def __init__(self) -> None:
        self._silent = False

    def on_start(self, event: Any) -> None:
        """Announce the compilation of a kernel that is not in the cache."""
        dispatcher = event.data["dispatcher"]
        if self._silent or dispatcher.py_func not in _kernels:
            return
        self._silent = True
        folder = dispatcher.stats.cache_path
        kept = (
            f"later runs find it in {folder}"
            if folder
            else "nothing can be kept, as no cache folder can be written to: set NUMBA_CACHE_DIR to one"
        )
        # A warning, since information is not shown by default.
        _LOGGER.warning(
            "aframe_env: compiling the physics for this processor, which takes up to half a minute; %s", kept
        )

    def on_end(self, event: Any) -> None:
        """Do nothing."""


event.register("numba:compile", _Announcer())  # type: ignore[no-untyped-call]


def _fused(typing_context, a, b, c):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        doubles = [
            context.cast(builder, value, own, signature.return_type)
            for value, own in zip(arguments, signature.args, strict=True)
        ]
        return builder.fma(*doubles)

    return types.float64(a, b, c), generate


def _selected(typing_context, condition, a, b):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.select(*arguments)

    return types.float64(types.boolean, types.float64, types.float64), generate


def _rounded_twice(a: float, b: float, c: float) -> float:
    return a * b + c


def _chosen(condition: bool, a: float, b: float) -> float:
    return a if condition else b


# In numba's CUDA simulator all of it runs as plain Python, which has no fma before 3.13.
_fused_multiply_add: Any = _rounded_twice if config.DISABLE_JIT else intrinsic(_fused)
_select_value: Any = _chosen if config.DISABLE_JIT else intrinsic(_selected)


@scalar
def fma(a: float, b: float, c: float) -> float:
    """a b + c, rounded once: half the instructions, and the same bits however the compiler arranges the loop."""
    result: float = _fused_multiply_add(a, b, c)
    return result


@scalar
def select(condition: bool, a: float, b: float) -> float:
    """a where the condition holds, else b.

    Python's own ``a if condition else b`` is a branch: where the result is stored over b, the compiler leaves that
    store out in some lanes, and masked stores cost more than all the arithmetic.
    """
    result: float = _select_value(condition, a, b)
    return result


@scalar
def larger(a: float, b: float) -> float:
    """The larger of two numbers."""
    return select(a > b, a, b)


@scalar
def smaller(a: float, b: float) -> float:
    """The smaller of two numbers."""
    return select(a < b, a, b)


@cache
def source_digest() -> str:
    """Digest of the sources of whatever compiled code calls: this package.

    numba finds a cached kernel stale when the kernel's own file changes, not when a function that it calls does.
    """
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
