"""Train PPO of Stable-Baselines3 on the agents' interface, then run what it learned on held-out seas."""

from typing import Literal

import numpy as np
import torch
import tyro
from stable_baselines3 import PPO

from aframe_env import ScenarioDistribution, TaskConfig
from agents import FeatureConfig, FeaturePolicy
from agents.policy import DrumStill
from agents.rollout import held_out_scenarios, run
from train.learn.sb3_env import TrainingVecEnv


def learn(
    timesteps: int = 1_000_000, observation: Literal["state", "sensors"] = "state", seed: int = 0, scenarios: int = 50
) -> float:
    """Return the median heave reduction over so many held-out scenarios."""
    torch.set_num_threads(1)  # more only slow so small a network down
    config = TaskConfig(observation=observation)
    rows = TrainingVecEnv(64, config, seed=seed)  # AgentInterface on 64 rows of one simulation
    model = PPO(
        "MlpPolicy",
        rows,
        n_steps=128,
        batch_size=2048,
        n_epochs=10,
        learning_rate=lambda left: 1.8e-3 * max(left, 1.0 / 30.0),
        gamma=0.94,
        gae_lambda=0.97,
        clip_range=0.3,
        policy_kwargs={"log_std_init": -1.65},
        seed=seed,
        device="cpu",
    )
    model.learn(timesteps)
    policy = FeaturePolicy(lambda features: model.predict(features, deterministic=True)[0], FeatureConfig.of(config))
    seas = held_out_scenarios(ScenarioDistribution(), scenarios)
    left = run(policy, seas, observation=observation).rms / run(DrumStill(), seas).rms
    return 1.0 - float(np.median(left))


if __name__ == "__main__":
    print(f"median heave reduction: {tyro.cli(learn):.2%}")
