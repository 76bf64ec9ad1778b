# %% [markdown]
# # My crane in my seas
#
# For a crane engineer with a vessel's response table, a winch's data sheet and a weather window: does the winch
# suffice, what does the motion unit's delay cost, and what happens in a measured sea? No learning here. What the
# figures are worth is in the [engineers' guide](../engineers.md).

# %% [markdown]
# ## The ship
#
# Her response amplitude operators, from whatever program computed them, as
# [CSV](../scenario-files.md#a-vessels-response). Here the package's own table stands for yours. Before anything else,
# look whether the conventions are right: in long waves a ship moves with the surface, so that heave is 1 m per m of
# wave amplitude, in phase with the wave, and in head seas pitch is the wave's slope ω²/g.

# %%
import shutil
from importlib.resources import files

import numpy as np

from aframe_env import Vessel

shutil.copy(str(files("aframe_env") / "data/supply_vessel.csv"), "my_ship.csv")

ship = Vessel.from_csv("my_ship.csv")
head_sea = np.argmin(abs(ship.headings - np.pi))
heave, pitch = ship.response[:, head_sea, 2], ship.response[:, head_sea, 4]
print("period, s   heave, m/m   phase, °   pitch / slope")
for k in range(0, len(ship.frequencies), 6):
    omega = ship.frequencies[k]
    slope = omega**2 / 9.81
    print(
        f"{2 * np.pi / omega:9.1f} {abs(heave[k]):12.2f} {round(np.degrees(np.angle(heave[k]))):10}"
        f" {abs(pitch[k]) / slope:15.2f}"
    )

# %% [markdown]
# The longest waves read 1, 0 and 1: the table is per metre of amplitude, in radians, with the right phase. A table in
# degrees would show 57 in the last column, one per metre of wave height one half.
#
# ## Crane, seas, load, sensors
#
# One file says what differs from the reference crane ([every key](../scenario-files.md)); an interval is drawn from,
# episode by episode. `deck_position` is the point between the A-frame's feet.

# %%
from pathlib import Path

MINE = """
kind = "distribution"
vessel = "my_ship.csv"
deck_position = [-38.0, 0.0, 6.0]
hs = [1.0, 3.0]
tp = [7.0, 11.0]
heading = [2.6, 3.7]
load_mass = [30e3, 60e3]
rope_length = [100.0, 800.0]

[crane]
drum_position = [-3.0, 0.0, 1.2]

[crane.frame]
height = 14.0

[crane.rope]
axial_stiffness = 1.6e8

[crane.winch]
max_rope_speed = 2.0
max_rope_acceleration = 0.8

[sensors]
delay = 0.2
"""
Path("mine.toml").write_text(MINE)

from aframe_env import TaskConfig
from agents.rollout import held_out_scenarios

task = TaskConfig(scenario="mine.toml", observation="sensors")
scenarios = held_out_scenarios(task.source, 16)
first = scenarios[0]
print(f"first scenario: {first.load_mass / 1e3:.1f} t at {-first.target_level:.0f} m below the mean deck")

# %% [markdown]
# ## Does the winch suffice?
#
# The winch-limited optimum knows the whole future: no controller does better with this winch. Beside it two laws that
# one could build, on the sensors. Sixteen seas here; take 200 or more before you decide anything.

# %%
from rich.console import Console

from agents.registry import choose_all
from train.evaluate.run import HeldOut, run_all

POLICIES = ["winch-limited optimum", "predictive control", "feed-forward + feedback"]


def compare(file: str) -> None:
    held_out = HeldOut(scenarios=Path(file), count=16, observation="sensors")
    comparison = run_all(choose_all(POLICIES), held_out, Console(quiet=True))
    print(f"holding the load still asks more than the winch has in {comparison.saturating.sum()} of 16 seas")
    print(f"{'':24} median    mean  worst 5 %  share of optimum  RMS, m")
    for row in comparison.rows:
        reduction, mean, tail, share = (100 * x.value for x in (row.reduction, row.mean, row.tail, row.share))
        print(f"{row.policy:25}{reduction:5.0f} %{mean:6.0f} %{tail:9.0f} %{share:16.0f} %{row.rms.value:8.2f}")


compare("mine.toml")

# %% [markdown]
# Read it so. The optimum's worst 5 %, here the worst sea, say what the *winch* costs: no software brings that back. The
# share of the optimum says what the *controller* leaves, and in such seas foresight pays: compare the two laws. With a
# winch that accelerates at 1.6 m/s² instead of 0.8:

# %%
Path("stronger.toml").write_text(MINE.replace("max_rope_acceleration = 0.8", "max_rope_acceleration = 1.6"))
compare("stronger.toml")

# %% [markdown]
# That was the winch, then: with twice the acceleration no sea asks for more than it has, and the simpler law does
# nearly as well as the other.
#
# ## What does the motion unit's delay cost?
#
# Readings that are 0.2 s old, against 0.5 s, on the weaker winch; the filters are told the delay in both cases.

# %%
Path("late.toml").write_text(MINE.replace("delay = 0.2", "delay = 0.5"))
compare("late.toml")

# %% [markdown]
# ## In a sea that was measured
#
# A motion unit logs heave, roll and pitch at its own place, x forward, y to port, z up. The record wants the motion of
# the point between the feet, x outboard (aft), and so signs turn and a lever is to be crossed
# ([how](../scenario-files.md#a-recorded-motion)). Here two minutes of a log, of a unit 30 m before that point and 4 m
# below it:

# %%
time = np.arange(0.0, 120.0, 0.5)
log_heave = 0.9 * np.sin(2 * np.pi * time / 9.0) + 0.3 * np.sin(2 * np.pi * time / 6.1 + 1.0)  # m
log_roll = np.radians(1.0) * np.sin(2 * np.pi * time / 12.0)
log_pitch = np.radians(1.5) * np.sin(2 * np.pi * time / 9.0 + 1.6)  # positive: bow down

from scipy.spatial.transform import Rotation

roll, pitch, yaw = -log_roll, -log_pitch, np.zeros_like(time)  # half a turn about z
lever = np.array([30.0, 0.0, 4.0])  # from the unit to the point between the feet, in our axes
turn = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]))
moved = np.column_stack([0 * time, 0 * time, log_heave]) + turn.apply(lever) - lever
table = np.column_stack([time, moved, np.degrees(roll), np.degrees(pitch), np.degrees(yaw)])
HEADER = "time_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg"
np.savetxt("monday.csv", table, delimiter=",", header=HEADER, comments="", fmt="%.5f")
print(f"heave at the unit {log_heave.std():.2f} m, at the A-frame {moved[:, 2].std():.2f} m (standard deviation)")

# %% [markdown]
# Stretches of it are drawn, 60 s each:

# %%
SEA_KEYS = ("vessel", "deck_position", "hs", "tp", "heading")
lines = [line for line in MINE.splitlines() if not line.startswith(SEA_KEYS)]
lines.insert(2, 'records = ["monday.csv"]')
Path("measured.toml").write_text("\n".join(lines))
compare("measured.toml")

# %% [markdown]
# ## In earnest
#
# `aframe evaluate --scenarios mine.toml --count 200 --policies "predictive control" "feed-forward + feedback"
# "winch-limited optimum" --out runs/mine` writes the same figures with intervals, every episode, and `report.html`,
# which shows how they depend on Hs, Tp, load and rope, and the worst cases one by one. `aframe ppo --scenarios
# mine.toml --observation sensors` trains an agent for this crane.
