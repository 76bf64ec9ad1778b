"""Verdicts of the benchmarks from made-up samples: no timing."""

import json
import math
import statistics

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.bars import BARS, Limit, Linear, Ratio, number, spread, verdicts
from benchmarks.catalogue import COST_ROWS, MEASURES, matching
from benchmarks.report import markdown, write_report
from benchmarks.results import Machine, Run, Series

MACHINE = Machine("a processor", 2, True, "a system", "a compiler")
speeds = st.lists(st.floats(1e-3, 1e9), min_size=1, max_size=9)


def run_of(series):
    return Run("python -m benchmarks", 3, MACHINE, {"python": "3"}, series)


def full_run(value=2.0):
    return run_of({key: Series([value] * 3) for key in MEASURES})


RATIO = Ratio("scalar", "env/scalar@1", ("gymnasium/pendulum@1", "gymnasium/cartpole@1"), 1.5, "peers")


def ratio_run(mine, *peers):
    return run_of({"env/scalar@1": mine, "gymnasium/pendulum@1": peers[0], "gymnasium/cartpole@1": peers[-1]})


def test_a_ratio_is_taken_round_by_round_against_the_best_peer():
    run = ratio_run(Series([10.0, 40.0, 90.0]), Series([1.0, 1.0, 1.0]), Series([5.0, 20.0, 90.0]))
    verdict = RATIO.verdict(run)
    assert "CartPole" in verdict.peer
    assert verdict.ratio == "2.00 [1.00, 2.00]"
    assert verdict.word == "yes, not in every round"


@settings(deadline=None)
@given(mine=speeds, peer=speeds)
def test_a_bar_is_met_from_its_factor_on(mine, peer):
    rounds = min(len(mine), len(peer))
    median = statistics.median(a / b for a, b in zip(mine[:rounds], peer[:rounds], strict=True))
    verdict = RATIO.verdict(ratio_run(Series(mine), Series(peer)))
    assert verdict.met is (median >= 1.5)


def test_what_was_not_measured_meets_nothing_and_says_why():
    peers = ratio_run(Series([1.0]), Series(error="envpool could not be installed"))
    assert RATIO.verdict(peers).met is None
    assert RATIO.verdict(peers).peer == "envpool could not be installed"
    mine = ratio_run(Series([1.0], error="broke in round 2"), Series([1.0]))
    assert RATIO.verdict(mine).met is None
    assert RATIO.verdict(mine).measured == "broke in round 2"


@pytest.mark.parametrize(("value", "met"), [(0.4, True), (0.5, True), (0.6, False)])
def test_limits_hold_for_the_median(value, met):
    run = run_of({"startup/import@1": Series([0.0, value, 9.0])})
    verdict = Limit("import", "startup/import@1", 0.5).verdict(run)
    assert (verdict.met, verdict.split) == (met, True)
    assert Limit("import", "startup/import@1", value, at_least=True).verdict(run).met


@pytest.mark.parametrize(("power", "met"), [(1.0, True), (1.03, True), (1.1, False), (0.9, False)])
def test_linear_cost_is_the_exponent_of_the_seconds(power, met):
    run = run_of({f"cost/env-{n}@2": Series([n / n**power]) for n in COST_ROWS})
    verdict = Linear("cost", "cost/env", 1024, 0.05).verdict(run)
    assert verdict.measured == f"p = {power:.3f}"
    assert verdict.met is met


@settings(deadline=None)
@given(st.floats(1e-3, 1e11) | st.floats(-1e11, -1e-3))
def test_numbers_keep_three_digits(value):
    assert math.isclose(float(number(value).replace(",", "")), value, rel_tol=5.01e-3)


def test_spread_has_median_least_and_greatest():
    assert spread([3.0, 1.0, 2.0]) == "2.00 [1.00, 3.00]"
    assert spread([1234567.0]) == "1,230,000"


def test_every_bar_rests_on_something_that_is_measured():
    assert len(verdicts(full_run())) == len(BARS)
    assert all(verdict.met is not None for verdict in verdicts(full_run()))
    assert verdicts(run_of({})) == []


def test_only_words_of_the_name_are_measured():
    assert {m.group for m in matching(("envpool", "limit/"))} == {"envpool", "limit"}
    assert not any(m.slow for m in matching((), quick=True))
    assert len(matching(())) == len(MEASURES)


def test_a_run_comes_back_from_its_file(tmp_path):
    run = full_run()
    run.series["env/scalar@1"] = Series(error="no")
    run.save(tmp_path / "run.json")
    assert Run.load(tmp_path / "run.json") == run


def test_the_report_names_what_failed(tmp_path):
    run = full_run()
    run.series["gymnax/pendulum-4096@1"] = Series(error="gymnax==1 could not be installed: no")
    rows = write_report(tmp_path, run)
    assert len(json.loads((tmp_path / "benchmarks.json").read_text())["bars"]) == len(rows)
    assert "gymnax==1 could not be installed: no" in (tmp_path / "benchmarks.md").read_text()
    assert (tmp_path / "benchmarks.png").stat().st_size > 10_000
    assert markdown(run_of({}), []).startswith("# Benchmarks")
