"""A controller as one torch module, for one lift: readings, told values and state in; drum speed and state out.

The same as ``agents.learned.features.Features`` with an agent on it, in float64 throughout, in
operations that ONNX has: no loop, no branch. A state of zeros begins a lift. What is fixed at a lift's beginning (the
load's weight, how it bobs on its rope) lies in the state, and the rope's sampled model is a closed form of it, so that
there is no second graph to run first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import nn

from aframe_env.scenario.crane import GRAVITY
from aframe_env.scenario.sensors import Sensors
from agents.control.expected_waves import ExpectedWaves
from agents.control.lift import LEAST_WEIGHT
from agents.control.rope_filter import ACCELERATION_NOISE
from agents.control.wave_bank import WaveBank, exponents, schedule
from agents.control.wave_filter import LEAST_MISFIT
from agents.learned.agent import LearnedPolicy
from agents.learned.features import DAMPING_RATIO, LIMIT, lift_features, load_features, wanted_turn
from train.export.interface import Field, Tensor, readings_of, told_of

Values = dict[str, torch.Tensor]

_WAYS: Final = 256
_ROUNDS: Final = 6
"""The command is searched for among so many parts of the range, so many times: 48 bisections' worth."""


@dataclass(frozen=True, kw_only=True)
class Hoist:
    """Winch, rope and load of a lift, each value (1,)."""

    drum_radius: torch.Tensor
    max_speed: torch.Tensor
    max_acceleration: torch.Tensor
    lag: torch.Tensor
    axial_stiffness: torch.Tensor
    rope_length: torch.Tensor
    weight: torch.Tensor
    frequency: torch.Tensor
    """Of the load's bobbing on its rope, rad/s."""

    def stretch(self, force: torch.Tensor) -> torch.Tensor:
        """Stretch of the rope by a force [N], m."""
        return force * self.rope_length / self.axial_stiffness

    def turn(self, command: torch.Tensor, speed: torch.Tensor, period: float) -> tuple[torch.Tensor, torch.Tensor]:
        """Turn [rad] and speed [rad/s] of the drum at the end of a control step that it began at ``speed``."""
        gap = command - speed
        way = torch.where(gap >= 0.0, 1.0, -1.0).double()
        gap = gap.abs()
        error = torch.minimum(gap, self.max_acceleration * self.lag)
        ramp_time = (gap - error) / self.max_acceleration
        lagging = (self.lag > 0.0) & (ramp_time < period)
        end = torch.where(lagging, error * torch.exp((ramp_time - period) / self.lag), error)
        ramp = ramp_time.clamp(max=period)
        acceleration = way * self.max_acceleration
        after_ramp = ramp * (0.5 * acceleration * ramp + speed)
        settled = command * (period - ramp) + after_ramp - way * self.lag * (error - end)
        ramping = ramp_time > period
        turned = torch.where(ramping, after_ramp, settled)
        return turned, torch.where(ramping, acceleration * ramp + speed, command - way * end)

    def command(self, turn: torch.Tensor, speed: torch.Tensor, period: float) -> torch.Tensor:
        """Command [rad/s] within the winch's speed that turns the drum by ``turn`` [rad], or as near as may be."""
        low, width = -self.max_speed, 2.0 * self.max_speed
        shares = torch.arange(1, _WAYS, dtype=torch.float64) / _WAYS
        for _ in range(_ROUNDS):
            turned, _ = self.turn(low + width * shares, speed, period)
            low = low + width * (turned < turn).double().sum(dim=0, keepdim=True) / _WAYS
            width = width / _WAYS
        return low


@dataclass(frozen=True, kw_only=True)
class Seen:
    """What an observer tells."""

    z: torch.Tensor
    """(4,) state of ``agents.control.rope.RopeModel``."""
    rise: torch.Tensor
    """Of the pulley in the coming control step, m."""
    pulley: tuple[torch.Tensor, ...]
    """Velocity [m/s] and accelerations [m/s²] of the pulley."""
    speed: torch.Tensor
    """Of the drum, rad/s."""
    memory: Values
    """What the next step needs."""


class FullState(nn.Module):
    """What ``StateObserver`` tells the features: none of it depends on its wave filter, which is left out."""

    memory: tuple[Field, ...] = ()

    def __init__(self, period: float) -> None:
        super().__init__()
        self._period = period

    def forward(self, hoist: Hoist, r: Values, s: Values, begins: torch.Tensor) -> Seen:
        """Look at the readings."""
        velocity, acceleration = r["pulley_velocity_z"], r["pulley_acceleration_z"]
        rope_end = r["depth_error"] + hoist.stretch(r["rope_tension"] - hoist.weight)
        rope_end_speed = velocity - hoist.drum_radius * r["drum_speed"]
        return Seen(
            z=torch.cat([r["depth_error"], r["load_velocity_z"], rope_end, rope_end_speed]),
            rise=self._period * (velocity + 0.5 * self._period * acceleration),
            pulley=(velocity, acceleration),
            speed=r["drum_speed"],
            memory={},
        )

    def after(self, s: Values, turned: torch.Tensor) -> Values:
        """What is to be remembered of the drum's turn [rad] in the coming control step."""
        return {}


class Sensed(nn.Module):
    """``KalmanObserver``: the wave filter of each kind of sea, and the filter of the load on its rope."""

    _transition_re: torch.Tensor
    _transition_im: torch.Tensor
    _told_re: torch.Tensor
    _told_im: torch.Tensor
    _rate_gain_re: torch.Tensor
    _rate_gain_im: torch.Tensor
    _depth_gain_re: torch.Tensor
    _depth_gain_im: torch.Tensor
    _spread: torch.Tensor
    _log_spread: torch.Tensor
    _waved: torch.Tensor
    _stretch: torch.Tensor
    _covariance: torch.Tensor

    def __init__(self, period: float, sensors: Sensors, waves: ExpectedWaves) -> None:
        super().__init__()
        self._period, self._tension = period, sensors.tension
        self._delay = round(sensors.delay / period)
        """Of the readings, control steps."""
        self._hold = max(1, round(sensors.depth_error.period / period))
        bank = WaveBank.of(waves, sensors)
        self._rate_noise = bank.rate_noise
        gains, exponent = schedule(bank, period, self._hold), exponents(bank)
        self._steps, kinds, parts = gains.rate.shape
        now = period * (self._delay + np.arange(3.0))
        path = np.expm1(np.outer(period * np.arange(self._delay + 2.0), exponent)) / exponent
        rate = np.exp(np.outer(now, exponent))
        middle = np.exp((now[0] + 0.5 * period) * exponent) * exponent
        # Rows of what is told of the pulley, each the real part of a sum over the oscillators.
        told = np.vstack([1.0 / exponent, np.diff(path, axis=0), rate[:1], middle, np.diff(rate, axis=0) / period])
        tables = {
            "transition": np.append(np.exp(exponent * period), 1.0),
            "told": np.column_stack([told, np.zeros(len(told))]),
            "rate_gain": gains.rate,
            # Only steps with a reading of the depth have a gain for it.
            "depth_gain": gains.depth[:: self._hold],
        }
        for name, table in tables.items():
            self.register_buffer(f"_{name}_re", torch.from_numpy(np.ascontiguousarray(table.real)))
            self.register_buffer(f"_{name}_im", torch.from_numpy(np.ascontiguousarray(table.imag)))
        self.register_buffer("_spread", torch.from_numpy(gains.spread))
        self.register_buffer("_log_spread", torch.from_numpy(np.log(gains.spread)))
        self.register_buffer("_waved", torch.from_numpy(np.append(np.ones(parts - 1), 0.0)))
        self.register_buffer("_stretch", torch.tensor([-1.0, 0.0, 1.0, 1.0], dtype=torch.float64))
        self.register_buffer("_covariance", torch.diag(torch.tensor([1e-4, 1e-4, 1e-4, 0.0], dtype=torch.float64)))
        self.memory: tuple[Field, ...] = (
            Field(name="step"),
            Field(name="pulley_velocity_z", unit="m/s"),
            Field(name="drum_angle", unit="rad"),
            Field(name="first_drum_angle", unit="rad"),
            Field(name="stretch_variance", unit="m²"),
            Field(name="rope", unit="m, m/s, m, m", shape=(4,)),
            Field(name="rope_covariance", unit="squares of rope", shape=(4, 4)),
            Field(name="turns", unit="rad", shape=(self._delay,)),
            Field(name="misfit", shape=(kinds,)),
            Field(name="log_spread", shape=(kinds,)),
            Field(name="waves_re", unit="m/s, the last of each kind m", shape=(kinds, parts)),
            Field(name="waves_im", unit="m/s, the last of each kind m", shape=(kinds, parts)),
        )

    def forward(self, hoist: Hoist, r: Values, s: Values, begins: torch.Tensor) -> Seen:
        """Take the readings, and carry what they tell over their delay."""
        noise = hoist.stretch((self._tension.relative_noise * hoist.weight).clamp(min=self._tension.noise))
        variance = torch.where(begins, noise * noise, s["stretch_variance"])
        first_angle = torch.where(begins, r["drum_angle"], s["first_drum_angle"])
        a, b = self._model(hoist.frequency)

        step = s["step"] + 1.0
        misfit, log_spread, probability, re, im, at = self._advanced_waves(step, r["pulley_velocity_z"], s)
        paid_out = hoist.drum_radius * (r["drum_angle"] - s["drum_angle"])
        speed = 0.5 * (r["pulley_velocity_z"] + s["pulley_velocity_z"]) - paid_out / self._period
        stretch = hoist.stretch(r["rope_tension"] - hoist.weight)
        rope, covariance = self._advanced_rope(a, b, speed, stretch, variance, s)

        zero = torch.zeros(1, dtype=torch.float64)
        rope = torch.where(begins, zero, rope)
        below = hoist.drum_radius * (r["drum_angle"] - first_angle) + rope[2:3] - rope[:1]
        re, im = self._corrected_waves(at, r["depth_error"] + below, re, im)
        re, im = torch.where(begins, zero, re), torch.where(begins, zero, im)

        mean_re, mean_im = (probability[:, None] * re).sum(dim=0), (probability[:, None] * im).sum(dim=0)
        told = (self._told_re * mean_re - self._told_im * mean_im).sum(dim=1)
        of_waves, *rest = torch.split(told, 1)
        heave, rises = of_waves + mean_re[-1:], rest[: self._delay + 1]
        velocity, *accelerations = rest[self._delay + 1 :]
        depth_error = torch.where(begins, zero, heave - below)
        z = torch.cat([depth_error, rope[1:2], depth_error + rope[2:3] - rope[:1], zero])
        for passed in range(self._delay):
            z = a @ z + b * ((rises[passed] - hoist.drum_radius * s["turns"][passed : passed + 1]) / self._period)
        drum_speed = s["speed"]
        z = torch.cat([z[:3], velocity - hoist.drum_radius * drum_speed])
        started = self._covariance + variance * torch.diag(torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=torch.float64))
        memory = {
            "step": torch.where(begins, zero, step),
            "pulley_velocity_z": r["pulley_velocity_z"],
            "drum_angle": r["drum_angle"],
            "first_drum_angle": first_angle,
            "stretch_variance": variance,
            "rope": rope,
            "rope_covariance": torch.where(begins, started, covariance),
            "misfit": torch.where(begins, zero, misfit),
            "log_spread": torch.where(begins, zero, log_spread),
            "waves_re": re,
            "waves_im": im,
        }
        return Seen(z=z, rise=rises[self._delay], pulley=(velocity, *accelerations), speed=drum_speed, memory=memory)

    def after(self, s: Values, turned: torch.Tensor) -> Values:
        """What is to be remembered of the drum's turn [rad] in the coming control step."""
        return {"turns": torch.cat([s["turns"][1:], turned]) if self._delay else s["turns"]}

    def _model(self, frequency: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """A (4, 4) and b (4,) of ``RopeFilter``: ``RopeModel`` in closed form, with the bias in the place of p.

        While p is constant, q - e and p - v are those of a damped oscillator.
        """
        period = self._period
        rate = DAMPING_RATIO * frequency
        turning = frequency * math.sqrt(1.0 - DAMPING_RATIO**2)
        decay = torch.exp(-rate * period)
        c, s = decay * torch.cos(turning * period), decay * torch.sin(turning * period) / turning
        ee, ev = c + rate * s, s
        ve, vv = -frequency * frequency * s, c - rate * s
        one, zero = torch.ones(1, dtype=torch.float64), torch.zeros(1, dtype=torch.float64)
        a = [ee, ev, 1.0 - ee, zero, ve, vv, -ve, zero, zero, zero, one, zero, zero, zero, zero, one]
        return torch.cat(a).reshape(4, 4), torch.cat([period - ev, 1.0 - vv, period * one, zero])

    def _advanced_waves(self, step: torch.Tensor, reading: torch.Tensor, s: Values) -> tuple[torch.Tensor, ...]:
        """Misfits, log-spreads and probabilities (M,), waves (M, parts), and the step whose gains hold."""
        beyond = self._steps - self._hold
        whole = step.long()
        at = torch.where(whole < beyond, whole, beyond + (whole - beyond) % self._hold)
        re, im = s["waves_re"], s["waves_im"]
        turn_re, turn_im = self._transition_re, self._transition_im
        re, im = re * turn_re - im * turn_im, re * turn_im + im * turn_re
        deviation = reading - (re * self._waved).sum(dim=1)
        re = re + deviation[:, None] * self._rate_gain_re.index_select(0, at)[0]
        im = im + deviation[:, None] * self._rate_gain_im.index_select(0, at)[0]
        misfit = s["misfit"] + deviation * deviation / self._spread.index_select(0, at)[0]
        log_spread = s["log_spread"] + self._log_spread.index_select(0, at)[0]
        height = (misfit / step).clamp(min=LEAST_MISFIT)
        probability = torch.softmax(-0.5 * (step * torch.log(height) + log_spread), dim=0)
        return misfit, log_spread, probability, re, im, at

    def _corrected_waves(
        self, at: torch.Tensor, reading: torch.Tensor, re: torch.Tensor, im: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Waves (M, parts) after a reading [m] of the pulley's heave by the depth, if there is one in this step."""
        heave = (re * self._told_re[0] - im * self._told_im[0]).sum(dim=1) + re[:, -1]
        deviation = torch.where(at % self._hold == 0, reading - heave, 0.0)[:, None]
        row = at // self._hold
        return (
            re + deviation * self._depth_gain_re.index_select(0, row)[0],
            im + deviation * self._depth_gain_im.index_select(0, row)[0],
        )

    def _advanced_rope(
        self,
        a: torch.Tensor,
        b: torch.Tensor,
        speed: torch.Tensor,
        stretch: torch.Tensor,
        variance: torch.Tensor,
        s: Values,
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """State (4,) and covariance (4, 4) of the load on its rope after a control step and a reading."""
        shaken = torch.diag(torch.tensor([0.0, (ACCELERATION_NOISE * self._period) ** 2, 0.0, 0.0]).double())
        x = a @ s["rope"] + b * speed
        p = a @ s["rope_covariance"] @ a.T + self._rate_noise**2 * b[:, None] * b[None, :] + shaken
        cross = p @ self._stretch
        gain = cross / ((cross * self._stretch).sum(dim=0, keepdim=True) + variance)
        deviation = stretch - (x * self._stretch).sum(dim=0, keepdim=True)
        return x + gain * deviation, p - gain[:, None] * cross[None, :]


class Controller(nn.Module):
    """The whole controller."""

    def __init__(self, agent: LearnedPolicy) -> None:
        super().__init__()
        card = agent.card
        self.period = card.control_period
        self.readings, self.told = readings_of(card), told_of(card)
        self._actor, self._action = agent.exact().actor, card.action
        self._observer = (
            FullState(self.period) if card.sensors is None else Sensed(self.period, card.sensors, card.waves)
        )
        self.state = Tensor(
            "state",
            (
                Field(name="begun"),
                Field(name="fault"),
                Field(name="speed", unit="rad/s"),
                Field(name="weight", unit="N"),
                Field(name="frequency", unit="rad/s"),
                *(Field(name=f"told_{field.name}", unit=field.unit) for field in self.told.fields),
                *self._observer.memory,
            ),
        )

    def forward(
        self, readings: torch.Tensor, told: torch.Tensor, state: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Drum speed (1,) rad/s, fault (1,) 0 or 1, and the state for the next step."""
        s, r = self.state.split(state), self.readings.split(readings)
        begins = s["begun"] == 0.0
        told_now = {name: value for name, value in self.told.split(told).items()}
        lift = {name: torch.where(begins, value, s[f"told_{name}"]) for name, value in told_now.items()}
        hoist = self._hoist(lift, r, s, begins)
        seen = self._observer(hoist, r, s, begins)
        command, proper = self._command(hoist, r, seen)
        turned, speed = hoist.turn(command, seen.speed, self.period)

        fault = ~((s["fault"] == 0.0) & self.readings.within(readings) & (~begins | self.told.within(told)) & proper)
        # From the last speed that is known, as fast as the winch may; before the first step the drum is at rest.
        most = s["told_max_acceleration"] * self.period
        ramp = s["speed"] - torch.minimum(torch.maximum(s["speed"], -most), most)
        one = torch.ones(1, dtype=torch.float64)
        after = self.state.join(
            {
                "begun": one,
                "fault": 0.0 * one,
                "speed": speed,
                "weight": hoist.weight,
                "frequency": hoist.frequency,
                **{f"told_{name}": value for name, value in lift.items()},
                **seen.memory,
                **self._observer.after(s, turned),
            }
        )
        held = self.state.join({**s, "begun": one, "fault": one, "speed": ramp})
        return (
            torch.where(fault, ramp, command),
            fault.double(),
            torch.where(fault, held, after),
        )

    def _hoist(self, lift: Values, r: Values, s: Values, begins: torch.Tensor) -> Hoist:
        rope_length = lift["rope_length"] if "rope_length" in lift else r["rope_length"]
        weight = torch.where(begins, r["rope_tension"].clamp(min=LEAST_WEIGHT), s["weight"])
        bobbing = torch.sqrt(lift["axial_stiffness"] / (rope_length * (weight / GRAVITY)))
        frequency = torch.where(begins, bobbing, s["frequency"])
        crane = {name: value for name, value in lift.items() if name != "rope_length"}
        return Hoist(rope_length=rope_length, weight=weight, frequency=frequency, **crane)

    def _command(self, hoist: Hoist, r: Values, seen: Seen) -> tuple[torch.Tensor, torch.Tensor]:
        """Command [rad/s] for the drum, and whether it came of numbers."""
        mass = hoist.weight / GRAVITY
        features = torch.cat(
            [
                *load_features(torch, torch.split(seen.z, 1)),
                *seen.pulley,
                *lift_features(r["pulley_heave"], mass, hoist.rope_length, hoist.frequency),
            ]
        )
        output = self._actor(features.clamp(-LIMIT, LIMIT).float().double()[None])[0]
        if self._action == "speed":
            command = output.clamp(-1.0, 1.0) * hoist.max_speed
            return command, command.abs() < math.inf
        turn = wanted_turn(torch, seen.rise, output, hoist.drum_radius, hoist.max_acceleration, self.period)
        return hoist.command(turn, seen.speed, self.period), turn.abs() < math.inf
