"""How the physics is compiled: decorators for scalar functions and kernels, and a cache that is never stale."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import config, njit, types
from numba.extending import intrinsic

F = TypeVar("F", bound=Callable[..., Any])

# No fastmath: a row must give the same bits in a batch, alone, and in any block. Division follows IEEE 754,
# since a check for zero in the inner loop would keep it from being vectorised.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "boundscheck": False, "nogil": True}


def scalar(function: F) -> F:
    """Compile a function of plain floats that is inlined wherever it is called."""
    return cast(F, njit(forceinline=True, **_OPTIONS)(function))


def kernel(function: F) -> F:
    """Compile a loop over rows, cached on disk."""
    return cast(F, njit(cache=True, **_OPTIONS)(function))


def parallel_kernel(function: F) -> F:
    """Compile a loop over rows that spreads over the cores, cached on disk."""
    return cast(F, njit(cache=True, parallel=True, **_OPTIONS)(function))


def _fused(typing_context, a, b, c):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        doubles = [
            context.cast(builder, value, own, signature.return_type)
            for value, own in zip(arguments, signature.args, strict=True)
        ]
        return builder.fma(*doubles)

    return types.float64(a, b, c), generate


def _rounded_twice(a: float, b: float, c: float) -> float:
    return a * b + c


# Uncompiled, as numba's CUDA simulator needs it, Python has nothing better before 3.13.
_fused_multiply_add: Any = _rounded_twice if config.DISABLE_JIT else intrinsic(_fused)


@scalar
def fma(a: float, b: float, c: float) -> float:
    """a b + c, rounded once: half the instructions, and the same bits however the compiler arranges the loop."""
    result: float = _fused_multiply_add(a, b, c)
    return result


@cache
def source_digest() -> str:
    """Digest of the sources of whatever compiled code calls: the physics, and the random numbers.

    numba invalidates a cached kernel when the kernel's own file changes, not when a function that it calls does.
    A kernel that closes over this digest is compiled anew after any change.
    """
    digest = hashlib.sha256()
    physics = Path(__file__).parent
    for path in sorted([*physics.rglob("*.py"), physics.parent / "random.py"]):
        digest.update(path.read_bytes())
    return digest.hexdigest()
