# %% [markdown]
# # My controller against theirs
#
# A law of one's own, from three lines to a class with a memory; tuned where tuning is allowed; then put beside the
# package's on seas that neither has met, scenario by scenario.

# %% [markdown]
# ## A law in three lines
#
# A law sees observations (N, 10) of the sensors, a row for each episode, and gives drum speeds (N,), rad/s. This one
# pays out as fast as the pulley is said to rise. `RADIUS` is the reference crane's drum.

# %%
import numpy as np

from aframe_env import task

NAMES = [quantity.name for quantity in task.SENSED]
RATE, DEPTH = NAMES.index("pulley_velocity_z"), NAMES.index("depth_error")
RADIUS = 0.75  # m


def follow(observation):
    return observation[:, RATE] / RADIUS


print(*NAMES, sep="\n")

# %% [markdown]
# ## A law with a memory
#
# The reading is 0.1 s old, and the drum answers only in the step to come. So this law foretells the heave rate by its
# slope, `lead` seconds ahead, and trims the depth slowly, for the depth sensor is slow and coarse. A policy is a class
# with `name`, `knows`, `reset` and `act` ([`agents/policy.py`](../../agents/policy.py)).

# %%
from dataclasses import dataclass, field

from agents.policy import Knowledge


@dataclass
class Ahead:
    lead: float = 0.15  # s
    gain: float = 0.05  # 1/s
    name: str = "ahead"
    knows: Knowledge = field(init=False, default=Knowledge.SENSORS)

    def reset(self, scenarios, control_period):
        self._radius = np.array([s.crane.winch.drum_radius for s in scenarios])
        self._period, self._rate = control_period, None

    def act(self, observation, time):
        rate = observation[:, RATE].astype(float)
        slope = np.zeros_like(rate) if self._rate is None else (rate - self._rate) / self._period
        self._rate = rate
        return (rate + self.lead * slope + self.gain * observation[:, DEPTH]) / self._radius


# %% [markdown]
# ## Tune, but not on what is scored
#
# `drawn_scenarios` with a seed of your own gives seas for that. The held-out ones are for the comparison alone.

# %%
from aframe_env import ScenarioDistribution
from agents.policy import DrumStill
from agents.rollout import drawn_scenarios, run

practice = drawn_scenarios(ScenarioDistribution(), 1, 50)
still = run(DrumStill(), practice).rms
print("  lead, s   mean heave reduction")
found = {}
for lead in (0.0, 0.1, 0.15, 0.2, 0.3):
    found[lead] = float(np.mean(1.0 - run(Ahead(lead=lead), practice, observation="sensors").rms / still))
    print(f"{lead:9.2f}{100 * found[lead]:10.1f} %")
best = max(found, key=found.get)
print(f"best: {best} s")

# %% [markdown]
# ## The comparison
#
# Beside it the feed-forward with feedback, which has Kalman filters below it, predictive control, and the shipped
# agent; and the winch-limited optimum, which knows the whole future and is no rival, but says what there was to gain.

# %%
from rich.console import Console

from agents.registry import as_spec, choose
from train.evaluate.run import HeldOut, run_all

names = ["feed-forward + feedback", "predictive control", "ppo-sensors", "winch-limited optimum"]
mine = as_spec(Ahead(lead=best))
comparison = run_all([mine, *map(choose, names)], HeldOut(scenarios=40, observation="sensors"), Console(quiet=True))
print(f"{'':25} median          (95 %)      mean  worst 5 %  share of optimum")
for row in comparison.rows:
    low, high = row.reduction.low, row.reduction.high
    print(
        f"{row.policy:25}{100 * row.reduction.value:5.1f} %  [{100 * low:5.1f}, {100 * high:5.1f}]"
        f"{100 * row.mean.value:9.1f} %{100 * row.tail.value:7.1f} %{100 * row.share.value:12.1f} %"
    )

# %% [markdown]
# ## Pair by pair
#
# All have met the same seas with the same noise, so that the difference in each scenario counts: who wins how often
# says more than two intervals that lie side by side.

# %%
from train.evaluate.statistics import Interval, reductions

of = {entry.policy: reductions(entry, comparison.still) for entry in comparison.entries}
for other in ("feed-forward + feedback", "predictive control"):
    gap = Interval.of(100 * (of["ahead"] - of[other]), np.mean)
    wins = np.sum(of["ahead"] > of[other])
    print(f"ahead − {other}: {gap.value:.1f} points [{gap.low:.1f}, {gap.high:.1f}], better in {wins} of 40")

# %% [markdown]
# ## Where does it lose?

# %%
print("scenario   Hs, m   Tp, s   load, t   ahead   predictive")
for k in np.argsort(of["ahead"])[:5]:
    scenario = comparison.scenarios[k]
    sea = scenario.motion.sea
    print(
        f"{k:8}{sea.hs:8.1f}{sea.tp:8.1f}{scenario.load_mass / 1e3:10.0f}"
        f"{100 * of['ahead'][k]:8.0f} %{100 * of['predictive control'][k]:8.0f} %"
    )

# %% [markdown]
# Two kinds. In high seas the winch is at its limits, and a plan over five seconds is worth most. In low ones there is
# little heave beside the noise of its rate, which a slope makes larger, and the others have filters. Without the noise,
# and as late:

# %%
from aframe_env import Sensors

quiet = Sensors(delay=Sensors().delay, heave_rate=type(Sensors().heave_rate)())
lowest = [k for k in np.argsort(of["ahead"])[:5] if comparison.scenarios[k].motion.sea.hs < 1.0]
seas = [comparison.scenarios[k] for k in lowest]
left = run(Ahead(lead=best), seas, observation=quiet).rms / run(DrumStill(), seas).rms
print(*(f"scenario {k}: {100 * (1 - share):.0f} %" for k, share in zip(lowest, left, strict=True)), sep="\n")

# %% [markdown]
#
# ## In earnest
#
# Put `Ahead` into `my_law.py` and say `aframe evaluate --policies my_law:Ahead "predictive control" "winch-limited
# optimum" --scenarios 1000 --out runs/mine`: 1,000 scenarios, the report, and its pairs. To stay in the package a law
# takes [two files](../extend.md#a-control-law).
