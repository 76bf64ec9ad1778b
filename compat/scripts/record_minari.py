"""Minari: record a shipped agent, read the data set back, and make its environment again from it."""

import gymnasium
import minari
import numpy as np

import aframe_env  # noqa: F401  (registers the environment)
import agents


def main() -> None:
    """Make, step, save and load; a data set does not train."""
    arguments = {"observation": "sensors", "scenario": {"kind": "distribution", "hs": [1.0, 2.0]}}
    env = minari.DataCollector(gymnasium.make("AFrameHeave-v0", **arguments), record_infos=True)
    print("made")

    agent = agents.load("ppo-sensors")
    for seed in range(2):
        observation, _ = env.reset(seed=seed)
        memory, ended = None, False
        while not ended:
            action, memory = agent.predict(observation, memory)
            observation, _, terminated, truncated, _ = env.step(action)
            ended = terminated or truncated
    print("stepped")

    env.create_dataset("aframe-heave/agent-v0", algorithm_name="ppo-sensors", author="compat")
    data = minari.load_dataset("aframe-heave/agent-v0")
    assert data.total_steps == 1200
    again = data.recover_environment()
    for seed, episode in enumerate(data.iterate_episodes()):
        observation, info = again.reset(seed=seed)
        np.testing.assert_array_equal(observation, episode.observations[0])
        for step, action in enumerate(episode.actions):
            observation, reward, _, _, info = again.step(action)
            np.testing.assert_array_equal(observation, episode.observations[step + 1])
            assert reward == episode.rewards[step]
        assert info["omega1"] == episode.infos["omega1"][-1]
    print("saved")


if __name__ == "__main__":
    main()
