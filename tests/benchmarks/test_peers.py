"""The peers compute what the package computes, and one that is missing is told of, not crashed on."""

import sys
from pathlib import Path

import numpy as np
import pytest

from aframe_env.dynamics import layout as at
from benchmarks.catalogue import ENVPOOL_SCRIPT, Script
from benchmarks.limit.library import NoCompiler, compile_library
from benchmarks.limit.measure import TOLERANCE, trajectories
from benchmarks.package.dynamics import SyntheticMotion, engine
from benchmarks.peers import solve_ivp
from benchmarks.workers import NotMeasured, Pythons, Worker

GYMNASIUM = Script("benchmarks/peers/gymnasium_envs.py")


def test_scipy_gives_the_package_s_load():
    ours = engine(1, SyntheticMotion())
    start = ours.read_many(at.LOAD_POSITION, 3)[0]
    farthest, still = 0.0, np.zeros(1)
    for _ in range(solve_ivp.CONTROL_STEPS):
        ours.step(still)
        load = ours.read_many(at.LOAD_POSITION, 3)[0]
        farthest = max(farthest, abs(load[2] - start[2]))
    assert farthest > 0.5
    np.testing.assert_allclose(solve_ivp.episode()[:3], load, atol=5e-3)


def test_cpp_gives_the_package_s_load():
    try:
        compile_library()
    except NoCompiler as reason:
        pytest.skip(str(reason))
    theirs, ours = trajectories()
    assert np.ptp(ours[:, :, 2]) > 1.0
    assert np.abs(theirs - ours).max() < TOLERANCE


def test_a_missing_interpreter_is_named():
    missing = Script(GYMNASIUM.path, "peers")
    with pytest.raises(NotMeasured, match="python-of-nobody: No such file"):
        Worker(missing, 1, Pythons(Path("nowhere/bin/python-of-nobody")))


def test_a_script_that_fails_says_so_and_goes_on():
    worker = Worker(GYMNASIUM, 1, Pythons(Path(sys.executable)))
    try:
        with pytest.raises(NotMeasured, match="KeyError: 'nonsense'"):
            worker.sample("nonsense")
        assert worker.sample("pendulum") > 0.0
        assert "gymnasium" in worker.versions
    finally:
        worker.close()


def test_a_peer_that_could_not_be_installed_is_reported_with_the_reason(tmp_path):
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "python").symlink_to(Path(sys.executable).resolve())  # without any packages
    (tmp_path / "failures.json").write_text('{"envpool==1": "ERROR: no matching distribution"}')
    worker = Worker(ENVPOOL_SCRIPT, 1, Pythons(tmp_path / "bin" / "python"))
    try:
        with pytest.raises(NotMeasured, match="envpool==1 could not be installed: ERROR: no matching"):
            worker.sample("sync-64-1")
    finally:
        worker.close()


def test_more_cores_than_there_are():
    with pytest.raises(NotMeasured, match="needs 10000 cores"):
        Worker(GYMNASIUM, 10_000, Pythons(Path(sys.executable)))
