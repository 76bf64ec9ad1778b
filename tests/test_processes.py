"""Compiled loops that spread over the cores, in forked processes and in two threads at once: each in a process."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import subprocess
import sys

import pytest

STEPPED = """
import gymnasium, numpy as np, aframe_env

def stepped(model="simplified", rows=130, seed=1):
    env = gymnasium.make_vec("AFrameHeave-v0", num_envs=rows, vectorization_mode="vector_entry_point", model=model)
    env.reset(seed=seed)
    speeds = np.linspace(-1.0, 1.0, rows, dtype=np.float32)[:, None]
    for _ in range(5):
        observation, reward, _, _, info = env.step(speeds)
    return observation.tobytes() + reward.tobytes()
"""
FORKED = """
import multiprocessing, sys
before = stepped({model!r})
with multiprocessing.get_context("fork").Pool(1) as pool:
    assert pool.apply_async(stepped, ({model!r},)).get({limit}) == before
from numba import threading_layer
print(threading_layer())
"""
LOADER = """
import torch
class Episodes(torch.utils.data.Dataset):
    def __len__(self):
        return 1
    def __getitem__(self, index):
        return stepped()
before = stepped()
loader = torch.utils.data.DataLoader(
    Episodes(), batch_size=None, num_workers=1, multiprocessing_context="fork", timeout={limit}
)
assert list(loader) == [before]
"""
AT_ONCE = """
import threading
alone = [stepped(rows=400, seed=seed) for seed in (1, 2)]
together = [[], []]
def work(place, seed):
    for _ in range(8):
        together[place].append(stepped(rows=400, seed=seed))
threads = [threading.Thread(target=work, args=each) for each in enumerate((1, 2))]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert together == [[each] * 8 for each in alone]
from numba import threading_layer
print(threading_layer())
"""
LIMIT = 300
"""s; the first of all compiles."""

LAYERS = {"workqueue": "workqueue", "omp": "omppool", "tbb": "tbbpool"}


@pytest.fixture(params=LAYERS)
def layer(request: pytest.FixtureRequest) -> str:
    """A threading layer of numba that is installed."""
    try:
        importlib.import_module(f"numba.np.ufunc.{LAYERS[request.param]}")
    except ImportError as error:
        pytest.skip(f"numba's threading layer {request.param}: {error}")
    return str(request.param)


def run(code: str, layer: str) -> str:
    """What a process writes to standard output."""
    environment = os.environ | {"NUMBA_THREADING_LAYER": layer, "NUMBA_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", STEPPED + code], env=environment, capture_output=True, text=True, timeout=2 * LIMIT
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


needs_fork = pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="fork: not on Windows")


@needs_fork
@pytest.mark.parametrize("model", ["simplified", "rfem"])
def test_a_forked_process_gives_the_bits_of_the_one_it_comes_from(layer: str, model: str) -> None:
    assert run(FORKED.format(model=model, limit=LIMIT), layer) == f"{layer}\n"


@needs_fork
def test_a_forked_worker_of_torch_gives_the_same_bits(layer: str) -> None:
    pytest.importorskip("torch")
    run(LOADER.format(limit=LIMIT), layer)


def test_two_threads_step_two_environments_at_once(layer: str) -> None:
    assert run(AT_ONCE, layer) == f"{layer}\n"
