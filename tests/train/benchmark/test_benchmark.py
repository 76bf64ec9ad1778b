"""The tasks' benchmark: ceilings, scores, the leaderboard and its page."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from aframe_env import TASKS, InvalidValue, TaskConfig
from agents import shipped
from agents.control.inverse_dynamics import InverseDynamics
from agents.control.optimum import optimise
from agents.policy import DrumStill, Knowledge
from agents.registry import BuildContext, choose_all
from agents.rollout import run
from train.benchmark import ceiling, leaderboard
from train.benchmark.__main__ import digests, first_seeds, main
from train.benchmark.leaderboard import LeaderboardRow
from train.benchmark.measures import measures_of
from train.benchmark.page import page
from train.evaluate.statistics import Entry, Interval
from train.shared.jobs import Where

STORM, LANDING = TASKS["Storm"], TASKS["Landing"]
CONFIG = TaskConfig(**STORM.arguments)
ONE = Where(workers=1)
LAW = "import numpy as np\n\n\ndef my_law(observation, time):\n    return observation[:, 1] / 0.75\n"


@pytest.fixture
def nothing_shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shipped, "_ROOT", tmp_path / "nothing")


def test_a_ceiling_is_the_optimum_of_each_scenario_and_resumes(tmp_path, monkeypatch, nothing_shipped):
    monkeypatch.setattr(ceiling, "BLOCK", 2)
    found = ceiling.ceiling_of(STORM, "test", 3, tmp_path / "jobs.sqlite", ONE)
    scenarios = STORM.scenarios("test", 3)
    np.testing.assert_array_equal(found.best, np.sqrt(optimise(scenarios, CONFIG).omega1 / 60.0))
    np.testing.assert_array_equal(found.still, run(DrumStill(), scenarios, CONFIG).rms)
    # No law that ships does better, whatever it knows.
    assert (np.array(found.best) < run(InverseDynamics(), scenarios, CONFIG, observation="state").rms).all()
    monkeypatch.setattr(ceiling, "_solve", None)  # what is in the store is not computed again
    assert ceiling.ceiling_of(STORM, "test", 3, tmp_path / "jobs.sqlite", ONE) == found


def test_a_stored_ceiling_is_taken_while_scenarios_and_physics_are_the_same(tmp_path, monkeypatch):
    still = run(DrumStill(), STORM.scenarios("test", 2), CONFIG).rms.tolist()
    stored = ceiling.Ceiling(
        task=STORM.id,
        split="test",
        seed=STORM.seeds.test,
        draws=STORM.digests["test"],
        method="as it may be",
        still=tuple(still),
        best=(0.1, 0.2),
        versions={},
    )
    monkeypatch.setattr(shipped, "_ROOT", tmp_path)
    stored.write(shipped.task_folder("Storm"))
    assert ceiling.ceiling_of(STORM, "test", 1, tmp_path / "no.sqlite", ONE) == stored.first(1)
    assert not (tmp_path / "no.sqlite").exists()
    for other in (
        replace(stored, draws="of other scenarios"),
        replace(stored, seed=1),
        replace(stored, still=(still[0] * 1.00001, still[1])),  # of other physics
    ):
        assert not other.holds_for(STORM, "test", 2)
    assert stored.holds_for(STORM, "test", 2)
    assert not stored.holds_for(STORM, "test", 3)
    assert not stored.holds_for(STORM, "validation", 2)
    path = shipped.task_folder("Storm") / "ceiling.json"
    path.write_text(path.read_text().replace("0.2", "0.3"))
    with pytest.raises(InvalidValue, match="damaged or altered"):
        ceiling.read(path)


def a_row(**changes):
    return LeaderboardRow(
        **{
            "task": STORM.id,
            "split": "test",
            "scenarios": 100,
            "draws": STORM.digests["test"],
            "policy": "mine",
            "knows": "sensors",
            "seeds": 3,
            "share": Interval(0.9, 0.8, 0.95),
            "share_median": Interval(0.9, 0.8, 0.95),
            "share_worst": Interval(-1.5, -2.0, 0.0),
            "reduction": Interval(0.7, 0.6, 0.8),
            "worse_than_still": 0.5,
            "parted": 0.0,
            "sha256": ("ab", "cd", "ef"),
            "command": "python -m train.benchmark",
            "versions": {"aframe-heave": "0.1.0"},
            **changes,
        }
    )


def test_a_leaderboard_reads_back_and_takes_a_policy_once(tmp_path):
    old = [a_row(), a_row(policy="better", share=Interval(0.95, 0.9, 0.97)), a_row(by="else", command="other")]
    board = leaderboard.merged(old, [a_row(share=Interval(0.96, 0.9, 0.97), sha256=("00",))])
    assert [(row.policy, row.by) for row in board] == [("mine", ""), ("better", ""), ("mine", "else")]
    leaderboard.write(tmp_path / "board.json", board)
    assert leaderboard.read(tmp_path / "board.json") == board
    assert leaderboard.read(tmp_path / "none.json") == []
    text = page(board)
    assert text.index("| mine, 3 seeds |") < text.index("| better, 3 seeds |") < text.index("| mine, 3 seeds (else) |")
    assert "-150.0% [-200.0%, 0.0%]" in text


def test_measures_are_of_all_seeds_together_and_stand_on_the_page(landing_runs):
    entries, episodes = landing_runs
    found = measures_of([*entries, replace(entries[0], policy="other")], LANDING.measures)
    assert list(found) == ["mine", "other"]
    speeds = np.concatenate([each.landing_speed for each in episodes])
    assert found["mine"]["landing_speed"] == pytest.approx(np.quantile(speeds, 0.99))
    assert found["mine"]["lift_offs"] == pytest.approx(np.mean([each.lift_offs.mean() for each in episodes]))
    assert found["other"]["lift_offs"] == pytest.approx(episodes[0].lift_offs.mean())
    row = a_row(task=LANDING.id, draws=LANDING.digests["test"], measures=found["mine"])
    table = page([row]).splitlines()
    heading, line = (next(each for each in table if each.startswith(start)) for start in ("| policy", "| mine"))
    assert heading.endswith("| 99 of 100 land within, m/s | lift-offs per lift |")
    assert line.endswith(f"| {found['mine']['landing_speed']:.3g} | {found['mine']['lift_offs']:.3g} |")
    assert heading.count("|") == line.count("|")


@pytest.fixture(scope="module")
def landing_runs():
    """A law and a drum that lowers the load without looking at the sea, as if they were two seeds."""
    config, scenarios = TaskConfig(**LANDING.arguments), LANDING.scenarios("train", 3)
    specs = choose_all(["feed-forward + feedback", "drum still"])
    policies = [spec.policy(BuildContext(scenarios=scenarios, config=config)) for spec in specs]
    episodes = [run(policy, scenarios, config) for policy in policies]
    assert (episodes[0].landings > 0).all()
    entries = [Entry(f"mine, seed {i}", Knowledge.SENSORS, each) for i, each in enumerate(episodes)]
    return entries, episodes


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"draws": "00"}, "row 0: draws = '00': must be "),
        ({"task": "AFrameHeave-Storm-v9"}, "row 0: task = 'AFrameHeave-Storm-v9': must be one of"),
        ({"knows": "all"}, "row 0: knows = 'all': must be one of 'nothing', 'clock'"),
        ({"share": {"value": 1.2, "low": 1.1, "high": 1.3}}, "row 0: share = .* must be at most 1"),
        ({"scenarios": 0}, "row 0: scenarios = 0"),
        ({"worse_than_still": 101}, r"row 0: worse_than_still = 101.0: must be in \[0, 100\] scenarios"),
        ({"parted": -1.0}, r"row 0: parted = -1.0: must be in \[0, 100\] scenarios"),
        ({"scenarios": "many"}, r"row 0: \[scenarios\] 'many': must be of type int"),
        ({"shares": 1.0}, "row 0: unknown key 'shares'"),
        ({"measures": {"lift_offs": 1.0}}, r"row 0: measures = {'lift_offs': 1.0}: must be none"),
        (
            {"task": LANDING.id, "draws": LANDING.digests["test"]},
            r"row 0: measures = {}: must be landing_speed, lift_offs",
        ),
        (
            {
                "task": LANDING.id,
                "draws": LANDING.digests["test"],
                "measures": {"landing_speed": -0.1, "lift_offs": 1.0},
            },
            "row 0: landing_speed = -0.1: must be 0 or more",
        ),
    ],
)
def test_a_row_that_cannot_be_is_refused(tmp_path, change, says):
    board = tmp_path / "board.json"
    board.write_text(json.dumps({"form": 1, "rows": [{**asdict(a_row()), **change}]}))
    with pytest.raises(InvalidValue, match=says):
        leaderboard.read(board)


def test_a_file_that_is_no_leaderboard_is_refused(tmp_path):
    (tmp_path / "board.json").write_text('{"rows": 3}')
    with pytest.raises(InvalidValue, match="must be a table with form = 1 and a list of rows"):
        leaderboard.read(tmp_path / "board.json")


def test_of_agents_that_differ_in_their_seed_the_first_are_taken():
    specs = choose_all(("ppo", "winch-limited optimum", "predictive control"))
    names = [spec.name for spec in first_seeds(specs, 2)]
    seeds = [f"residual PPO, seed {k}" for k in range(2)] if len(specs) > 3 else ["residual PPO"]
    assert names == [*seeds, "predictive control"]
    assert all(len(sha256) == 64 for sha256 in digests(specs)["residual PPO"])


def command(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["train.benchmark", *map(str, arguments)])
    return main()


def test_a_stranger_scores_his_law_and_adds_his_row(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("mine_for_storm.py").write_text(LAW)
    mine = ("--policies", "mine_for_storm:my_law", "--by", "me")
    few = ("--tasks", "storm", "--scenarios", 3, "--workers", 1)
    assert command(monkeypatch, *few, "--policies", "feed-forward + feedback", "--out", "board") == 0
    board = Path("board/leaderboard.json")
    assert command(monkeypatch, *few, *mine, "--leaderboard", board, "--out", "own") == 0
    assert len(leaderboard.read(board)) == 4  # what every run has is there once, and stays as it was
    rows = {row.policy: row for row in leaderboard.read(board)}
    assert set(rows) == {"winch-limited optimum", "feed-forward + feedback", "mine_for_storm:my_law", "drum still"}

    scenarios = STORM.scenarios("test", 3)
    law = choose_all(["feed-forward + feedback"])[0]
    policy = law.policy(BuildContext(scenarios=scenarios, config=CONFIG))
    left = run(policy, scenarios, CONFIG, noise_seed=STORM.seeds.test).rms
    still = run(DrumStill(), scenarios, CONFIG).rms
    best = np.sqrt(optimise(scenarios, CONFIG).omega1 / 60.0)
    shares = (1.0 - left / still) / (1.0 - best / still)
    row = rows["feed-forward + feedback"]
    assert row.share.value == pytest.approx(shares.mean(), rel=ceiling.SAME)
    assert row.share_median.value == pytest.approx(np.median(shares), rel=ceiling.SAME)
    assert row.share_worst.value == pytest.approx(shares.min(), rel=ceiling.SAME)
    assert (rows["drum still"].share.value, rows["winch-limited optimum"].share.value) == (0.0, 1.0)
    assert len(rows["mine_for_storm:my_law"].sha256[0]) == 64
    assert {policy: row.by for policy, row in rows.items() if row.by} == {"mine_for_storm:my_law": "me"}
    assert Path("board/leaderboard.png").stat().st_size > 10_000
    assert "mine_for_storm:my_law" in Path("board/README.md").read_text(encoding="utf-8")
    assert not Path("own/jobs.sqlite").exists()

    # Another law of the same name needs another name for who adds it.
    Path("mine_for_storm.py").write_text(LAW + "\n# better\n")
    with pytest.raises(SystemExit):
        command(monkeypatch, *few, *mine, "--leaderboard", board, "--out", "again")
    assert (
        "by = 'me': board/leaderboard.json has a row 'mine_for_storm:my_law' of other agents" in capsys.readouterr().err
    )
    assert not Path("again").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--tasks", "Calm"), "task = 'Calm': must be one of 'Storm', 'Unknown', 'DeepRope'"),
        (("--scenarios", 0), "scenarios = 0: must be in [1, 20000]"),
        (("--seeds", 0), "seeds = 0: must be in [1, 10000]"),
    ],
)
def test_bad_options_are_one_sentence(monkeypatch, capsys, arguments, says):
    with pytest.raises(SystemExit):
        command(monkeypatch, *arguments)
    assert says in " ".join(capsys.readouterr().err.split())


def test_the_page_of_the_tasks_says_what_the_leaderboard_does():
    root = Path(__file__).parents[3]
    rows = leaderboard.read(root / "results/tasks/leaderboard.json")
    lines = (root / "docs/tasks.md").read_text(encoding="utf-8").splitlines()
    for task in TASKS.values():
        ours = [row for row in rows if row.task == task.id and row.scenarios == 100]
        (best,) = [row for row in ours if row.policy == "winch-limited optimum"]
        # The drive map comes from files, too, but nothing in it was learned from episodes.
        sensed = [row for row in ours if row.knows == "sensors" and not row.policy.startswith("drive map")]
        law, learned = (
            max((row for row in sensed if bool(row.sha256) is trained), key=lambda row: row.share.value)
            for trained in (False, True)
        )
        (line,) = [line for line in lines if line.startswith(f"| [`{task.id}`]")]
        said = [cell.strip() for cell in line.strip("|").split("|")]
        assert said[1] == task.isolates
        assert said[2] == f"{best.reduction.value:.1%}".replace("%", " %")
        for cell, row in ((said[3], law), (said[4], learned)):
            figures = f"{row.share.value:.1%}, {row.share_worst.value:.1%}".replace("%", " %")
            assert cell == f"{row.policy.removesuffix(' on sensors')}, {figures}"
