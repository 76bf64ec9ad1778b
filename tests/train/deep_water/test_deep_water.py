"""The study of deep water."""

from __future__ import annotations

import importlib
import math
from pathlib import Path

import numpy as np
import pytest

from aframe_env.suite.deep_rope import DEEP_CRANE, steel_load
from aframe_env.validation import InvalidValue
from train.deep_water.__main__ import Options
from train.deep_water.harmonics import Grid, WetNode, find, left
from train.deep_water.lifts import lifts
from train.deep_water.passage import Passage, bobbing_periods, running
from train.deep_water.zero_shot import ON_SENSORS, POLICIES, trials
from train.shared.job_store import JobStore

NODE = WetNode(amplitude=1.0, period=9.0, mass=60e3, length=1500.0, crane=DEEP_CRANE, periods=2.0)
SMALL = (
    *("--policies", "drum still", "feed-forward + feedback", "--lifts", "2", "--depths", "300", "400"),
    *("--periods", "8", "9", "--masses", "5e4", "6e4", "--amplitudes", "1", "2"),
    *("--top", "200", "--bottom", "202", "--workers", "1", "--out", "out"),
)


def test_the_best_drive_of_a_node_is_the_closed_form() -> None:
    found = find(NODE)
    assert found.ratio == pytest.approx(1.0 / (1.0 + NODE.scenario.pulley_strain), abs=2e-4)
    assert left(NODE, 0.0) == pytest.approx(found.still)
    assert found.best.remaining * found.still < found.mistuned < 0.1 * found.still


def test_middles_lie_between_the_nodes() -> None:
    grid = Grid(amplitudes=(1.0, 2.0), periods=(8.0, 10.0), masses=(4e4, 6e4), depths=(500.0, 2000.0))
    (middle,) = grid.middles
    assert (middle.amplitude, middle.mass) == (1.5, 5e4)
    assert middle.period == pytest.approx(math.sqrt(80.0))
    assert middle.length == pytest.approx(1000.0)
    assert len(grid.nodes) == 16


def test_loads_of_the_table_are_of_one_form() -> None:
    rng = np.random.default_rng(0)
    for scenario in (lifts(1000.0).draw(rng) for _ in range(5)):
        assert scenario.load.volume == pytest.approx(steel_load(scenario.load_mass).volume)
        assert scenario.load.drag_area_vertical == pytest.approx(steel_load(scenario.load_mass).drag_area_vertical)
        assert scenario.rope_length == pytest.approx(1000.0)


def test_policies_on_sensors_run_once_more_with_a_transponder() -> None:
    every = trials((300.0, 3000.0), 4)
    assert len(every) == 2 * (len(POLICIES) + len(ON_SENSORS))
    late = next(each for each in every if each.transponder and each.depth == 3000.0)
    assert late.config.replaced(observation="sensors").sensors.depth_error.delay == pytest.approx(2.0)  # type: ignore[union-attr]


def test_the_passage_goes_all_the_way_through_the_resonance() -> None:
    passage = Passage(policy="drum still", top=200.0, bottom=3000.0, speed=1.0)
    depths = passage.depths
    assert (depths[0], depths[-1]) == (200.0, pytest.approx(3000.0))
    period = bobbing_periods(passage, np.array([200.0, 3000.0]))
    assert period[0] < passage.tp < period[1]
    still = passage.scenario
    assert 2.0 * math.pi / still.rope_frequency == pytest.approx(period[0], rel=0.01)


def test_running_rms_of_a_constant_is_it() -> None:
    assert running(np.full(50, -0.3), 7) == pytest.approx(np.full(50, 0.3))


def test_bad_options_are_named() -> None:
    with pytest.raises(InvalidValue, match="depths"):
        Options(depths=(1000.0, 300.0))
    with pytest.raises(InvalidValue, match="policies"):
        Options(policies=("drum still", "nobody"))
    with pytest.raises(InvalidValue, match="bottom"):
        Options(top=500.0, bottom=400.0)


class Killed(BaseException):
    """What a process that is killed never sees."""


def test_a_killed_study_goes_on_and_writes_everything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["train.deep_water", *SMALL])
    main = importlib.import_module("train.deep_water.__main__").main
    write, written = JobStore.write, []

    def kept(store: JobStore[object], key: str, result: object) -> None:
        write(store, key, result)
        written.append(key)
        if len(written) == 3:
            raise Killed

    monkeypatch.setattr(JobStore, "write", kept)
    with pytest.raises(Killed):
        main()
    assert main() == 0
    assert len(written) == len(set(written))
    out = tmp_path / "out"
    assert {path.name for path in out.iterdir()} == {
        *("README.md", "config.toml", "run.json", "zero_shot.csv", "drive_map.csv", "between_nodes.csv"),
        *("lowering.csv", "zero_shot.png", "drive_map.png", "lowering.png"),
    }
    assert len((out / "drive_map.csv").read_text().splitlines()) == 1 + 16
    assert "feed-forward + feedback" in (out / "README.md").read_text()
