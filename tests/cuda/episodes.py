"""Episodes that the rows of a GPU and those of the processor are held together on.

As a program, ``python tests/cuda/episodes.py FILE.npz`` runs them all on device "cuda" and writes what came out.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import torch

from aframe_env import (
    Crane,
    HarmonicMotion,
    LoadShape,
    RecordedMotion,
    Rope,
    Scenario,
    ScenarioDistribution,
    Water,
    Winch,
)
from aframe_env.torch_env import GROUP, AFrameHeaveTorchEnv


class Case(NamedTuple):
    """Arguments of an environment, its rows, and how many steps it makes."""

    arguments: dict[str, Any]
    rows: int = 3
    steps: int = 8


_TIMES = np.linspace(0.0, 2.0, 21)
RECORDED = RecordedMotion(times=_TIMES, coordinates=np.outer(np.sin(_TIMES), [0.5, 0.2, 1.0, 0.02, 0.03, 0.01]))
LAGGING = Crane(winch=Winch(lag=0.3))
FRAGILE = Crane(rope=Rope(breaking_load=1.0e6))
WET = Scenario.paper(
    crane=Crane(rope=Rope.six_strand()),
    target_level=-1000.0,
    water=Water(current=((0.0, 0.5, 0.2), (300.0, -0.1, 0.3))),
    load=LoadShape(volume=12.7, added_mass_vertical=8e4, added_mass_horizontal=3e4, drag_area_vertical=60.0),
)

CASES = {
    "random seas": Case({"episode_duration": 0.5}),
    "more rows than a block has": Case(
        {"scenario": ScenarioDistribution(components=4, rope_length=(500.0, 1500.0)), "episode_duration": 0.2}, 66, 3
    ),
    "short-crested seas": Case(
        {
            "scenario": ScenarioDistribution(spreading=3, gamma=(1.0, 5.0), components=5, crane=LAGGING, ramp=0.0),
            "control_period": 0.25,
            "episode_duration": 1.0,
        }
    ),
    "one sea state": Case(
        {
            "scenario": ScenarioDistribution(
                hs=3.0,
                tp=9.0,
                heading=math.pi,
                spectrum="pierson-moskowitz",
                load_mass=5e4,
                rope_length=200.0,
                components=8,
            ),
            "max_inner_step": 0.01,
        }
    ),
    "no sea": Case(
        {"scenario": Scenario(motion=HarmonicMotion(), load_mass=8e4, target_level=-100.0), "episode_duration": 0.4}
    ),
    "the paper's motion": Case({"scenario": Scenario.paper("rest", crane=LAGGING), "episode_duration": 0.6}),
    "a recorded motion": Case({"scenario": Scenario(motion=RECORDED, load_mass=3e4), "episode_duration": 0.7}),
    "a rope that parts": Case({"scenario": Scenario.paper(crane=FRAGILE), "episode_duration": 1.0}),
    "a rope with mass, in water": Case({"scenario": WET, "episode_duration": 0.3}, 2, 5),
    "a load in water on a short rope": Case({"scenario": replace(WET, target_level=-60.0), "episode_duration": 0.4}),
}


def env(name: str, device: str, seed: int = 11) -> AFrameHeaveTorchEnv:
    return AFrameHeaveTorchEnv(CASES[name].rows, device=device, seed=seed, **CASES[name].arguments)


def actions(rows: int, steps: int) -> list[torch.Tensor]:
    """Drum speeds (steps) of (rows, 1) rad/s: up, down and beyond the winch's limit."""
    drawn = np.random.default_rng(3).uniform(-6.0, 6.0, (steps, rows, 1))
    return list(torch.from_numpy(drawn.astype(np.float32)))


def episodes(name: str, device: str) -> dict[str, np.ndarray]:
    """Observations (steps + 1, rows, 14) and what else a step returns, over more than one episode.

    Halfway other rows take over, from the state of these.
    """
    rows = env(name, device)
    seen: dict[str, list[np.ndarray]] = {"observation": [rows.get_observations()[GROUP].cpu().numpy()]}
    for step, action in enumerate(actions(CASES[name].rows, CASES[name].steps)):
        if step == CASES[name].steps // 2:
            state = rows.get_state()
            rows = env(name, device, seed=5)
            rows.set_state(state)
        observation, reward, done, extras = rows.step(action.to(rows.device))
        for key, value in {"observation": observation[GROUP], "reward": reward, "done": done, **extras}.items():
            seen.setdefault(key, []).append(value.cpu().numpy().copy())
    return {key: np.stack(values) for key, values in seen.items()}


def main() -> None:
    results = {f"{name}/{key}": value for name in CASES for key, value in episodes(name, "cuda").items()}
    np.savez(sys.argv[1], **results)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
