"""Fit a network to the actions of a Minari data set of ``python -m train.dataset``, and run it on held-out seas."""

from typing import Literal

import minari
import numpy as np
import torch
import tyro
from torch import nn

from agents import FeatureConfig, FeaturePolicy, load
from agents.imported import FunctionPolicy
from agents.learned.feature_sets import features_for
from agents.policy import DrumStill, Knowledge
from agents.rollout import held_out_scenarios, run

BATCH = 1024


def clone(
    dataset: str = "aframe-heave/state-noisy-v0",
    inputs: Literal["raw", "features"] = "raw",
    epochs: int = 12,
    seed: int = 0,
    scenarios: int = 100,
) -> dict[str, np.ndarray]:
    """Return the heave reduction of clone, expert and drum still in each held-out scenario."""
    torch.set_num_threads(1)  # more only slow so small a network down
    torch.manual_seed(seed)
    data = minari.load_dataset(dataset)
    env = data.recover_environment()
    env.reset(seed=0)
    config, scenario = env.unwrapped.simulation.config, env.unwrapped.scenario.as_told
    episodes = [episode for episode in data.iterate_episodes() if episode.truncations[-1]]  # no parted ropes
    seen = np.stack([episode.observations[:-1] for episode in episodes])
    actions = np.stack([episode.actions[:, 0] for episode in episodes]).astype(np.float64)
    # The expert often asks for more than the winch can reach in a step: what it can reach is as good, and easier.
    time = config.control_period + (config.sensors.delay if config.sensors else 0.0)
    winch = scenario.crane.winch
    reach, limit = winch.max_acceleration * time, winch.max_speed
    speed = seen[:, :, [quantity.name for quantity in config.quantities].index("drum_speed")]
    target = np.clip(actions, speed - reach, speed + reach) / limit
    made_for = FeatureConfig.of(config, "speed")
    if inputs == "features":  # what the agents see: filtered, with a forecast of the waves
        memory = features_for(len(seen), made_for)
        rows = [memory.start(seen[:, 0], [scenario] * len(seen))]
        for t in range(1, seen.shape[1]):
            memory.command(actions[:, t - 1] / limit)
            rows.append(memory.advance(seen[:, t]))
        seen = np.stack(rows, axis=1)
    x, y = torch.from_numpy(seen).flatten(0, 1), torch.from_numpy(target.astype(np.float32)).reshape(-1, 1)
    mean, std = x.mean(0), x.std(0) + 1e-9
    layers = nn.Linear(x.shape[1], 128), nn.SiLU(), nn.Linear(128, 128), nn.SiLU(), nn.Linear(128, 1)
    network = nn.Sequential(*layers)
    optimizer = torch.optim.Adam(network.parameters())
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 5e-3, epochs * -(-len(x) // BATCH))
    for _ in range(epochs):
        for i in torch.randperm(len(x)).split(BATCH):
            loss = nn.functional.mse_loss(network((x[i] - mean) / std), y[i]) / y.var()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()

    def output(rows: np.ndarray) -> np.ndarray:
        return network((torch.from_numpy(rows) - mean) / std).detach().numpy().clip(-1.0, 1.0)

    raw = FunctionPolicy("clone", lambda rows: limit * output(rows), Knowledge.SENSORS, takes_time=False)
    cloned = raw if inputs == "raw" else FeaturePolicy(output, made_for)
    expert = load("predictive-ppo-sensors" if config.sensors else "predictive-ppo")
    seas = held_out_scenarios(config.source, scenarios)
    policies = {"clone": cloned, "expert": expert, "still": DrumStill()}
    rms = {name: run(policy, seas, config).rms for name, policy in policies.items()}
    return {name: 1.0 - each / rms["still"] for name, each in rms.items()}


if __name__ == "__main__":
    for name, each in tyro.cli(clone).items():
        print(f"{name:>6}: heave reduction {np.median(each):.1%} in the median, {each.mean():.1%} in the mean")
