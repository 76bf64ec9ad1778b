"""EnvPool's Pendulum-v1: rows, threads, and synchronous or asynchronous batches (of half the rows)."""

from __future__ import annotations

from functools import partial

from serve import Measurement, serve, speed

ROWS = (64, 1024, 4096)
THREADS = (1, 2)


def synchronous(rows: int, threads: int) -> Measurement:
    import envpool
    import numpy as np

    env = envpool.make("Pendulum-v1", env_type="gymnasium", num_envs=rows, num_threads=threads)
    env.reset()
    actions = np.zeros((rows, 1), dtype=np.float32)
    return speed(lambda: env.step(actions), rows)


def asynchronous(rows: int, threads: int) -> Measurement:
    import envpool
    import numpy as np

    batch = rows // 2
    env = envpool.make("Pendulum-v1", env_type="gymnasium", num_envs=rows, batch_size=batch, num_threads=threads)
    env.async_reset()
    actions = np.zeros((batch, 1), dtype=np.float32)

    def step() -> None:
        *_, info = env.recv()
        env.send(actions, info["env_id"])

    return speed(step, batch)


if __name__ == "__main__":
    kinds = {"sync": synchronous, "async": asynchronous}
    serve(
        {
            f"{kind}-{rows}-{threads}": partial(prepare, rows, threads)
            for kind, prepare in kinds.items()
            for rows in ROWS
            for threads in THREADS
        },
        ("envpool", "gymnasium", "numpy"),
    )
