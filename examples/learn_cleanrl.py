"""PPO in one file, as CleanRL writes it, on the vector wrapper: train, then run what it learned on held-out seas."""

from pathlib import Path
from typing import Literal

import gymnasium
import numpy as np
import torch
import tyro
from gymnasium.vector import AutoresetMode
from torch import nn
from torch.distributions import Normal

import aframe_env
from agents import AgentVectorInterface, FeatureConfig, FeaturePolicy
from agents.policy import DrumStill
from agents.rollout import held_out_scenarios, run

ROWS, STEPS, EPOCHS, MINIBATCH = 64, 128, 10, 2048
RATE, GAMMA, LAMBDA, CLIP, GRADIENT_LIMIT = 1.8e-3, 0.94, 0.97, 0.3, 0.5


class Network(nn.Module):
    """A perceptron beside a linear path: a good action is close to linear in the features."""

    def __init__(self, inputs: int, last_gain: float) -> None:
        super().__init__()
        self.bent = nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh())
        self.head = nn.Linear(64 + inputs, 1)
        nn.init.orthogonal_(self.head.weight, last_gain)
        nn.init.zeros_(self.head.bias)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Outputs (..., 1) for features (..., F)."""
        return self.head(torch.cat([self.bent(x), x], dim=-1))


def learn(
    timesteps: int = 1_000_000,
    observation: Literal["state", "sensors"] = "state",
    seed: int = 0,
    scenarios: int = 50,
    save: Path | None = None,
) -> float:
    """Return the median heave reduction over so many held-out scenarios; ``save``: file for the actor's weights."""
    torch.set_num_threads(1)  # more only slow so small a network down
    torch.manual_seed(seed)
    config = aframe_env.TaskConfig(observation=observation)
    envs = gymnasium.make_vec(
        aframe_env.ENV_ID,
        num_envs=ROWS,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
        config=config,
    )
    envs = AgentVectorInterface(envs, stagger=True)
    inputs = len(envs.feature_names)
    actor, critic, log_std = Network(inputs, 0.01), Network(inputs, 1.0), nn.Parameter(torch.full((1,), -1.65))
    parameters = [*actor.parameters(), *critic.parameters(), log_std]
    optimizer = torch.optim.Adam(parameters, lr=RATE, eps=1e-5)
    seen = torch.from_numpy(envs.reset(seed=seed)[0])
    updates = max(1, timesteps // (ROWS * STEPS))
    for update in range(updates):
        optimizer.param_groups[0]["lr"] = RATE * max(1.0 - update / updates, 1.0 / 30.0)

        xs, actions = torch.zeros(STEPS, ROWS, inputs), torch.zeros(STEPS, ROWS, 1)
        rewards, ended = torch.zeros(STEPS, ROWS), torch.zeros(STEPS, ROWS)
        with torch.no_grad():
            for t in range(STEPS):
                xs[t], actions[t] = seen, Normal(actor(seen), log_std.exp()).sample()
                after, reward, terminated, truncated, infos = envs.step(actions[t].clamp(-1.0, 1.0).numpy())
                rewards[t] = torch.from_numpy(reward)
                cut = truncated & ~terminated
                if cut.any():  # the value of the last state stands for the rest
                    last = torch.from_numpy(np.stack(infos["final_obs"][cut]))
                    rewards[t, torch.from_numpy(cut)] += GAMMA * critic(last)[:, 0]
                ended[t] = torch.from_numpy(terminated | truncated)
                seen = torch.from_numpy(after)
            values = critic(torch.cat([xs, seen[None]]))[..., 0]
            advantages, coming = torch.zeros(STEPS, ROWS), torch.zeros(ROWS)
            for t in reversed(range(STEPS)):
                goes_on = 1.0 - ended[t]
                surprise = rewards[t] + GAMMA * goes_on * values[t + 1] - values[t]
                coming = advantages[t] = surprise + GAMMA * LAMBDA * goes_on * coming
            said = Normal(actor(xs), log_std.exp()).log_prob(actions).flatten()
        x, action, gain = xs.flatten(0, 1), actions.flatten(0, 1), advantages.flatten()
        target = gain + values[:-1].flatten()

        for _ in range(EPOCHS):
            for i in torch.randperm(len(x)).split(MINIBATCH):
                ratio = (Normal(actor(x[i]), log_std.exp()).log_prob(action[i])[:, 0] - said[i]).exp()
                g = (gain[i] - gain[i].mean()) / (gain[i].std() + 1e-8)
                policy_loss = -torch.min(g * ratio, g * ratio.clamp(1.0 - CLIP, 1.0 + CLIP)).mean()
                loss = policy_loss + 0.5 * nn.functional.mse_loss(critic(x[i])[:, 0], target[i])
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(parameters, GRADIENT_LIMIT)
                optimizer.step()

    if save is not None:
        torch.save(actor.state_dict(), save)
    policy = FeaturePolicy(
        lambda features: actor(torch.from_numpy(features)).detach().numpy(), FeatureConfig.of(config)
    )
    seas = held_out_scenarios(aframe_env.ScenarioDistribution(), scenarios)
    left = run(policy, seas, observation=observation).rms / run(DrumStill(), seas).rms
    return 1.0 - float(np.median(left))


if __name__ == "__main__":
    print(f"median heave reduction: {tyro.cli(learn):.2%}")
