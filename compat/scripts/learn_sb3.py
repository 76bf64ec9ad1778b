"""Stable-Baselines3: PPO by the environment's name, rows in worker processes, evaluate_policy on a shipped agent."""

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import SubprocVecEnv

import agents


def main() -> None:
    """Make, step, train, save and load."""
    import aframe_env  # noqa: F401  (registers the name; the workers find it by its module)

    raw = PPO("MlpPolicy", "AFrameHeave-v0", n_steps=512, device="cpu", seed=0)
    workers = make_vec_env(
        "aframe_env:AFrameHeave-v0", n_envs=2, seed=0, vec_env_cls=SubprocVecEnv, wrapper_class=agents.AgentInterface
    )
    print("made")

    seas = make_vec_env("AFrameHeave-v0", n_envs=2, seed=0)
    mean, spread = evaluate_policy(agents.load("ppo"), seas, n_eval_episodes=4)
    assert isinstance(mean, float)
    assert -5.0 < mean < 0.0, f"mean return of the shipped agent {mean:.3f} ± {spread:.3f} m² s"
    print("stepped")

    raw.learn(1024)
    model = PPO("MlpPolicy", workers, n_steps=256, device="cpu", seed=0).learn(4096)
    print("trained")

    model.save("ppo.zip")
    features = workers.reset()
    expected, _ = model.predict(features, deterministic=True)
    found, _ = PPO.load("ppo.zip", device="cpu").predict(features, deterministic=True)
    np.testing.assert_array_equal(found, expected)
    workers.close()
    print("saved")


if __name__ == "__main__":
    main()
