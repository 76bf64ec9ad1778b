"""Exported controllers beside Python's: the same held-out lifts, step by step.

The loop is closed by the model. Python's controller looks on: it has the same readings and is told what command was
really given, and says what it would have commanded. What is compared is the speed that the drum has at the end of the
control step under either command. Two loops that are each closed for themselves can only be compared in what they
reach: an agent that drives the winch from limit to limit blows up the last digit of a reading within seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario
from aframe_env.simulation import Simulation
from aframe_env.task import OMEGA1, SENSED, STATE, Quantity
from agents.learned.agent import LearnedPolicy
from agents.policy import begin
from agents.rollout import noise_seeds, run
from train.export.interface import crane_values, readings_of, told_of
from train.export.session import Session

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How well a model agrees with Python."""

    drum_speed: FloatArray
    """(steps, N) difference of the drum's speed at the end of a step, as a share of the winch's.

    From Python with its network in double precision, as the model's is.
    """
    drum_speed_single: FloatArray
    """(steps, N) the same, from Python as it is, whose network is in single precision."""
    rms: FloatArray
    """(N,) root mean square depth error under the model, m."""
    rms_python: FloatArray
    """(N,) and under Python, in a loop of its own, m."""
    seconds: FloatArray
    """Time of every step of the model."""


class Lifts:
    """Inputs of the model for N lifts, out of the environment's observations."""

    def __init__(self, agent: LearnedPolicy, scenarios: Sequence[Scenario]) -> None:
        card = agent.card
        for scenario in scenarios:
            scenario.as_told.require_light("exported controllers")
        quantities: tuple[Quantity, ...] = STATE if card.sensors is None else SENSED
        self._places = {quantity.name: place for place, quantity in enumerate(quantities)}
        self._read, self._told = readings_of(card).names, told_of(card).names
        self._cranes = [crane_values(scenario.as_told.crane) for scenario in scenarios]

    def readings(self, observation: npt.NDArray[np.float32]) -> FloatArray:
        """Readings (N, R) of an observation (N, K)."""
        return observation[:, [self._places[name] for name in self._read]].astype(np.float64)

    def told(self, observation: npt.NDArray[np.float32]) -> FloatArray:
        """Told values (N, T), with the first observation (N, K)."""
        length = observation[:, self._places["rope_length"]].astype(np.float64)
        return np.array(
            [
                [({**crane, "rope_length": length[row]})[name] for name in self._told]
                for row, crane in enumerate(self._cranes)
            ]
        )


def task_of(agent: LearnedPolicy, scenario: Scenario) -> TaskConfig:
    """The task that the agent is made for."""
    card = agent.card
    return TaskConfig(control_period=card.control_period, observation=card.sensors or "state", scenario=scenario)


def check(agent: LearnedPolicy, model: Path, scenarios: Sequence[Scenario], *, noise_seed: int = 0) -> Agreement:
    """Run the model through the scenarios with Python looking on, and Python through the same by itself."""
    rows, card = len(scenarios), agent.card
    config = task_of(agent, scenarios[0])
    simulation = Simulation(rows, config)
    simulation.reset_rows(np.arange(rows), list(zip(scenarios, noise_seeds(noise_seed, rows), strict=True)))
    session, lifts = Session(model), Lifts(agent, scenarios)
    most = np.array([scenario.crane.winch.max_speed for scenario in scenarios])
    told = lifts.told(simulation.observe())
    states = [np.zeros(session.state_size) for _ in scenarios]
    onlookers = (agent.exact(), agent)
    for onlooker in onlookers:
        begin(onlooker, scenarios, card.control_period)
    differences = np.empty((2, simulation.episode_steps, rows))
    for step in range(simulation.episode_steps):
        observation = simulation.observe()
        readings, commands = lifts.readings(observation), np.empty(rows)
        for row in range(rows):
            commands[row], fault, states[row] = session.step(readings[row], told[row], states[row])
            assert not fault, "the environment keeps its readings within their ranges"
        for difference, onlooker in zip(differences, onlookers, strict=True):
            onlooker.act(observation, step * card.control_period)
            asked, given = onlooker.overrule(commands)
            difference[step] = abs(asked - given) / most
        simulation.advance(commands)
    python = run(agent, scenarios, config, noise_seed=noise_seed)
    return Agreement(
        drum_speed=differences[0],
        drum_speed_single=differences[1],
        rms=np.sqrt(simulation.results[:, OMEGA1] / simulation.episode_duration),
        rms_python=python.rms,
        seconds=np.array(session.seconds),
    )
