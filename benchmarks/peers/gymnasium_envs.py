"""Gymnasium's Pendulum-v1 and CartPole-v1: scalar through ``gymnasium.make``, and 64 rows of ``make_vec``, sync."""

from __future__ import annotations

from functools import partial
from typing import Any

from serve import Measurement, serve, speed

ROWS = 64


def scalar(env_id: str) -> Measurement:
    import gymnasium

    env = gymnasium.make(env_id)
    env.reset(seed=0)
    env.action_space.seed(0)
    action: Any = env.action_space.sample()

    def step() -> None:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return speed(step, 1)


def vector(env_id: str) -> Measurement:
    import gymnasium

    env = gymnasium.make_vec(env_id, num_envs=ROWS, vectorization_mode="sync")
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = env.action_space.sample()
    return speed(lambda: env.step(actions), ROWS)


if __name__ == "__main__":
    serve(
        {
            "pendulum": partial(scalar, "Pendulum-v1"),
            "cartpole": partial(scalar, "CartPole-v1"),
            "pendulum-vec-64": partial(vector, "Pendulum-v1"),
            "cartpole-vec-64": partial(vector, "CartPole-v1"),
        },
        ("gymnasium", "numpy"),
    )
