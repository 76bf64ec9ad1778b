import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import hypothesis
import numpy as np
import numpy.typing as npt
import pytest
from gymnasium.error import DependencyNotInstalled
from hypothesis import strategies as st

from aframe_env import InvalidValue
from train.shared.job_store import JobStore, NotStored
from train.shared.jobs import JobsFailed, Where, run_jobs
from train.shared.local_workers import WorkerDied


@dataclass(frozen=True)
class Cell:
    number: int
    folder: str = ""


@dataclass(frozen=True)
class Square:
    value: int
    parts: tuple[float, ...]


def squared(cell):
    if cell.folder:
        # What was computed, and how often, as the file system saw it.
        with (Path(cell.folder) / "computed").open("a") as log:
            log.write(f"{cell.number}\n")
    return Square(cell.number**2, (0.1 * cell.number, 1.0 / 3.0))


def dies_once(path):
    marker = Path(path)
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return 1


def dies(number):
    if number == 1:
        os._exit(3)
    return number


def refuses(number):
    if number % 2:
        raise ValueError(f"{number} is odd")
    return number


def threads(_):
    import numba

    return os.environ["OMP_NUM_THREADS"], numba.config.NUMBA_NUM_THREADS


def store_in(folder, version="1"):
    return JobStore(Path(folder) / "cells.sqlite", Square, version)


def computed(folder):
    log = Path(folder) / "computed"
    return sorted(map(int, log.read_text().split())) if log.exists() else []


def test_results_come_in_the_order_of_the_items(tmp_path):
    cells = [Cell(n, str(tmp_path)) for n in (3, 1, 2)]
    assert [s.value for s in run_jobs(squared, cells, where=Where(workers=2))] == [9, 1, 4]
    assert computed(tmp_path) == [1, 2, 3]
    assert run_jobs(squared, []) == []


def test_a_store_gives_back_what_was_computed_bit_for_bit_and_computes_the_rest(tmp_path):
    cells = [Cell(n, str(tmp_path)) for n in range(4)]
    with store_in(tmp_path) as store:
        first = run_jobs(squared, cells[:3], store=store, where=Where(workers=1))
    with store_in(tmp_path) as store:
        again = run_jobs(squared, [*cells, cells[0]], store=store, where=Where(workers=1))
    assert again[:3] == first
    assert again[4] == again[0]
    assert computed(tmp_path) == [0, 1, 2, 3]


def test_configuration_version_and_type_of_the_result_make_the_key(tmp_path):
    with store_in(tmp_path) as store, store_in(tmp_path, "2") as newer:
        keys = {store.key(Cell(2)), store.key(Cell(3)), store.key({"number": 2}), newer.key(Cell(2))}
        assert len(keys) == 4
        assert store.key(Cell(2)) == store.key({"folder": "", "number": 2})


def test_a_key_of_ones_own_decides_what_is_computed_once(tmp_path):
    cells = [Cell(n, str(tmp_path)) for n in (1, 2, -1)]
    with store_in(tmp_path) as store:
        found = run_jobs(squared, cells, lambda cell: abs(cell.number), store=store, where=Where(workers=1))
    assert [s.parts[0] for s in found] == pytest.approx([0.1, 0.2, 0.1])
    assert computed(tmp_path) == [1, 2]


def test_a_worker_that_dies_is_replaced_and_its_task_tried_again(tmp_path):
    items = [str(tmp_path / "marker0"), str(tmp_path / "marker0")]
    assert run_jobs(dies_once, items, where=Where(workers=1), attempts=2) == [1, 1]


def test_a_task_that_always_kills_its_worker_is_reported_and_the_others_are_done(tmp_path):
    with JobStore(tmp_path / "cells.sqlite", int, "1") as store:
        with pytest.raises(JobsFailed, match=r"1 of 4 jobs failed; the first, job 1: .*2 attempts") as failed:
            run_jobs(dies, [0, 1, 2, 3], store=store, where=Where(workers=2), attempts=2)
        assert isinstance(failed.value.failures[0][1], WorkerDied)
        assert sorted(store.read([store.key(n) for n in range(4)]).values()) == [0, 2, 3]


def test_a_task_that_raises_is_reported_with_its_own_error():
    with pytest.raises(JobsFailed, match="2 of 4 jobs failed") as failed:
        run_jobs(refuses, [0, 1, 2, 3], where=Where(workers=1))
    assert [(i, str(e)) for i, e in failed.value.failures] == [(1, "1 is odd"), (3, "3 is odd")]


def test_workers_compute_with_one_thread_and_leave_the_parent_as_it_was():
    before = dict(os.environ)
    assert run_jobs(threads, [0], where=Where(workers=1)) == [("1", 1)]
    assert dict(os.environ) == before


SWEEP = """
import sys, time
from pathlib import Path
from train.shared.job_store import JobStore
from train.shared.jobs import Where, run_jobs

def slow(number):
    (Path(sys.argv[1]) / f"begun{number}").touch()
    time.sleep(0.1 if number < 3 else 600.0)
    return number

if __name__ == "__main__":
    with JobStore(Path(sys.argv[1]) / "cells.sqlite", int, "1") as store:
        try:
            run_jobs(slow, range(6), store=store, where=Where(workers=2))
        except KeyboardInterrupt:
            sys.exit(130)
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_an_interrupted_sweep_loses_only_what_was_in_flight(tmp_path, how, start):
    script = tmp_path / "sweep.py"
    script.write_text(SWEEP)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = start([sys.executable, str(script), str(tmp_path)], env=environment, stdout=subprocess.DEVNULL)
    # Tasks 3 and 4 begin only when a worker is free: 0, 1 and 2 have then been handed back.
    until = time.monotonic() + 60.0
    while not all((tmp_path / f"begun{n}").exists() for n in range(5)) and time.monotonic() < until:
        time.sleep(0.05)
    assert process.poll() is None
    if how == signal.SIGINT:
        os.killpg(process.pid, how)
    else:
        process.kill()
    status = process.wait(timeout=60.0)
    assert status == (130 if how == signal.SIGINT else -signal.SIGKILL)
    with JobStore(tmp_path / "cells.sqlite", int, "1") as store:
        kept = store.read([store.key(n) for n in range(6)])
        assert sorted(kept.values()) == [0, 1, 2]
    # The workers, asleep in the middle of their tasks for ten minutes, have gone too.
    while group := _members(process.pid):
        assert time.monotonic() < until, group
        time.sleep(0.05)


def _members(session):
    found = subprocess.run(["ps", "-o", "pid=,stat=", "-s", str(session)], capture_output=True, text=True).stdout
    return [line for line in found.splitlines() if " Z" not in line]


def test_a_store_that_is_something_else_is_refused(tmp_path):
    path = tmp_path / "cells.sqlite"
    path.write_text("not a database, and long enough to look at" * 50)
    with pytest.raises(InvalidValue, match="not a results store"):
        JobStore(path, int, "1")


def test_bad_arguments_are_named():
    with pytest.raises(InvalidValue, match="attempts = 0: must be in"):
        run_jobs(squared, [], attempts=0)
    with pytest.raises(InvalidValue, match="workers = 0: must be in"):
        Where(workers=0)


@pytest.mark.parametrize("address", ["", "somewhere", "ray://head:10001", "head:", "a b:1"])
def test_an_address_that_is_none_is_named(address):
    with pytest.raises(InvalidValue, match=f"cluster = '{address}': must be auto or HOST:PORT"):
        Where(cluster=address)


def test_a_cluster_needs_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(DependencyNotInstalled, match=r'ray is not installed: pip install "aframe-heave\[cluster\]"'):
        run_jobs(squared, [Cell(1)], where=Where(cluster="auto"))


@dataclass(frozen=True)
class Heard:
    number: int
    sound: npt.NDArray[np.float32]
    whole: npt.NDArray[np.int64]


def test_arrays_come_back_bit_for_bit(tmp_path):
    heard = Heard(1, np.random.default_rng(0).normal(size=(3, 5)).astype(np.float32), np.arange(4)[::-2])
    with JobStore(tmp_path / "cells.sqlite", Heard, "1") as store:
        assert store.get("a", lambda: heard) is heard
    with JobStore(tmp_path / "cells.sqlite", Heard, "1") as store:
        again = store.get("a", lambda: pytest.fail("it is there"))
    for name in ("sound", "whole"):
        was, came = getattr(heard, name), getattr(again, name)
        assert (came.dtype, came.shape, came.tobytes()) == (was.dtype, was.shape, was.tobytes())
        assert came.flags.writeable


@pytest.mark.parametrize(
    "value", [Square(1, (float("nan"),)), Heard(1, np.array([1.0, np.inf], dtype=np.float32), np.arange(1))]
)
def test_nan_and_infinity_are_never_stored(value, tmp_path):
    with JobStore(tmp_path / "cells.sqlite", type(value), "1") as store:
        with pytest.raises(NotStored, match=r"the result of job '\w{12}' has NaN or infinity in it: it is not stored"):
            store.write(store.key("a"), value)
        assert store.read([store.key("a")]) == {}


def not_finite_if_odd(number):
    return number * (float("nan") if number % 2 else 1.0)


def test_a_job_of_which_nan_comes_is_named_and_the_others_are_kept(tmp_path):
    with JobStore(tmp_path / "cells.sqlite", float, "1") as store:
        with pytest.raises(JobsFailed, match=r"1 of 3 jobs failed; the first, job 1: .*NaN"):
            run_jobs(not_finite_if_odd, [0, 1, 2], store=store, where=Where(workers=1))
        assert store.read([store.key(n) for n in range(3)]) == {store.key(0): 0.0, store.key(2): 2.0}


@pytest.mark.parametrize("column", ["key", "result", "digest"])
def test_a_row_that_was_altered_is_named_and_computed_anew(column, tmp_path, capsys):
    cells = [Cell(n, str(tmp_path)) for n in range(3)]
    with store_in(tmp_path) as store:
        for cell in cells:
            store.get(cell, partial(squared, cell))
        key = store.key(cells[1])
    with sqlite3.connect(tmp_path / "cells.sqlite") as database:
        database.execute(
            f"UPDATE results SET {column} = replace({column}, substr({column}, 9, 1), '~') WHERE key = '{key}'"
        )
    capsys.readouterr()
    with store_in(tmp_path) as store:
        said = capsys.readouterr().err
        assert [store.get(cell, partial(squared, cell)).value for cell in cells] == [0, 1, 4]
    assert said.count("warning: store = ") == 1
    assert "does not match its digest: it is computed anew" in said
    assert computed(tmp_path) == [0, 1, 1, 2]
    with store_in(tmp_path) as store:
        assert len(store.read([store.key(cell) for cell in cells])) == 3
    assert capsys.readouterr().err == ""


def test_a_row_that_is_no_result_is_named_and_computed_anew(tmp_path, capsys):
    with JobStore(tmp_path / "cells.sqlite", int, "1") as numbers, store_in(tmp_path) as squares:
        key = squares.key("a")
        numbers.write(key, 7)
        assert squares.read([key]) == {}
        assert f"job '{key[:12]}' holds no Square ('int' object has" in capsys.readouterr().err


def test_no_damage_to_the_file_gives_a_wrong_result_or_hides_one(tmp_path, capsys):
    with store_in(tmp_path) as store:
        truth = {store.key(n): squared(Cell(n)) for n in range(60)}
        for key, value in truth.items():
            store.write(key, value)
    whole = (tmp_path / "cells.sqlite").read_bytes()

    @hypothesis.settings(max_examples=150, deadline=None)
    @hypothesis.given(
        place=st.integers(0, len(whole) - 1), seed=st.integers(0, 9), length=st.sampled_from([1, 1, 1, 4, 64, 4096])
    )
    # A letter of the schema that SQLite's own words then quote, which are no UTF-8.
    @hypothesis.example(place=3997, seed=0, length=1)
    def damaged(place, seed, length):
        data = bytearray(whole)
        data[place : place + length] = random.Random(seed).randbytes(len(data[place : place + length]))
        (tmp_path / "cells.sqlite").write_bytes(data)
        capsys.readouterr()
        try:
            with store_in(tmp_path) as store:
                found = store.read(list(truth))
        except InvalidValue as refused:
            said = str(refused)
        else:
            said = ""
        if said:
            assert "delete it, and what it held is computed anew" in said
            assert "\n" not in said
            return
        assert found.items() <= truth.items()
        assert len(truth) - len(found) <= capsys.readouterr().err.count("warning: ")

    damaged()


def test_a_store_of_other_tables_is_refused(tmp_path):
    with sqlite3.connect(tmp_path / "cells.sqlite") as database:
        database.execute("CREATE TABLE results (key TEXT PRIMARY KEY, result TEXT NOT NULL) WITHOUT ROWID")
    with pytest.raises(InvalidValue, match=r"not a results store, or damaged: delete it.*it holds other tables"):
        store_in(tmp_path)
