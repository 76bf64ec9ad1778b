"""RLlib: the environment by its name and module in remote workers, PPO, and its checkpoint."""

from pathlib import Path

import numpy as np
import ray
import torch
from ray.rllib.algorithms.algorithm import Algorithm
from ray.rllib.algorithms.ppo import PPOConfig


def main() -> None:
    """Make, step, train, save and load."""
    ray.init(num_cpus=3, include_dashboard=False)
    config = (
        PPOConfig()
        .environment(
            "aframe_env:AFrameHeave-v0",
            env_config={"observation": "sensors", "scenario": {"kind": "distribution", "hs": [1.0, 2.0]}},
        )
        .env_runners(num_env_runners=2, num_envs_per_env_runner=2)
        .training(train_batch_size=512, minibatch_size=128, num_epochs=4, lr=3e-4)
        .debugging(seed=0)
    )
    algorithm = config.build_algo()
    print("made")

    result = algorithm.train()
    assert result["env_runners"]["num_env_steps_sampled_lifetime"] >= 512
    print("stepped")

    for _ in range(3):
        result = algorithm.train()
    losses = result["learners"]["default_policy"]
    assert np.isfinite(losses["total_loss"])
    print("trained")

    path = algorithm.save_to_path(str(Path("checkpoint").absolute()))
    readings = {"obs": torch.zeros(4, 10)}
    expected = algorithm.get_module().forward_inference(readings)["action_dist_inputs"]
    algorithm.stop()  # before the other one asks for as many workers
    again = Algorithm.from_checkpoint(path)
    found = again.get_module().forward_inference(readings)["action_dist_inputs"]
    torch.testing.assert_close(found, expected, rtol=0, atol=0)
    again.stop()
    ray.shutdown()
    print("saved")


if __name__ == "__main__":
    main()
