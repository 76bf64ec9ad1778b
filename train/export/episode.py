"""A held-out lift as CSV: what goes into the model at every step, and what it commands."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from aframe_env.scenario import Scenario
from aframe_env.simulation import Simulation
from agents.learned.agent import LearnedPolicy
from agents.rollout import noise_seeds
from train.export.check import Lifts, task_of
from train.export.interface import readings_of, told_of
from train.export.session import Session
from train.shared.run_folder import write_atomically


def write_episode(path: Path, agent: LearnedPolicy, model: Path, scenario: Scenario) -> None:
    """Run the model through a scenario; a row for each step: readings, told values, drum speed."""
    simulation = Simulation(1, task_of(agent, scenario))
    simulation.reset_rows(np.arange(1), [(scenario, noise_seeds(0, 1)[0])])
    session, lifts = Session(model), Lifts(agent, [scenario])
    told, state = lifts.told(simulation.observe())[0], np.zeros(session.state_size)
    rows = []
    for _ in range(simulation.episode_steps):
        readings = lifts.readings(simulation.observe())[0]
        drum_speed, _, state = session.step(readings, told, state)
        rows.append([*readings.tolist(), *told.tolist(), drum_speed])
        simulation.advance(np.array([drum_speed]))

    def write(temporary: Path) -> None:
        with temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow([*readings_of(agent.card).names, *told_of(agent.card).names, "drum_speed"])
            writer.writerows(rows)

    write_atomically(path, write)
