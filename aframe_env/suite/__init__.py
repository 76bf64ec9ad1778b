"""The task suite: tasks in which something has to be learned, each with scenarios that are frozen for everybody.

A new task is a file here with a ``TASK``, a line below, and a section in ``docs/tasks.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from aframe_env.suite import deep_rope, landing, mru, preview, splash, storm, unknown
from aframe_env.suite.definition import SPLITS, Seeds, Split, Task
from aframe_env.validation import InvalidValue, shown

TASKS: Final[Mapping[str, Task]] = {
    task.name: task
    for task in (storm.TASK, unknown.TASK, deep_rope.TASK, preview.TASK, mru.TASK, splash.TASK, landing.TASK)
}
"""The tasks by name."""


def find_task(name: str) -> Task:
    """Return a task by its name, in capitals or not, or by its id of Gymnasium."""
    by_text = {text.lower(): task for task in TASKS.values() for text in (task.name, task.id)}
    if not isinstance(name, str) or name.lower() not in by_text:
        raise InvalidValue(f"task = {shown(name)}: must be one of {', '.join(map(repr, TASKS))}")
    return by_text[name.lower()]


__all__ = ["SPLITS", "TASKS", "Seeds", "Split", "Task", "find_task"]
