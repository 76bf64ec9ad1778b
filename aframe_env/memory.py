"""The machine's memory, and a refusal of what cannot fit into it: the kernel would end the process without a word."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import Final

from aframe_env.validation import InvalidValue

GIB: Final = 2**30
"""bytes."""
_CGROUPS: Final = Path("/sys/fs/cgroup")
_OWN_CGROUPS: Final = Path("/proc/self/cgroup")


def require_memory(what: str, size: float) -> None:
    """Raise where ``size`` bytes, which ``what`` (a name and its value) surely takes, are more than there are."""
    there = machine_memory()
    if there is not None and size > there:
        raise InvalidValue(f"{what}: needs {_shown(size)} of memory: the machine has {_shown(there)}")


@cache
def machine_memory() -> int | None:
    """Physical memory, or the control group's limit where that is lower, bytes; None where nothing tells."""
    known = [size for size in (_physical(), *group_limits()) if size is not None]
    return min(known, default=None)


def _physical() -> int | None:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not on Windows
        return None


def group_limits(root: Path = _CGROUPS, own: Path = _OWN_CGROUPS) -> list[int]:
    """Limits of the process's control groups and of those around them, of either version, bytes."""
    try:
        lines = own.read_text(encoding="utf-8").splitlines()
    except OSError:  # Linux only
        return []
    found = []
    for line in lines:
        _, controllers, group = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        top = root / "memory" if controllers else root
        name = "memory.limit_in_bytes" if controllers else "memory.max"
        # In a container the group's path may be the host's, and the container's own group stands at the top.
        folder = top / group.lstrip("/")
        for each in (folder, *(parent for parent in folder.parents if parent.is_relative_to(top))):
            try:
                text = (each / name).read_text(encoding="utf-8").strip()
            except OSError:
                continue
            if text.isdecimal():  # else "max"
                found.append(int(text))
    return found


def _shown(size: float) -> str:
    return f"{size / GIB:.3g} GiB" if size >= 0.1 * GIB else f"{size / 2**20:.3g} MiB"
