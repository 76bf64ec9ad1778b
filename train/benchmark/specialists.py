"""The recurrent agents that the package brings for a task: each was trained on one."""

from __future__ import annotations

from typing import Literal

from aframe_env.suite import Task
from aframe_env.text import read_json
from agents import shipped
from agents.learned import recurrent


def specialists(task: Task, observation: Literal["state", "sensors"] | None = None) -> list[str]:
    """Names of the agents that were trained on this task, on this observation or on either."""
    found = []
    for name, folder in shipped.RECURRENT.items():
        card = read_json(min(folder.glob(f"seed-*/{recurrent.CARD}")), "agent")
        if card["task"] == task.id and observation in (None, card["observation"]):
            found.append(name)
    return found
