"""Linear twin of the task in torch: the load on its rope and the winch, along recorded paths of the pulley.

A network's features and its drum's answer are those of the engine, the rope's end moves as the drum pays out, the load
follows by the rope's linear model; what no policy changes comes from runs of the real engine: the rope that would hold
the load still (pulley, pendulum and all), the foretold waves, the errors of the estimates. So the depth error of a
whole stretch of time is a function of the network's weights, and its gradient says how to better them. What the twin
leaves out, above all slack rope and the winch's lag, the evaluation in the engine does not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import torch
from scipy.linalg import expm

from aframe_env import task
from aframe_env.config import TaskConfig
from aframe_env.dynamics.start import critical_damping
from aframe_env.scenario import Scenario
from aframe_env.simulation import Simulation
from agents.control.inverse_dynamics import RequiredRope
from agents.learned.features import FEATURES, LIMIT, FeatureConfig, Features, HoistFeatures, rope_speed
from agents.learned.network import Actor

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]

OWN: Final = FEATURES[:8]
"""Features that follow from the twin's own state; the others come from the recording."""
LEAK: Final = 0.05
"""Slope of the drum's answer beyond the winch's limits: none would tell nothing about how far beyond."""
KEPT: Final = 0.995
"""Share of a state's gradient that a control step hands on to the one before."""
STEEPEST: Final = 2.0
"""Greatest gradient of a row's state, over that of its mean depth error: a load that is driven round and round by the
winch's limits would otherwise drown all others."""


@dataclass(frozen=True)
class Recording:
    """N episodes of n control steps in the engine, as far as no policy changes them; float32."""

    features: torch.Tensor
    """(N, n, F)."""
    misjudged: torch.Tensor
    """(N, n, 4) estimate of the rope's state z less the true one."""
    pulley_speed: torch.Tensor
    """(N, n) mean speed of the pulley in the coming control step, as estimated, m/s."""
    rise: torch.Tensor
    """(N, n) true rise of the rope that would hold the load still, m."""
    speed: torch.Tensor
    """(N, n) its true speed, m/s."""
    still: torch.Tensor
    """(N,) root mean square of what it moves in all: of a load under a drum left still, m."""
    model: torch.Tensor
    """(N, 3, 4) of the rope: the state (e, e', q) a control step later, of state and rope end's mean speed."""
    k: torch.Tensor
    """(N, 4) gains of the regulator that is a feature."""
    frequency: torch.Tensor
    """(N,) rad/s, as the agent reckons."""
    max_rope_speed: torch.Tensor
    """(N,) m/s."""
    max_rope_acceleration: torch.Tensor
    """(N,) m/s²."""
    period: float
    """Control step, s."""
    share: float
    """Share of the winch's acceleration that the regulator may use."""
    action: str

    def stretch(self, rows: npt.NDArray[np.int64], first: npt.NDArray[np.int64], steps: int) -> Recording:
        """These rows (M,), each from a control step ``first`` (M,) on, ``steps`` long."""
        columns = torch.from_numpy(first[:, None] + np.arange(steps))
        which = torch.from_numpy(rows)
        length = self.features.shape[1]
        found: dict[str, Any] = {}
        for each in fields(self):
            value = getattr(self, each.name)
            if isinstance(value, torch.Tensor):
                in_time = value.ndim > 1 and value.shape[1] == length
                value = value[which[:, None], columns] if in_time else value[which]
            found[each.name] = value
        return Recording(**found)


def record(
    scenarios: Sequence[Scenario],
    config: TaskConfig,
    made_for: FeatureConfig,
    seed: int,
    progress: Callable[[int], object] | None = None,
) -> Recording:
    """Run scenarios in the engine with a network that says nothing, and record what the twin needs.

    ``seed`` of the sensors' noise; ``progress`` is called with the number of control steps made.
    """
    count, steps, period = len(scenarios), config.steps, config.control_period
    simulation = Simulation(count, config.replaced(scenario=scenarios[0], observation=made_for.sensors or "state"))
    seeds = np.random.default_rng(seed).integers(2**63, size=count).tolist()
    simulation.reset_rows(np.arange(count), list(zip(scenarios, seeds, strict=True)))
    features = Features(count, made_for)
    length, rate = _required(scenarios, period, steps)
    radius = np.array([scenario.crane.winch.drum_radius for scenario in scenarios])
    seen = np.empty((count, steps, len(FEATURES)), dtype=np.float32)
    misjudged = np.empty((count, steps, 4), dtype=np.float32)
    pulley_speed = np.empty((count, steps), dtype=np.float32)
    cranes = [scenario.crane for scenario in scenarios]
    zero = np.zeros(count)
    for step in range(steps):
        observation, state = simulation.observe(), simulation.state
        seen[:, step] = features.advance(observation) if step else features.start(observation, cranes)
        true = np.stack(
            [
                state[:, task.DEPTH_ERROR],
                state[:, task.LOAD_VELOCITY_Z],
                length[:, step] - radius * state[:, task.DRUM_ANGLE],
                rate[:, step] - radius * state[:, task.DRUM_SPEED],
            ],
            axis=1,
        )
        misjudged[:, step] = features.rope_state - true
        pulley_speed[:, step] = features.pulley_speed
        simulation.advance(features.command(zero))
        if progress is not None:
            progress(step + 1)
    hoist = features.hoist
    # The load under a drum left still goes where the rope's end does, but for its bobbing.
    still = np.sqrt(np.mean(np.square(length[:, :steps] - length[:, :1]), axis=1))

    def tensor(values: npt.ArrayLike) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))

    return Recording(
        features=tensor(seen),
        misjudged=tensor(misjudged),
        pulley_speed=tensor(pulley_speed),
        rise=tensor(np.diff(length[:, : steps + 1], axis=1)),
        speed=tensor(rate[:, :steps]),
        still=tensor(np.maximum(still, 1e-3)),
        model=tensor(np.stack([_rope_model(scenario, period) for scenario in scenarios])),
        k=tensor(hoist.k.T),
        frequency=tensor(hoist.frequency),
        max_rope_speed=tensor(hoist.max_rope_speed),
        max_rope_acceleration=tensor(hoist.max_rope_acceleration),
        period=period,
        share=hoist.share,
        action=made_for.action,
    )


def rollout(actor: Actor, recording: Recording) -> tuple[torch.Tensor, torch.Tensor]:
    """Run the network along a recording, from a load at rest and a drum that follows the pulley as it can.

    Returns the mean squared depth error (N,) m² and the mean square by which the output goes beyond [-1, 1], ().
    """
    r, period = recording, recording.period
    reach = r.max_rope_acceleration * period
    own = [FEATURES.index(name) for name in OWN]
    others = [i for i in range(len(FEATURES)) if i not in own]
    first, second = actor.perceptron[0], actor.perceptron[2]
    assert isinstance(first, torch.nn.Linear)
    hidden, into, bias, head = first.out_features, first.weight, first.bias, actor.head.weight[0]
    # What the recording adds to the first layer and to the linear path: of all control steps at once.
    into_hidden = (r.features[..., others] @ into[:, others].T + bias).unbind(1)
    into_output = (r.features[..., others] @ head[hidden:][others] + actor.head.bias).unbind(1)
    own_hidden, own_output, hidden_output = into[:, own].T, head[hidden:][own], head[:hidden]
    hoist = HoistFeatures(
        mass=None,
        rope_length=None,
        frequency=r.frequency,
        max_rope_speed=r.max_rope_speed,
        max_rope_acceleration=r.max_rope_acceleration,
        k=r.k.T,
        share=r.share,
        period=period,
    )
    of_state, of_speed = r.model[:, :, :3], r.model[:, :, 3]
    misjudged, pulley_speed = r.misjudged.unbind(1), r.pulley_speed.unbind(1)
    rise, speed = r.rise.unbind(1), r.speed.unbind(1)
    x = torch.zeros(len(r.still), 3)
    drum = torch.clamp(speed[0], -r.max_rope_speed, r.max_rope_speed)
    cost, beyond = torch.zeros(len(r.still)), torch.zeros(())
    for step in range(len(rise)):
        x, drum = _Gentle.apply(x, drum)  # type: ignore[no-untyped-call]
        off = misjudged[step]
        z = (*(x + off[:, :3]).unbind(1), speed[step] - drum + off[:, 3])
        mine = torch.stack([*hoist.of_the_load(torch, z), *hoist.of_the_winch(torch, drum, pulley_speed[step])], 1)
        mine = torch.clamp(mine, -LIMIT, LIMIT)
        latent = torch.tanh(second(torch.tanh(into_hidden[step] + mine @ own_hidden)))
        output = into_output[step] + mine @ own_output + latent @ hidden_output
        beyond = beyond + torch.clamp(output.abs() - 1.0, min=0.0).square().mean()
        bounded = torch.clamp(output, -1.0, 1.0)
        output = bounded + LEAK * (output - bounded)
        if r.action == "speed":
            wanted = 0.5 * (drum + output * r.max_rope_speed)
        else:
            wanted = pulley_speed[step] - rope_speed(output, r.max_rope_acceleration)
        mean, drum = _winch(wanted, drum, reach, r.max_rope_speed)
        before = x[:, 0]
        x = (of_state @ x[:, :, None])[:, :, 0] + of_speed * (rise[step] / period - mean)[:, None]
        cost = cost + 0.5 * (before.square() + x[:, 0].square())
    return cost / len(rise), beyond / len(rise)


def _winch(
    wanted: torch.Tensor, drum: torch.Tensor, reach: torch.Tensor, most: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Mean speed in a control step and speed at its end of a rope that is wanted at a mean speed, all (N,) m/s.

    Values are the winch's: it changes its speed by ``reach`` in a step at most. Slopes are those of a winch that gives
    what is wanted within its limits, and hardly more beyond.
    """
    with torch.no_grad():
        asked = (wanted - drum) / reach
        change = torch.where(asked.abs() < 0.5, 1.0 - torch.sqrt(torch.clamp(1.0 - 2.0 * asked.abs(), min=0.0)), 1.0)
        end = torch.clamp(drum + reach * change * asked.sign(), -most, most)
        turned = end - drum
        mean = drum + turned - turned * turned.abs() / (2.0 * reach)
    near = torch.clamp(wanted, drum - 0.5 * reach, drum + 0.5 * reach)
    near = near + LEAK * (wanted - near)
    limited = torch.clamp(near, -most, most)
    slope = limited + LEAK * (near - limited)
    slope = slope - slope.detach()
    return mean + slope, end + slope


class _Gentle(torch.autograd.Function):
    """The identity, which hands on a gradient that fades and is bounded row by row."""

    @staticmethod
    def forward(ctx: Any, x: torch.Tensor, drum: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """State (N, 3) and drum's speed (N,), as they are."""
        return x.view_as(x), drum.view_as(drum)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Gradients of both, gentler."""
        of_x, of_drum = gradients
        both = torch.nan_to_num(torch.cat([of_x, of_drum[:, None]], dim=1), 0.0, 0.0, 0.0)
        size = both.norm(dim=1, keepdim=True)
        both = both * KEPT * torch.clamp(STEEPEST / len(both) / torch.clamp(size, min=1e-12), max=1.0)
        return both[:, :3], both[:, 3]


def _required(scenarios: Sequence[Scenario], period: float, steps: int) -> tuple[FloatArray, FloatArray]:
    """Rope (N, n + 1) m that holds the loads still at the control steps, and its rate m/s."""
    rope = RequiredRope(scenarios, period)
    halves = np.empty((2 * steps + 2, len(scenarios)))
    for i in range(len(halves)):
        halves[i] = rope.now()
        if i < len(halves) - 1:
            rope.advance()
    rate = np.zeros((steps + 1, len(scenarios)))
    rate[1:] = (halves[3::2] - halves[1:-1:2]) / period
    rate[0] = 2.0 * (halves[1] - halves[0]) / period
    return halves[::2].T, rate.T


def _rope_model(scenario: Scenario, period: float) -> FloatArray:
    frequency = scenario.rope_frequency
    damping = scenario.rope_damping / critical_damping(scenario.rope_stiffness, scenario.load_mass) * frequency
    rate = np.zeros((4, 4))
    rate[0, 1] = 1.0
    rate[1] = -(frequency**2), -2.0 * damping, frequency**2, 2.0 * damping
    rate[2, 3] = 1.0
    return np.asarray(expm(rate * period)[:3])
