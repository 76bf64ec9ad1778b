"""MuJoCo's inverted pendulum: Gymnasium's InvertedPendulum-v5, and its model in ``mujoco.rollout``."""

from __future__ import annotations

from serve import Measurement, cores, serve, speed

ROWS, STEPS = 1024, 20


def scalar() -> Measurement:
    import gymnasium

    env = gymnasium.make("InvertedPendulum-v5")
    env.reset(seed=0)
    action = 0.0 * env.action_space.sample()

    def step() -> None:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return speed(step, 1)


def rollout() -> Measurement:
    """Measure env steps of ``mujoco.rollout``, each of as many inner steps as InvertedPendulum-v5's."""
    import gymnasium
    import mujoco
    import numpy as np
    from mujoco.rollout import Rollout

    env = gymnasium.make("InvertedPendulum-v5").unwrapped
    model, frame_skip = env.model, env.frame_skip
    threads = cores()
    data = [mujoco.MjData(model) for _ in range(threads)]
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    state = np.zeros((ROWS, size))
    state[:, 1:] = np.random.default_rng(0).uniform(-0.01, 0.01, (ROWS, size - 1))
    control = np.zeros((ROWS, STEPS * frame_skip, model.nu))
    pool = Rollout(nthread=threads if threads > 1 else 0)
    return speed(lambda: pool.rollout(model, data, state, control, skip_checks=False), ROWS * STEPS)


if __name__ == "__main__":
    serve({"inverted-pendulum": scalar, "rollout-1024": rollout}, ("mujoco", "gymnasium", "numpy"))
