"""sb3-contrib: TQC on the full state, RecurrentPPO on the sensors."""

import gymnasium
import numpy as np
from sb3_contrib import TQC, RecurrentPPO
from stable_baselines3.common.env_util import make_vec_env

import aframe_env  # noqa: F401  (registers the environment)
from agents import AgentInterface


def main() -> None:
    """Make, step, train, save and load."""
    tqc = TQC("MlpPolicy", AgentInterface(gymnasium.make("AFrameHeave-v0")), device="cpu", seed=0)
    sensed = make_vec_env("AFrameHeave-v0", n_envs=2, seed=0, env_kwargs={"observation": "sensors"})
    recurrent = RecurrentPPO("MlpLstmPolicy", sensed, n_steps=128, device="cpu", seed=0)
    print("made")

    readings = sensed.reset()
    for _ in range(20):
        action, _ = recurrent.predict(readings)
        readings, rewards, _, _ = sensed.step(action)
        assert np.isfinite(readings).all()
        assert np.isfinite(rewards).all()
    print("stepped")

    tqc.learn(400)
    recurrent.learn(512)
    print("trained")

    tqc.save("tqc.zip")
    features = tqc.get_env().reset()
    expected, _ = tqc.predict(features, deterministic=True)
    found, _ = TQC.load("tqc.zip", device="cpu").predict(features, deterministic=True)
    np.testing.assert_array_equal(found, expected)
    recurrent.save("recurrent.zip")
    expected, memory = recurrent.predict(readings, deterministic=True)
    found, same = RecurrentPPO.load("recurrent.zip", device="cpu").predict(readings, deterministic=True)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(same, memory)
    print("saved")


if __name__ == "__main__":
    main()
