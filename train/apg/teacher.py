"""The teacher: what the optimum would do next in the states that a network visits, the pulley's true way ahead known.

The winch-limited optimum of the seconds to come, as predictive control plans it, but with what is true in the
place of what is estimated and foretold.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from agents.control.predictive import bounded_problem
from agents.control.winch import WinchModel
from agents.policy import FloatArray
from train.apg.data import Recordings

EFFORT: Final = 0.1
"""Price of changes of the rope end's speed, s²: it keeps the plan from moves that the linear model alone likes."""
CHAIN_EFFORT: Final = 1.5
"""The same on ropes with mass, whose own waves it knows nothing of: plans stay slow enough for these. With 0.1 who does
as it says comes to 95 % of the ceiling on DeepRope, with 1.5 to 98 %."""


class Teacher:
    """What would be best in recorded episodes."""

    def __init__(self, recordings: Recordings) -> None:
        self._recordings = recordings
        self._model = recordings.model()
        self._effort = EFFORT if recordings.transition.shape[1] == 3 else CHAIN_EFFORT
        self._cost_to_go = self._model.costs_to_go(np.full(len(recordings.still), self._effort))

    def share(
        self,
        episode: npt.NDArray[np.int64],
        step: npt.NDArray[np.int64],
        z: FloatArray,
        speed: FloatArray,
        reckoned: FloatArray,
    ) -> FloatArray:
        """Change (M,) of the rope's speed over a step, as a share of what the winch can, from states that were visited.

        ``episode`` and ``step`` (M,): where; ``z`` (M, 4) true states of ``RopeModel``, ``speed`` (M,) of the rope at
        the drum, m/s, and what the agent reckons it to be. NaN where the problem has no answer.
        """
        r = self._recordings
        ahead = step[:, None] + np.arange(r.preview + 1)
        pulley = np.diff(r.path[episode[:, None], ahead], axis=1) / r.period
        problem = bounded_problem(
            self._model.some(episode),
            z,
            pulley,
            speed,
            change_limit=r.most_change[episode],
            speed_limit=r.most_speed[episode],
            effort=self._effort,
            cost_to_go=self._cost_to_go[episode],
        )
        # Mean speeds of the drum over this step and the next one.
        mean = pulley[:, :2] - z[:, 3:] - np.cumsum(problem.solve()[0][:, :2], axis=1)
        # The drum ramps up at once, and then holds: 2 |mean| = most (1 - (1 - share)²).
        most = r.most_change[episode]
        reached = np.clip(2.0 * (mean[:, 0] - speed) / most, -1.0, 1.0)
        command = speed + most * np.sign(reached) * (1.0 - np.sqrt(1.0 - abs(reached)))
        late = np.flatnonzero(r.lag[episode] > 0.0)
        command[late] = self._reach(episode[late], speed[late], 0.5 * mean[late].sum(axis=1))
        ahead_by = (1.0 + r.told_lag[episode]) * r.told_change[episode]
        return np.asarray(np.clip((command - reckoned) / ahead_by, -1.0, 1.0))

    def _reach(self, episode: npt.NDArray[np.int64], speed: FloatArray, wanted: FloatArray) -> FloatArray:
        """Commands (M,) after which ropes are paid out at ``wanted`` at the step's end, all m/s.

        What a winch that lags can is what one without lag can, as long as its commands go ahead by as much.
        """
        r = self._recordings
        winch = WinchModel(len(speed), r.period)
        winch.speed[:] = speed
        winch.max_speed[:], winch.max_acceleration[:] = r.most_speed[episode], r.most_change[episode] / r.period
        winch.lag[:] = r.lag[episode] * r.period
        return winch.reach(wanted)
