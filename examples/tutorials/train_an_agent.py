# %% [markdown]
# # Train an agent
#
# From the bare environment to a trained agent that stands beside the best that is known, in half a minute on one core.
# For those who know reinforcement learning and not cranes; the words are in the [glossary](../glossary.md).

# %% [markdown]
# ## The environment as it is
#
# A load hangs on a rope from the stern of a ship. The ship heaves, and every 0.1 s you say how fast the winch's drum
# turns, rad/s. Here the sensors are observed: ten readings, noisy and late. First a drum that stands still:

# %%
import gymnasium
import numpy as np

import aframe_env

env = gymnasium.make(aframe_env.ENV_ID, observation="sensors")
observation, info = env.reset(seed=0)
total = 0.0
for _ in range(600):  # 60 s
    observation, reward, terminated, truncated, info = env.step(np.zeros(1, dtype=np.float32))
    total += float(reward)

print(f"observation {env.observation_space.shape}, action ±{env.action_space.high[0]:.0f} rad/s")
print(f"return {total:.1f}, Ω1 {info['omega1']:.1f} m² s, RMS of the depth error {np.sqrt(info['omega1'] / 60):.2f} m")

# %% [markdown]
# The return is minus Ω1, the integral of the squared depth error. That is what is scored, and it is no reward to learn
# from: see [what it does to a plain learner](../learners.md#what-the-raw-environment-does-to-a-plain-learner).
#
# ## The agents' interface
#
# `AgentInterface` puts features, an action and a reward around the environment that a learner gets on with:

# %%
from agents import AgentInterface

wrapped = AgentInterface(env)
print(*wrapped.feature_names, sep="\n")

# %% [markdown]
# An action of zero is not a drum that stands still: below the network is a hand-written feed-forward that follows the
# pulley. What is learned is the rest ([more](../learners.md#the-agents-interface)).
#
# ## Learn
#
# `TrainingVecEnv` is that interface on 64 rows of one simulation, for Stable-Baselines3. These are the settings of
# `train.ppo`, but for the number of steps, which is a tenth of it.

# %%
import torch
from stable_baselines3 import PPO

from aframe_env import TaskConfig
from train.learn.sb3_env import TrainingVecEnv

torch.set_num_threads(1)  # more only slow so small a network down
config = TaskConfig(observation="sensors")
model = PPO(
    "MlpPolicy",
    TrainingVecEnv(64, config, seed=0),
    n_steps=128,
    batch_size=2048,
    n_epochs=10,
    learning_rate=lambda left: 1.8e-3 * max(left, 1.0 / 30.0),
    gamma=0.94,
    gae_lambda=0.97,
    clip_range=0.3,
    policy_kwargs={"log_std_init": -1.65},
    seed=0,
    device="cpu",
)
model.learn(98_304)  # the shipped agents: 1,000,000
model.save("my_ppo.zip")
print(f"{model.num_timesteps:,} steps")

# %% [markdown]
# ## Compare
#
# What was learned is a function of features; `FeaturePolicy` makes a policy of it. It meets 40 held-out scenarios,
# which no training draws from, beside a drum left still, the feed-forward alone ("output zero"), the shipped agent, and
# predictive control, which is hand-written.

# %%
from rich.console import Console

from agents import FeatureConfig, FeaturePolicy
from agents.registry import as_spec, choose
from train.evaluate.run import HeldOut, run_all

mine = FeaturePolicy(
    lambda features: model.predict(features, deterministic=True)[0], FeatureConfig.of(config), name="my PPO"
)
policies = [
    choose("output zero on sensors"),
    as_spec(mine),
    choose("ppo-sensors"),
    choose("predictive control"),
]
comparison = run_all(policies, HeldOut(scenarios=40, observation="sensors"), Console(quiet=True))
print(f"{'':32} median   mean  worst 5 %")
for row in comparison.rows:
    figures = (row.reduction.value, row.mean.value, row.tail.value)
    print(f"{row.policy:32}" + "".join(f"{100 * figure:5.0f} %" for figure in figures))

# %% [markdown]
# The figures are heave reduction, 1 − RMS / RMS(drum still): its median, its mean, and its mean in the worst 5 % of the
# scenarios, here two of them. Forty scenarios and a tenth of the training are enough to see that it works, and not
# enough to say who is best: the [comparison](../results.md#the-comparison) has 1,000 scenarios and five seeds.
#
# ## Act with it
#
# On the environment itself the policy is called as a model of Stable-Baselines3 is; its memory is that of one episode.

# %%
observation, info = env.reset(seed=0)
memory = None
for _ in range(600):
    action, memory = mine.predict(observation, memory)
    observation, reward, terminated, truncated, info = env.step(action)
print(f"RMS of the depth error {np.sqrt(info['omega1'] / 60):.2f} m")

# %% [markdown]
# ## In earnest
#
# `aframe ppo --observation sensors --out runs/mine` does all of this with a million steps in three minutes, and writes
# an agent that `agents.load("./runs/mine")` reads, its card and its comparison. `--seeds 5` shows how much is luck.
# Other learners, wrappers and settings: [learners](../learners.md).
