# %% [markdown]
# # Launch from the deck
#
# For whoever plans a lift: an A-frame has a load over the deck and swings it outboard in a minute, in a sea of Hs 2 m,
# while the winch holds the load's level. How well does it, what must the drum do for it, how does the load sway, and
# what do cylinders and feet carry meanwhile? No learning here; the frame is rigid first, and elastic at the end.

# %% [markdown]
# ## The lift
#
# Angles are positive outboard, so that the frame begins at -40° over the deck. The [servomotors](../glossary.md), its
# luffing cylinders, take it to 25° on a [smooth path](../scenario-files.md#luffing). The load's level is held in space,
# 4 m above the mean deck: the deck heaves beneath it.

# %%
from pathlib import Path

import numpy as np

from aframe_env import TaskConfig, read_scenario

Path("launch.toml").write_text("""
load_mass = 50e3
target_level = 4.0
ramp = 5.0

[crane.frame]
luffing_angle = -0.6981317  # rad, -40°

[crane.winch]
min_rope_length = 2.0

[luffing]
points = [[5.0, -40.0], [65.0, 25.0]]

[motion]
kind = "sea"

[motion.sea]
hs = 2.0
tp = 8.0
""")
scenario = read_scenario("launch.toml")
frame = scenario.crane.frame
DURATION = 80.0
swing = scenario.luffing.at(frame, np.arange(0.0, DURATION, 0.1))
tip, drum = swing.pulley, np.array(scenario.crane.drum_position)
to_drum = np.linalg.norm(tip - drum, axis=1)
print(f"the pulley goes {np.ptp(tip[:, 0]):.1f} m outboard and rises {np.ptp(tip[:, 2]):.1f} m on the way")
print(f"rope that the drum pays out for that: {tip[-1, 2] + to_drum[-1] - tip[0, 2] - to_drum[0]:.1f} m")
print(f"peak speed of the frame: {np.degrees(abs(swing.angle_rate).max()):.1f} °/s")

# %% [markdown]
# ## Who holds the level
#
# Every policy is given the plan of the swing, so that the drum pays out for it, and adds what it makes of the sea:
# "drum still" nothing. The sensors' readings are 0.2 s old and noisy.

# %%
from agents.registry import BuildContext, choose
from agents.rollout import run

task = TaskConfig(scenario=scenario, observation="sensors", episode_duration=DURATION)
runs = {}
print(f"{'':26} RMS, m   largest, m   drum's rope speed, m/s")
for name in ("drum still", "feed-forward + feedback", "predictive control", "winch-limited optimum"):
    policy = choose(name).policy(BuildContext(scenarios=[scenario], config=task))
    runs[name] = run(policy, [scenario], task)
    speed = scenario.crane.winch.drum_radius * abs(runs[name].drum_speed).max()
    print(f"{name:26}{runs[name].rms[0]:7.3f}{runs[name].omega2[0]:13.2f}{speed:16.1f}")

# %% [markdown]
# The winch has 3 m/s. The largest errors come late, when the load sways the most: a load that swings on a short rope
# also rises and falls.
#
# ## The load's sway, and the deck below
#
# A drum cannot damp the sway of a load on 5 to 7 m of rope, whose period of 5 s lies among the waves'. Here is what
# would be left to tag lines or a docking head, and how near the load comes to the deck that heaves and pitches beneath.

# %%
from train.shared.episode import Episode

policy = choose("predictive control").policy(BuildContext(scenarios=[scenario], config=task))
episode = Episode(policy, task, scenario, noise_seed=0)
scenes = [episode.at(0.0).driven]
while not episode.over:
    episode.step()
    scenes.append(episode.at(episode.time).driven)
time = np.array([scene.time for scene in scenes])
over_deck = np.array([scene.rotation.T @ (scene.load - scene.deck) for scene in scenes])
pulley = np.array([scene.rotation.T @ (scene.pulley - scene.deck) for scene in scenes])
sway = over_deck[:, 0] - pulley[:, 0]
inboard = over_deck[:, 0] < 0.0
print(f"sway of the load from under the pulley: {abs(sway[time < 65]).max():.1f} m, {abs(sway).max():.1f} m after it")
print(
    f"least height over the deck: {over_deck[inboard, 2].min():.1f} m; it leaves the deck at {time[inboard][-1]:.0f} s"
)

# %% [markdown]
# ## What cylinders and feet carry
#
# The drum's own motion is played again on the [full model](../physics.md#the-full-model): an elastic frame that luffs,
# with its masses' inertia. Both servomotors are alike here, as sea and crane are symmetrical.

# %%
from aframe_env.rfem.simulate import DynamicCase, simulate
from agents.drives.functions import SplineDrive

angle = np.cumsum(runs["predictive control"].drum_speed[0, 1:]) * task.control_period
drive = SplineDrive(duration=DURATION, values=tuple(angle.tolist()))
result = simulate(DynamicCase(scenario=scenario, drum=drive, duration=DURATION, step=5e-3))
cylinders, feet = result.frame.servomotors() / 1e3, result.frame.feet() / 1e3
power = -cylinders.sum(axis=1) * result.frame.luffed.length_rate
print(
    f"each cylinder: {cylinders.min():.0f} to {cylinders.max():.0f} kN, a pull is positive; {power.max():.0f} kW both"
)
print(f"each foot: {feet[:, 0, 2].min():.0f} to {feet[:, 0, 2].max():.0f} kN upwards, from the deck")
print(f"rope: {result.tension.min() / 1e3:.0f} to {result.tension.max() / 1e3:.0f} kN")

# %% [markdown]
# A pushing cylinder is checked against buckling, a pulling one and a lifted foot against their bolts: the swing has
# both. All of it in one picture:

# %%
from matplotlib.figure import Figure

from aframe_env.rendering.painter import Painter

figure = Figure(figsize=(11.0, 9.0), layout="constrained")
top, charts = figure.subfigures(2, 1, height_ratios=(1.0, 1.9))
painter = Painter()
for axis, at in zip(top.subplots(1, 4), (5, 30, 42, 65), strict=True):
    axis.imshow(painter.pixels(scenes[10 * at], episode.own_history())[36:340, 300:604])
    axis.set_title(f"{at} s, {np.degrees(swing.angle[10 * at]):.0f}°", fontsize=10)
    axis.axis("off")
level, lean, force = charts.subplots(3, 1, sharex=True)
for name, colour in (("drum still", "tab:gray"), ("predictive control", "tab:orange")):
    level.plot(time, runs[name].error[0], color=colour, label=name)
level.set_ylabel("level of the load,\nm from its target")
level.legend(loc="upper left", fontsize=9)
lean.plot(time[:-1], np.degrees(swing.angle), color="tab:green", label="luffing angle, °")
lean.plot(time, 10.0 * sway, color="tab:blue", label="sway of the load, dm")
lean.legend(loc="upper left", fontsize=9)
force.plot(result.time, cylinders[:, 0], color="tab:red", label="a cylinder's pull, kN")
force.plot(result.time, feet[:, 0, 2], color="black", label="lift of the deck on a foot, kN")
force.plot(result.time, power, color="tab:purple", label="power of both cylinders, kW")
force.legend(loc="upper left", fontsize=9)
force.set_xlabel("time, s")
for axis in (level, lean, force):
    axis.grid(alpha=0.3)
figure.savefig("launch.png", dpi=110)

# %% [markdown]
# ![Four moments of the swing, the load's level, angle and sway, forces](launch.png)
#
# `python -m train.video --scenario launch.toml --policy "predictive control" --start 0 --seconds 60 --out launch.mp4`
# makes a film of it.
