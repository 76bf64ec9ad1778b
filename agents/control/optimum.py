"""The winch-limited optimum: the least Ω1 that a scenario leaves to anybody, with the whole future known.

Gauss-Newton on the drum's speeds at the ends of the control steps. The load on its rope answers them nearly linearly,
so that the best change of all of them at once, within the winch's limits of speed and acceleration, is a linear
least-squares problem with bounds (:mod:`agents.control.interior_point`). Cost and line search are the real engine's,
nonlinear rope, swinging load, limit switches and all; every scenario is a row of the same batch. Where the engine gains
nothing any more by any of these steps, what is left is the floor: see ``tests/agents/control/test_optimum.py`` for
other starts and for perturbations, none of which does better.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from aframe_env import task
from aframe_env.config import TaskConfig
from aframe_env.dynamics.start import critical_damping
from aframe_env.scenario import Scenario
from aframe_env.simulation import Simulation
from aframe_env.validation import InvalidValue
from agents.control.chain import drag_of
from agents.control.interior_point import BoundedTracking
from agents.control.inverse_dynamics import InverseDynamics, RequiredRope
from agents.control.winch import WinchModel
from agents.policy import FloatArray, Knowledge

STEP_SIZES: Final = (1.0, 0.5, 0.2, 0.05)
"""Shares of a Gauss-Newton step that the line search tries, all of them side by side."""
ROUNDS: Final = 30
"""Most Gauss-Newton steps of a scenario."""
LEAST_GAIN: Final = 1e-6
"""Gain of heave reduction below which a round has gained nothing; a scenario ends after two such rounds."""
PROXIMITY: Final = 1e-7
"""Price of a change of the rope's speed, s² of depth error squared: it only keeps a step unique."""
CHUNK: Final = 1024
"""Scenarios that are solved at a time: what the line search tries of them fits the memory."""

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Optimum:
    """The best drum commands of N scenarios."""

    commands: FloatArray
    """(N, n) rad/s, one for each control step."""
    omega1: FloatArray
    """(N,) m² s; infinite where nothing was found that keeps the rope."""
    rounds: npt.NDArray[np.int64]
    """(N,) Gauss-Newton steps that were made."""


@dataclass(frozen=True)
class _Trial:
    """What commands (M, n) do in the engine."""

    commands: FloatArray
    omega1: FloatArray
    """(M,) m² s; infinite where the rope parted."""
    error: FloatArray
    """(M, n + 1) depth error, m."""
    error_rate: FloatArray
    """(M, n + 1) m/s."""
    speed: FloatArray
    """(M, n + 1) of the rope at the drum, paid out, m/s."""

    def rows(self, which: npt.NDArray[np.int64]) -> _Trial:
        return _Trial(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    def put(self, mine: npt.NDArray[np.int64], other: _Trial, theirs: npt.NDArray[np.int64]) -> None:
        for name in self.__dataclass_fields__:
            getattr(self, name)[mine] = getattr(other, name)[theirs]


def optimise(
    scenarios: Sequence[Scenario],
    config: TaskConfig | None = None,
    *,
    start: FloatArray | None = None,
    rounds: int = ROUNDS,
    progress: Callable[[int], object] | None = None,
) -> Optimum:
    """Find the commands of least Ω1 in each scenario, on the task of ``config``.

    ``start`` (N, n): commands to begin with, rad/s; by default what inverse dynamics asks for. On a heavy rope, where
    there may be more minima than one and the steps go by a load that bobs without the rope's own waves, a drum left
    still and the commands of the policy "inverse dynamics" are other starts, and the best end counts. ``progress`` is
    called with the number of scenarios that are done.
    """
    config = config or TaskConfig()
    parts = []
    for begin in range(0, len(scenarios), CHUNK):
        chosen = scenarios[begin : begin + CHUNK]
        commands = required_commands(chosen, config) if start is None else start[begin : begin + CHUNK]
        if commands.shape != (len(chosen), config.steps):
            raise InvalidValue(f"start of shape {commands.shape}: must be ({len(chosen)}, {config.steps}), rad/s")
        still = _simulate(chosen, config, np.zeros_like(commands))
        starts = [_simulate(chosen, config, commands)]
        if start is None and not all(scenario.is_light for scenario in chosen):
            starts += [still.rows(np.arange(len(chosen))), _follow(chosen, config)]
        parts.append(reduce(_better, (_optimise(chosen, config, each, still, rounds) for each in starts)))
        if progress is not None:
            progress(begin + len(chosen))
    return Optimum(
        np.concatenate([part.commands for part in parts]),
        np.concatenate([part.omega1 for part in parts]),
        np.concatenate([part.rounds for part in parts]),
    )


def _better(one: Optimum, other: Optimum) -> Optimum:
    """The better of two for each scenario."""
    first = one.omega1 <= other.omega1
    return Optimum(
        np.where(first[:, None], one.commands, other.commands),
        np.minimum(one.omega1, other.omega1),
        one.rounds + other.rounds,
    )


def required_speeds(scenarios: Sequence[Scenario], config: TaskConfig) -> FloatArray:
    """Rope speeds (N, n + 1) m/s at the control steps that would hold the loads still, the winch's limits apart."""
    rope = RequiredRope(scenarios, config.control_period)
    length = np.empty((2 * config.steps + 2, len(scenarios)))
    for i in range(len(length)):
        length[i] = rope.now()
        rope.advance()
    speed = np.zeros((len(scenarios), config.steps + 1))
    speed[:, 1:] = (length[3::2] - length[1:-1:2]).T / config.control_period
    return speed


def required_commands(scenarios: Sequence[Scenario], config: TaskConfig) -> FloatArray:
    """Commands (N, n) rad/s for those speeds; the winch follows them as far as it can."""
    radius = np.array([scenario.crane.winch.drum_radius for scenario in scenarios])
    return np.asarray(required_speeds(scenarios, config)[:, 1:] / radius[:, None])


def saturating(scenarios: Sequence[Scenario], config: TaskConfig | None = None) -> Mask:
    """Whether holding the load still asks the winch for more than its speed or acceleration at any time, (N,)."""
    config = config or TaskConfig()
    speed = required_speeds(scenarios, config)
    acceleration = np.diff(speed, axis=1) / config.control_period
    winches = [scenario.crane.winch for scenario in scenarios]
    too_fast = abs(speed).max(axis=1) > [winch.max_rope_speed for winch in winches]
    too_sudden = abs(acceleration).max(axis=1) > [winch.max_rope_acceleration for winch in winches]
    return np.asarray(too_fast | too_sudden)


@dataclass
class CommandSequence:
    """Play commands that were found for each scenario."""

    name: str
    commands: FloatArray = field(repr=False)
    """(N, n) rad/s."""
    knows: Knowledge = Knowledge.FUTURE
    _period: float = field(init=False, repr=False, default=0.1)

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes."""
        if len(scenarios) != len(self.commands):
            raise InvalidValue(f"{self.name}: {len(scenarios)} scenarios, commands for {len(self.commands)}")
        self._period = control_period

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s at ``time`` s since the start."""
        return np.asarray(self.commands[:, round(time / self._period)])


def _optimise(
    scenarios: Sequence[Scenario], config: TaskConfig, best: _Trial, drum_still: _Trial, rounds: int
) -> Optimum:
    """Go on from the trial ``best``, which is made better in place."""
    # Commands that part the rope are nowhere to go on from; where a drum left still parts it, too, nothing is.
    lost = np.flatnonzero(np.isinf(best.omega1))
    best.put(lost, drum_still, lost)
    still = np.sqrt(np.where(np.isinf(drum_still.omega1), best.omega1, drum_still.omega1))
    model = np.stack([_rope_model(scenario, config.control_period) for scenario in scenarios], axis=1)
    made = np.zeros(len(scenarios), dtype=np.int64)
    idle = np.where(np.isinf(best.omega1), 2, 0)
    for number in range(rounds):
        active = np.flatnonzero(idle < 2)
        if not len(active):
            break
        made[active] += 1
        chosen = [scenarios[i] for i in active.tolist()]
        for i in active.tolist():
            if scenarios[i].water is not None:
                drag = drag_rate(scenarios[i], best.error_rate[i])
                model[:, i] = _rope_model(scenarios[i], config.control_period, drag)
        change = _gauss_newton(chosen, config, model[:, active], best.rows(active), number)
        wanted = np.concatenate([best.speed[active, 1:] + size * change for size in STEP_SIZES])
        many = chosen * len(STEP_SIZES)
        trial = _simulate(many, config, _commands_for(many, config, wanted))
        tried = trial.omega1.reshape(len(STEP_SIZES), -1)
        pick = tried.argmin(axis=0) * len(active) + np.arange(len(active))
        gain = (np.sqrt(best.omega1[active]) - np.sqrt(trial.omega1[pick])) / still[active]
        better = gain > 0.0
        best.put(active[better], trial, pick[better])
        idle[active] = np.where(gain > LEAST_GAIN, 0, idle[active] + 1)
    return Optimum(best.commands, best.omega1, made)


def _simulate(scenarios: Sequence[Scenario], config: TaskConfig, commands: FloatArray) -> _Trial:
    """Run the engine with commands (M, n)."""
    return _play(scenarios, config, lambda simulation, step: commands[:, step])


def _follow(scenarios: Sequence[Scenario], config: TaskConfig) -> _Trial:
    """Run the engine with the policy "inverse dynamics", which looks at what has become of the load."""
    policy, period = InverseDynamics(), config.control_period
    policy.reset(scenarios, period)
    return _play(scenarios, config, lambda simulation, step: policy.act(simulation.observe(), step * period))


def _play(
    scenarios: Sequence[Scenario], config: TaskConfig, command: Callable[[Simulation, int], FloatArray]
) -> _Trial:
    """Run the engine with the commands (M,) rad/s that are given at each step."""
    count, steps = len(scenarios), config.steps
    simulation = Simulation(count, config.replaced(scenario=scenarios[0], observation="state"))
    simulation.reset_rows(np.arange(count), [(scenario, 0) for scenario in scenarios])
    columns = (task.DEPTH_ERROR, task.LOAD_VELOCITY_Z, task.DRUM_SPEED)
    histories, commands = np.empty((steps + 1, count, len(columns))), np.empty((count, steps))
    histories[0] = simulation.state[:, columns]
    for step in range(steps):
        commands[:, step] = command(simulation, step)
        simulation.advance(commands[:, step])
        histories[step + 1] = simulation.state[:, columns]
    parted = simulation.results[:, task.PARTED] > 0.0
    omega1 = np.where(parted, np.inf, simulation.results[:, task.OMEGA1])
    radius = np.array([scenario.crane.winch.drum_radius for scenario in scenarios])
    error, rate, speed = np.ascontiguousarray(histories.transpose(2, 1, 0))
    return _Trial(commands, omega1, error, rate, radius[:, None] * speed)


def _commands_for(scenarios: Sequence[Scenario], config: TaskConfig, speed: FloatArray) -> FloatArray:
    """Commands (M, n) rad/s that bring the rope to these speeds (M, n) m/s by the ends of the steps, if they can."""
    winch = WinchModel(len(scenarios), config.control_period)
    winch.start([scenario.crane for scenario in scenarios])
    commands = np.empty_like(speed)
    for step in range(speed.shape[1]):
        commands[:, step] = winch.reach(speed[:, step] / winch.radius)
    return commands


def _gauss_newton(
    scenarios: Sequence[Scenario], config: TaskConfig, model: FloatArray, now: _Trial, number: int
) -> FloatArray:
    """Best changes (M, n) m/s of the rope's speeds at the steps' ends, on the linear ``model`` (2, M, 4, 4)."""
    period = config.control_period
    speed, change = now.speed[:, 1:], np.diff(now.speed, axis=1)
    most = np.array([scenario.crane.winch.max_rope_acceleration for scenario in scenarios]) * period
    a, half = model
    # A speed is reached only when the winch has ramped up to it: of a step's change just this share counts. Every
    # other round takes the share of the whole change in place of that of the next bit of it, which overshoots less.
    share = 1.0 - np.minimum(abs(change) / most[:, None], 1.0) * (0.5 if number % 2 == 0 else 1.0)
    b = share[:, :, None] * a[:, None, :, 3]
    b[:, :, 3] = 1.0
    problem = BoundedTracking(
        a=a,
        b=b,
        middle=half[:, 0],
        middle_input=share * half[:, 0, 3, None],
        error=now.error[:, 1:],
        # On the cubic through both ends.
        error_middle=0.5 * (now.error[:, :-1] + now.error[:, 1:])
        + 0.125 * period * (now.error_rate[:, :-1] - now.error_rate[:, 1:]),
        # Simpson's rule; an end is that of two steps.
        weights=(period / 3.0, 2.0 * period / 3.0, PROXIMITY),
        inputs=change,
        state=speed,
        input_limit=np.repeat(most[:, None], change.shape[1], axis=1),
        state_limit=np.array([scenario.crane.winch.max_rope_speed for scenario in scenarios]),
    )
    return np.asarray(np.cumsum(problem.solve()[0], axis=1))


def drag_rate(scenario: Scenario, velocity: FloatArray) -> float:
    """Rate 1/s at which drag slows down what bobs as ``velocity`` (n,) m/s: that of the linear drag of as much work."""
    square = float(np.sum(velocity**2))
    if scenario.water is None or square == 0.0:
        return 0.0
    mean = float(np.sum(abs(velocity) ** 3)) / square
    # A change of the velocity meets twice the drag that the velocity itself does.
    return 2.0 * drag_of(scenario, scenario.lengths[0], 1.0) * mean / scenario.moved_mass


def _rope_model(scenario: Scenario, period: float, drag: float = 0.0) -> FloatArray:
    """(2, 4, 4): transition of depth error, its rate, rope's end and pay-out speed over a step, and over half of it.

    ``drag``: rate at which water slows the load down, 1/s.
    """
    frequency = scenario.rope_frequency
    damping = scenario.total_rope_damping / critical_damping(scenario.rope_stiffness, scenario.moved_mass) * frequency
    rate = np.zeros((4, 4))
    rate[0, 1] = 1.0
    rate[1] = -(frequency**2), -2.0 * damping - drag, frequency**2, -2.0 * damping
    rate[2, 3] = -1.0  # paying out lowers the rope's end
    return np.stack([expm(rate * period), expm(rate * 0.5 * period)])
