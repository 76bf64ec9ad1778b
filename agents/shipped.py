"""The agents, the drive map and the tasks' ceilings that come with the package, by name."""

from __future__ import annotations

from pathlib import Path
from typing import Final

_IN_A_WHEEL: Final = Path(__file__).parent / "data"
_IN_A_CHECKOUT: Final = Path(__file__).parents[1] / "results"
_ROOT: Final = _IN_A_WHEEL if _IN_A_WHEEL.is_dir() else _IN_A_CHECKOUT

_FOLDERS: Final = sorted(_ROOT.glob("agents/*/"))
RECURRENT: Final[dict[str, Path]] = {
    folder.name: folder for folder in _FOLDERS if any(folder.glob("seed-*/recurrent.json"))
}
"""Folders of the recurrent agents. A wheel has one seed of each, a checkout all."""
AGENTS: Final[dict[str, Path]] = {folder.name: folder for folder in _FOLDERS if folder.name not in RECURRENT}
"""Folders of all others, the agents on features, likewise."""
DRIVE_MAP: Final = "drive-map"


def folder(place: str | Path) -> Path:
    """Return the folder of what is shipped under a name, or else that path; "./ppo" is always a path."""
    if place == DRIVE_MAP:
        return _ROOT / DRIVE_MAP
    return {**AGENTS, **RECURRENT}.get(place, Path(place)) if isinstance(place, str) else place


def task_folder(name: str) -> Path:
    """Return the folder of what was computed once for a task of the suite."""
    return _ROOT / "tasks" / name.lower()
