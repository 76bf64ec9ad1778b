"""The agents that the package brings for a task, each of which was trained on one, and what they foretell."""

from __future__ import annotations

from typing import Literal

from aframe_env.config import TaskConfig
from aframe_env.suite import Task
from aframe_env.text import read_json
from agents import shipped
from agents.learned import agent, recurrent


def specialists(task: Task, observation: Literal["state", "sensors"] | None = None) -> list[str]:
    """Names of the agents that were trained on this task, on this observation or on either."""
    found = []
    for folders, file in ((shipped.RECURRENT, recurrent.CARD), (shipped.AGENTS, agent.CARD)):
        for name, folder in folders.items():
            card = read_json(min(folder.glob(f"seed-*/{file}")), "agent")
            # Cards from before agents said what they were trained on are those of the nominal task.
            if card.get("task") == task.id and observation in (None, card["observation"]):
                found.append(name)
    return found


def forecasters(task: Task) -> list[str]:
    """Predictive control on the forecasts of these agents, where they act on sensors and no radar foretells further."""
    sensors = TaskConfig(**task.arguments).sensors
    foretold = sensors is not None and sensors.preview is not None
    names = [name for name in specialists(task, "sensors") if name in shipped.RECURRENT]
    return [] if foretold else [f"{name}:forecasts" for name in names]
