"""The tutorials run, and print what their pages show."""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.site import tutorials

QUICK = "my_controller_against_theirs"


@pytest.mark.parametrize(
    "script",
    [
        pytest.param(script, id=script.stem, marks=() if script.stem == QUICK else pytest.mark.slow)
        for script in tutorials.SCRIPTS
    ],
)
def test_a_tutorial_does_what_its_page_shows(script: Path, tmp_path: Path) -> None:
    page = tutorials.page_of(script).read_text(encoding="utf-8")
    assert tutorials.differences(page, tutorials.run(script, tmp_path)) == []


@pytest.mark.parametrize("script", tutorials.SCRIPTS, ids=lambda script: script.stem)
def test_a_page_has_its_script_s_text_and_code(script: Path) -> None:
    page = tutorials.page_of(script).read_text(encoding="utf-8")
    assert "```text\n" in page
    assert tutorials.without_prints(page) == tutorials.unprinted(script)


def test_every_page_has_a_script() -> None:
    pages = set((tutorials.ROOT / "docs/tutorials").glob("*.md"))
    assert pages == {tutorials.page_of(script) for script in tutorials.SCRIPTS}
    assert len(pages) == 5


@pytest.mark.parametrize(
    ("page", "printed", "alike"),
    [
        ("ppo   97.1 %", "ppo   97.3 %", True),
        ("ppo   97.1 %", "ppo   97.4 %", False),
        ("ppo   99 %", "ppo  101 %", True),
        ("ppo   99 %", "sac   99 %", False),
        ("0.012 m", "0.01 m", False),
        ("12,000 steps", "12,003 steps", False),
        ("-0.1 m", "0.1 m", True),
    ],
)
def test_numbers_may_differ_by_two_of_their_last_digit(page: str, printed: str, alike: bool) -> None:
    assert (tutorials.differences(page, printed) == []) == alike
