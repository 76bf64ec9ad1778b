"""The engineers' guide shows figures of the comparison, and no others."""

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def text_of(page: str) -> str:
    return (DOCS / page).read_text(encoding="utf-8").replace("−", "-")


def row_of(policy: str) -> list[str]:
    """Cells of a policy's row in the comparison, without their intervals."""
    comparison = text_of("results.md").partition("| policy | knows | scenarios |")[2].partition("\n\n")[0]
    (line,) = re.findall(rf"^\| {re.escape(policy)} \|.*$", comparison, flags=re.MULTILINE)
    return [re.sub(r" \[.*", "", cell.strip()).replace("%", " %") for cell in line.strip("|").split("|")]


def test_the_figures_that_are_explained_are_those_of_predictive_control() -> None:
    row, still = row_of("predictive control"), row_of("drum still")
    table = text_of("engineers.md").partition("| figure | here | what it is for |")[2].partition("\n\n")[0]
    here = [line.split("|")[2].strip() for line in table.strip().splitlines()[1:]]
    _, _, _, median, mean, worst, share, _, saturating, rms, omega2, worse = row
    assert here == [median, mean, worst, share, saturating, f"{rms} m", f"{omega2} m", worse]
    assert f"with the drum still {still[9]} m" in table
    assert f"it is {row_of('winch-limited optimum')[5]}" in text_of("engineers.md")


def test_what_the_laws_reach_is_in_the_comparison() -> None:
    names = {"drive-map": "drive map in real time", "S-Ω1": "S-Ω1"}
    table = text_of("engineers.md").partition("| law | signals |")[2].partition("\n\n")[0]
    lines = table.strip().splitlines()[2:]
    assert len(lines) == 5
    for line in lines:
        policy = re.findall(r"\[`([^`]+)`\]", line)[0]
        row = row_of(names.get(policy, policy))
        assert line.rstrip(" |").rpartition("| ")[2].startswith(f"{row[3]}, {row[5]}")


def test_other_figures_are_on_the_page_of_results() -> None:
    text = re.sub(r"`[^`]*`|\]\([^)]*\)", "", text_of("engineers.md"))
    known = {figure.replace(" ", "") for figure in re.findall(r"-?[\d.]+ ?%", text_of("results.md"))}
    said = {figure.replace(" ", "") for figure in re.findall(r"-?\d+\.\d+ %", text)}
    assert len(said) > 10
    assert said <= known
