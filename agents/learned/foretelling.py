"""Predictive control that plans on the pulley's motion as a recurrent agent's memory foretells it.

Filters, plan and answer are those of adaptive predictive control, written by hand. Learned is by how much the forecasts
of the wave bank are wrong; of the network nothing else is asked, what it would do about the load least of all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Final

import numpy as np
import torch
from scipy.interpolate import CubicSpline

from aframe_env.scenario import Scenario
from aframe_env.validation import InvalidValue
from agents.control.lift import Lift
from agents.control.predictive import Planner, PlanningConfig
from agents.control.regulator import Observation
from agents.learned.recurrent import RecurrentCard
from agents.learned.recurrent_features import Memories
from agents.learned.recurrent_inputs import FORECASTS, RATES_AHEAD, Lookout, LookoutConfig, Outlook
from agents.learned.recurrent_network import RecurrentNetwork
from agents.policy import FloatArray, Knowledge

NAME: Final = "predictive control on learned forecasts"
HORIZON: Final = RATES_AHEAD[-1]
"""How far it plans, s: as far as is foretold. On 32 validation scenarios of Storm it has 96.0 % of the ceiling so, and
95.7 % if it plans 5 s, as other laws do on light ropes; these would go from 93.8 to 94.3 % with 7 s."""
BANKS_OWN: Final = (0.2, 0.4)
"""Until when the wave bank's forecasts stay as they are, and from when on they are corrected in full, s. The load's
state is estimated by the bank, too, and the gradients make something else of what is foretold of the next moments: with
that corrected 32 validation scenarios of MRU have 83.9 % of the ceiling, so they have 89.6 %."""


class Foretelling:
    """What a network's memory makes of the readings of N lifts that run in step."""

    def __init__(self, rows: int, network: RecurrentNetwork, made_for: LookoutConfig) -> None:
        self._network = network
        self._lookout = Lookout(rows, made_for)
        self._memories = Memories(rows, network)

    def start(self, observation: Observation, lifts: Sequence[Lift]) -> FloatArray:
        """Begin with first observations (N, K); return corrections (N, FORECASTS) of the wave bank's forecasts."""
        return self._corrections(self._lookout.start(observation, lifts))

    def advance(self, observation: Observation) -> FloatArray:
        """Take the observations (N, K), one control step later; return the corrections as they are now."""
        return self._corrections(self._lookout.advance(observation))

    def follow(self, command: FloatArray) -> None:
        """Reckon with the commands (N,) rad/s that are given."""
        self._lookout.follow(command)

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        self._lookout.retune(rope_length, growth, wet)

    def _corrections(self, outlook: Outlook) -> FloatArray:
        context = self._memories.take(outlook, self._lookout.figures)
        forecasts = self._network.forecasts(torch.from_numpy(context)).numpy()
        return np.asarray(forecasts - outlook.series[:, :FORECASTS], dtype=np.float64)


@cache
def weights(horizon: int, period: float) -> FloatArray:
    """Weights (horizon, FORECASTS) of what is foretold in the pulley's mean speed in each control step.

    Through the rates goes a spline; the rises, learned of the same waves, say no more.
    """
    ahead, ends = np.array(RATES_AHEAD), period * np.arange(horizon + 1)
    rises = CubicSpline(ahead, np.eye(len(ahead))).antiderivative()
    first, last = BANKS_OWN
    believed = np.clip((ends[:-1] - first) / (last - first), 0.0, 1.0)
    mean = believed[:, None] * np.diff(rises(ends), axis=0) / period
    return np.pad(mean, ((0, 0), (0, FORECASTS - len(ahead))))


@dataclass
class ForetellingControl:
    """Adaptive predictive control, the pulley's motion foretold by the memory of a recurrent agent on sensors."""

    network: RecurrentNetwork
    card: RecurrentCard
    name: str = field(init=False, default=NAME)
    knows: Knowledge = field(init=False, default=Knowledge.SENSORS)
    _lifts: Sequence[Scenario] = field(init=False, repr=False, default=())
    _running: tuple[Planner, Foretelling] | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        card = self.card
        if card.sensors is None:
            raise InvalidValue(
                f"agent of {card.task!r}: acts on the full state, must act on sensors to foretell from them"
            )
        if card.sensors.preview is not None:
            raise InvalidValue(f"agent of {card.task!r}: a radar foretells further than it does, must act without one")
        self.config = PlanningConfig(
            sensors=card.sensors,
            horizon=math.floor(HORIZON / card.control_period + 1e-9),
            waves=card.waves,
            adapts=True,
            chains=card.chains,
        )
        self._weights = weights(self.config.horizon, card.control_period)

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only what a ``Lift`` has is looked at."""
        trained = self.card.control_period
        if abs(control_period - trained) > 1e-9:
            raise InvalidValue(f"control_period = {control_period} s: the network was trained for {trained} s")
        self._lifts, self._running = scenarios, None

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        for each in self._running or ():
            each.retune(rope_length, growth, wet)

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for readings (N, 10); the first call since a reset begins the memory."""
        if self._running is None:
            rows, period = len(observation), self.card.control_period
            planner, foretelling = self._running = (
                Planner(rows, period, self.config),
                Foretelling(rows, self.network, self.card.made_for),
            )
            planner.start(observation, self._lifts)
            corrections = foretelling.start(observation, self._lifts)
        else:
            planner, foretelling = self._running
            planner.advance(observation)
            corrections = foretelling.advance(observation)
        # Row by row in the same order, whatever the batch: a sum, not a matrix product.
        pulley = (corrections[:, None, :] * self._weights).sum(axis=2)
        command = planner.command(planner.plan(pulley).rope_speed)
        foretelling.follow(command)
        return command
