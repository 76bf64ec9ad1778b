"""What the README shows is what the committed results say."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def first_table(path):
    """Lines of the first Markdown table of a file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith("|"))
    end = next((i for i in range(begin, len(lines)) if not lines[i].startswith("|")), len(lines))
    return lines[begin:end]


@pytest.mark.parametrize(
    "name",
    [
        "results/drives-paper/notes.md",
        "results/drive-map/notes.md",
        "results/verification/README.md",
    ],
)
def test_tables_are_those_of_the_results(name):
    for line in first_table(ROOT / name):
        assert line in README


def test_the_comparison_s_rows_are_those_of_the_results():
    """The README shows some of them: not every seed."""
    shown = first_table(ROOT / "README.md")
    assert len(shown) > 10
    assert shown[0].startswith("| policy | knows |")
    whole = (ROOT / "results/comparison/comparison.md").read_text(encoding="utf-8").splitlines()
    for line in shown:
        assert line in whole


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if not target.startswith("http"):
            assert (ROOT / target).exists(), target
