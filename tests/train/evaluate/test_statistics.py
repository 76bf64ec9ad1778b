import csv
import json

import numpy as np
import pytest

from agents.policy import Knowledge
from agents.rollout import Episodes
from train.evaluate.statistics import Entry, Interval, compare, compare_families, family, reductions, tail_mean
from train.evaluate.tables import CAPTION, markdown_table, write_comparison


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
        landings=np.zeros(count, dtype=np.int64),
        lift_offs=np.zeros(count, dtype=np.int64),
        landing_speed=np.zeros(count),
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
    assert Interval.of(values).value == np.median(values)
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
    assert rows[1].worst_reduction == rows[1].tail.value == pytest.approx(-0.5)
    assert rows[1].mean.value == pytest.approx(0.5 / 3.0)
    assert rows[1].share is None
    assert rows[1].reduction.value == pytest.approx(0.5)
    assert rows[1].rms.value == pytest.approx(np.sqrt(9.0 / 60.0))
    write_comparison(tmp_path, rows, rows, [worse])
    assert json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"))["policies"][1]["policy"] == "worse"
    assert (tmp_path / "comparison.md").read_text(encoding="utf-8") == f"{markdown_table(rows)}\n{CAPTION}"
    with (tmp_path / "comparison.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [float(row["omega1_m2s"]) for row in table] == [9.0, 4.0, 9.0]


def test_the_tail_is_the_mean_of_the_worst_twentieth():
    values = np.random.default_rng(2).permutation(np.arange(100.0))
    assert tail_mean(values) == np.mean([0, 1, 2, 3, 4])
    assert tail_mean(values[:7]) == values[:7].min()
    np.testing.assert_array_equal(tail_mean(np.stack([values, values + 1.0])), [2.0, 3.0])


def test_shares_are_of_what_the_optimum_removes():
    still, best = episodes([100.0, 100.0, 100.0]), episodes([0.0, 25.0, 1.0])
    half = Entry("half", Knowledge.SENSORS, episodes([25.0, 25.0, 25.0]))
    (row,) = compare([half], still, best.rms, np.array([False, True, True]))
    assert row.share.value == pytest.approx(np.mean([0.5, 1.0, 0.5 / 0.9]))
    assert row.share_saturating.value == pytest.approx(np.mean([1.0, 0.5 / 0.9]))
    assert row.share_tail.value == pytest.approx(0.5)
    assert row.share_median.value == pytest.approx(0.5 / 0.9)


def test_seeds_stand_in_one_row_whose_interval_has_both_spreads():
    rng = np.random.default_rng(3)
    still = episodes(np.full(400, 100.0))
    seeds = [0.2, 0.3, 0.4]
    entries = [
        Entry(f"agent, seed {k}", Knowledge.STATE, episodes(100.0 * (left + rng.normal(0.0, 0.01, 400)) ** 2))
        for k, left in enumerate(seeds)
    ]
    (row,) = compare_families(entries, still)
    assert (row.policy, row.seeds, row.scenarios) == ("agent, 3 seeds", 3, 400)
    assert row.mean.value == pytest.approx(0.7, abs=0.002)
    # Between scenarios there is a thousandth, between seeds a tenth: the interval is that of three seeds.
    assert 0.595 < row.mean.low < 0.65
    assert 0.75 < row.mean.high <= 0.81
    one = compare_families(entries[:1], still)[0]
    assert one.mean.high - one.mean.low < 0.003


@pytest.mark.parametrize("name", ["PPO", "PPO, seed 3", "PPO, 5 seeds"])
def test_a_family_is_the_name_without_seeds(name):
    assert family(name) == "PPO"
    assert family("feed-forward + feedback (state)") == "feed-forward + feedback (state)"
