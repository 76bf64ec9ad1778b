"""What README and docs show is what the committed results say."""

import re
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

import agents
from aframe_env import ScenarioDistribution
from agents.drives import map as drive_map
from agents.drives.realtime_map import RealTimeMapPolicy
from agents.policy import DrumStill
from agents.rollout import held_out_scenarios, run

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PAGES = [
    README,
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs/tutorials").glob("*.md")),
]


def text_of(path):
    return path.read_text(encoding="utf-8")


def tables(text):
    """Every Markdown table: the lines of each."""
    return [match.splitlines() for match in re.findall(r"(?:^\|.*\n)+", text, flags=re.MULTILINE)]


def table(path, heading):
    """The one table of a page whose first line begins with this."""
    (found,) = [lines for lines in tables(text_of(path)) if lines[0].startswith(heading)]
    return found


def cells(line):
    return [cell.strip() for cell in line.strip("|").split("|")]


def slugs(path):
    """What the headings of a page are linked by."""
    headings = re.findall(r"^#+ (.*)$", text_of(path), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize(
    ("page", "name"),
    [
        ("docs/results.md", "results/drives-paper/notes.md"),
        ("docs/results.md", "results/drive-map/notes.md"),
        ("docs/verification.md", "results/verification/README.md"),
    ],
)
def test_tables_are_those_of_the_results(page, name):
    assert tables(text_of(ROOT / name))[0] in tables(text_of(ROOT / page))


def test_the_comparison_s_rows_are_those_of_the_results():
    """The page shows some of them: not every seed."""
    shown = table(ROOT / "docs/results.md", "| policy | knows | scenarios |")
    assert len(shown) > 10
    whole = text_of(ROOT / "results/comparison/comparison.md").splitlines()
    assert [line for line in shown if line not in whole] == []


def test_the_readme_s_figures_are_those_of_the_episodes():
    lines = table(README, "| policy | knows | median | mean | mean of the worst 5 % |")[2:]
    episodes = parquet.read_table(
        ROOT / "results/comparison/episodes.parquet", columns=["policy", "knows", "scenario", "rms"]
    )
    policy, scenario = np.array(episodes["policy"]), episodes["scenario"].to_numpy()
    rms, knows = episodes["rms"].to_numpy(), np.array(episodes["knows"])
    still = rms[policy == "drum still"]
    assert (scenario[policy == "drum still"] == np.arange(1000)).all()
    assert 5 <= len(lines) <= 6
    for line in lines:
        name, known, *figures = cells(line)
        base, _, seeds = name.partition(", ")
        members = [f"{base}, seed {k}" for k in range(int(seeds.split()[0]))] if seeds else [name]
        figures_of = []
        for member in members:
            own = policy == member
            assert set(knows[own]) == {known}
            reduction = np.sort(1.0 - rms[own] / still[scenario[own]])
            assert len(reduction) == 1000
            figures_of.append((np.median(reduction), reduction.mean(), reduction[:50].mean()))
        expected = np.mean(figures_of, axis=0)
        assert figures == [f"{100.0 * value:.1f} %" for value in expected]


def test_the_readme_is_short():
    assert len(text_of(README).split()) <= 700


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)]+)\)", re.sub(r"```.*?```", "", text_of(page), flags=re.DOTALL)):
        if not target.startswith("http"):
            name, _, anchor = target.partition("#")
            path = page.parent / name if name else page
            assert path.exists(), target
            assert not anchor or anchor in slugs(path), target


def test_every_page_is_in_the_index():
    index = text_of(ROOT / "docs/README.md")
    pages = {page.relative_to(ROOT / "docs").as_posix() for page in PAGES if page.is_relative_to(ROOT / "docs")}
    assert pages - set(re.findall(r"\]\((.*?)\)", index)) == {"README.md"}


@pytest.mark.parametrize(
    ("agent", "observation", "base"),
    [("ppo", "state", "output zero"), ("ppo-sensors", "sensors", "output zero on sensors")],
)
def test_the_feed_forward_alone_removes_what_the_readme_says(agent, observation, base, monkeypatch):
    """The README's figures are those of 1,000 scenarios; here run the first hundred of them, with an agent silenced."""
    on_state, on_sensors = re.findall(r"([\d.]+) % (?:in the median )?on (?:the full state|sensors)", text_of(README))
    said = {"state": on_state, "sensors": on_sensors}[observation]
    committed = reductions_of(base)
    assert f"{np.median(committed):.1f}" == said
    scenarios = held_out_scenarios(ScenarioDistribution(), 100)
    policy = agents.load(ROOT / "results/agents" / agent)
    monkeypatch.setattr(policy, "_output", lambda inputs: np.zeros(len(inputs)))
    left = run(policy, scenarios, observation=observation).rms / run(DrumStill(), scenarios).rms
    assert 100.0 * (1.0 - np.median(left)) == pytest.approx(np.median(committed[:100]), abs=0.02)


def reductions_of(policy):
    """Heave reduction of a policy in each of the committed comparison's scenarios, %."""
    episodes = parquet.read_table(ROOT / "results/comparison/episodes.parquet", columns=["policy", "scenario", "rms"])
    names, scenario, rms = (episodes[name].to_numpy() for name in ("policy", "scenario", "rms"))
    own, still = (
        dict(zip(scenario[names == name], rms[names == name], strict=True)) for name in (policy, "drum still")
    )
    return np.array([100.0 * (1.0 - own[i] / still[i]) for i in sorted(own)])


def test_the_map_in_real_time_removes_what_the_page_says():
    scenarios = held_out_scenarios(ScenarioDistribution(), 200)
    still = run(DrumStill(), scenarios).rms
    stored = drive_map.load(ROOT / "results/drive-map")
    sensed, on_state = RealTimeMapPolicy(stored), RealTimeMapPolicy(stored, None)
    said = {}
    for line in table(ROOT / "docs/results.md", "| policy | knows | median | mean | mean of the worst 5 % |")[2:]:
        name, knows, *figures = cells(line)
        said[name, knows] = [float(figure.removesuffix(" %")) for figure in figures]
    assert list(said) == [(policy.name, policy.knows.value) for policy in (sensed, on_state)]
    for policy, observation in ((sensed, "sensors"), (on_state, "state")):
        reduction = 100.0 * np.sort(1.0 - run(policy, scenarios, observation=observation).rms / still)
        found = [np.median(reduction), reduction.mean(), reduction[:10].mean()]
        assert found == pytest.approx(said[policy.name, policy.knows.value], abs=0.1)


def test_storm_is_as_well_done_as_its_page_says():
    (said,) = [cells(line) for line in table(ROOT / "docs/tasks.md", "| task |") if "AFrameHeave-Storm-v0" in line]
    shown = " ".join(text_of(README).split())
    law, agent = (re.findall(r"\d+\.\d %", cell) for cell in said[3:])
    assert "the best law has {} of the ceiling, {} in the worst 5 %".format(*law) in shown
    assert "the recurrent agent {} and {}.".format(*agent) in shown
