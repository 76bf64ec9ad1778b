"""SBX: SAC in JAX on the agents' interface."""

import gymnasium
import numpy as np
from sbx import SAC

import aframe_env  # noqa: F401  (registers the environment)
from agents import AgentInterface


def main() -> None:
    """Make, step, train, save and load."""
    model = SAC("MlpPolicy", AgentInterface(gymnasium.make("AFrameHeave-v0")), seed=0)
    print("made")

    rows = model.get_env()
    features = rows.reset()
    for _ in range(20):
        action, _ = model.predict(features)
        features, rewards, _, _ = rows.step(action)
        assert np.isfinite(features).all()
        assert np.isfinite(rewards).all()
    print("stepped")

    model.learn(1000)
    print("trained")

    model.save("sac.zip")
    expected, _ = model.predict(features, deterministic=True)
    found, _ = SAC.load("sac.zip").predict(features, deterministic=True)
    np.testing.assert_array_equal(found, expected)
    print("saved")


if __name__ == "__main__":
    main()
