"""A loop in CleanRL's style: Gymnasium's vectors and ours below the wrappers, then learn_cleanrl.py of the examples."""

from pathlib import Path

import gymnasium
import numpy as np
import torch
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from learn_cleanrl import Network, learn

import aframe_env  # noqa: F401  (registers the environment)
from agents import AgentInterface, AgentVectorInterface


def main() -> None:
    """Make, step, train, save and load."""
    rows = [
        gymnasium.make_vec("AFrameHeave-v0", num_envs=2, vectorization_mode="sync", wrappers=[AgentInterface]),
        gymnasium.make_vec("aframe_env:AFrameHeave-v0", 2, vectorization_mode="async", wrappers=[AgentInterface]),
        AgentVectorInterface(gymnasium.make_vec("AFrameHeave-v0", num_envs=2)),
    ]
    sync, asynchronous, native = (RecordEpisodeStatistics(each) for each in rows)
    print("made")

    features = [envs.reset(seed=0)[0] for envs in (sync, asynchronous, native)]
    rng = np.random.default_rng(0)
    for _ in range(320):  # beyond the end of the first episodes
        np.testing.assert_array_equal(features[1], features[0])
        np.testing.assert_array_equal(features[2], features[0])
        actions = rng.uniform(-0.1, 0.1, (2, 1)).astype(np.float32)
        features, rewards, _, _, infos = zip(
            *(envs.step(actions) for envs in (sync, asynchronous, native)), strict=True
        )
        np.testing.assert_allclose(rewards[1:], [rewards[0]] * 2, rtol=1e-12)
        assert len({"episode" in info for info in infos}) == 1
    asynchronous.close()
    print("stepped")

    reduction = learn(timesteps=16_384, scenarios=5, save=Path("actor.pt"))
    assert reduction > 0.8, f"median heave reduction {reduction:.1%}"
    print("trained")

    actor = Network(features[0].shape[1], 0.01)
    actor.load_state_dict(torch.load("actor.pt", weights_only=True))
    assert torch.isfinite(actor(torch.from_numpy(features[0]))).all()
    print("saved")


if __name__ == "__main__":
    main()
