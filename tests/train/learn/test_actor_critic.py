"""Learners' networks give the same bits wherever their inputs lie."""

import numpy as np
import pytest
import torch

from train.learn.actor_critic import ActorLatent, CriticLatent


@pytest.mark.parametrize("rows", [1, 2, 3, 8])
@pytest.mark.parametrize("latent", [ActorLatent(23, 64), CriticLatent(23, 64)], ids=["actor", "critic"])
def test_bits_do_not_depend_on_where_the_inputs_lie(latent: torch.nn.Module, rows: int) -> None:
    inputs = np.random.default_rng(rows).standard_normal((rows, 23)).astype(np.float32)
    found = set()
    for offset in range(0, 64, 4):
        memory = np.zeros(inputs.nbytes + 128, np.uint8)
        begin = -memory.ctypes.data % 64 + offset
        moved = memory[begin : begin + inputs.nbytes].view(np.float32).reshape(inputs.shape)
        moved[...] = inputs
        with torch.no_grad():
            found.add(latent(torch.as_tensor(moved)).numpy().tobytes())
    assert len(found) == 1
