import csv
import json

import numpy as np
import pytest

from agents.policy import Knowledge
from agents.rollout import Episodes
from train.evaluate.statistics import Entry, Interval, compare, reductions
from train.evaluate.tables import markdown_table, write_comparison


def episodes(omega1):
    count = len(omega1)
    return Episodes(
        omega1=np.array(omega1),
        omega2=np.full(count, 0.5),
        duration=60.0,
        slack_events=np.zeros(count, dtype=np.int64),
        peak_tension=np.full(count, 1e6),
        drum_travel=np.zeros(count),
        peak_power=np.zeros(count),
        time_outside=np.full(count, 30.0),
        parted=np.zeros(count, dtype=bool),
        error=np.zeros((count, 2), dtype=np.float32),
        drum_speed=np.zeros((count, 2), dtype=np.float32),
        tension=np.full((count, 2), 1e6, dtype=np.float32),
    )


def test_interval_covers_the_median_as_often_as_it_says():
    """Coverage over many samples of a known distribution: 95 % within sampling error."""
    rng = np.random.default_rng(0)
    hits = 0
    for _ in range(120):
        interval = Interval.of(rng.lognormal(size=60))
        hits += interval.low <= 1.0 <= interval.high
    assert 0.88 < hits / 120 <= 1.0


def test_interval_is_seeded_and_its_median_is_the_median():
    values = np.random.default_rng(1).normal(size=31)
    assert Interval.of(values) == Interval.of(values)
    assert Interval.of(values).median == np.median(values)
    assert Interval.of(np.array([2.0])) == Interval(2.0, 2.0, 2.0)


def test_reduction_is_of_the_root_mean_square_in_pairs():
    still = episodes([4.0, 16.0, 36.0])
    entry = Entry("p", Knowledge.STATE, episodes([0.04, 4.0]))
    assert reductions(entry, still) == pytest.approx([0.9, 0.5])


def test_rows_count_what_went_wrong(tmp_path):
    still = episodes([4.0, 16.0, 36.0])
    worse = Entry("worse", Knowledge.CLOCK, episodes([9.0, 4.0, 9.0]))
    rows = compare([Entry("drum still", Knowledge.NOTHING, still), worse], still)
    assert rows[1].worse_than_still == 1
    assert rows[1].worst_reduction == pytest.approx(-0.5)
    assert rows[1].reduction.median == pytest.approx(0.5)
    assert rows[1].rms.median == pytest.approx(np.sqrt(9.0 / 60.0))
    write_comparison(tmp_path, rows, [worse])
    assert json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"))[1]["policy"] == "worse"
    assert (tmp_path / "comparison.md").read_text(encoding="utf-8") == markdown_table(rows)
    with (tmp_path / "comparison.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [float(row["omega1_m2s"]) for row in table] == [9.0, 4.0, 9.0]
