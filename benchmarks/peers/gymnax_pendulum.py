"""gymnax's Pendulum-v1, jitted and vmapped, on the CPU: a call a step, and 200 steps in one call."""

from __future__ import annotations

from functools import partial

from serve import Measurement, serve, speed

ROWS = 4096
STEPS = 200


def pendulum(steps: int) -> Measurement:
    import gymnax
    import jax
    import jax.numpy as jnp

    env, parameters = gymnax.make("Pendulum-v1")
    keys = jax.random.split(jax.random.PRNGKey(0), ROWS)
    actions = jnp.zeros((ROWS, 1))
    _, state = jax.vmap(env.reset, in_axes=(0, None))(keys, parameters)
    step = jax.vmap(env.step, in_axes=(0, 0, 0, None))

    def advance(state, _):
        observations, state, rewards, *_ = step(keys, state, actions, parameters)
        return state, (observations, rewards)

    if steps == 1:
        compiled = jax.jit(lambda state: advance(state, None))
    else:
        compiled = jax.jit(lambda state: jax.lax.scan(advance, state, None, length=steps))

    def call() -> None:
        nonlocal state
        state, _ = jax.block_until_ready(compiled(state))

    return speed(call, ROWS * steps)


if __name__ == "__main__":
    serve(
        {"pendulum-4096": partial(pendulum, 1), "pendulum-4096-scan": partial(pendulum, STEPS)},
        ("gymnax", "jax", "jaxlib", "numpy"),
    )
