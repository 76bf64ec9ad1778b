"""The documentation site: built with warnings as errors, and read in a real browser from the disk."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from agents import registry, shipped

ROOT = Path(__file__).parents[2]
SIZES = {"wide": {"width": 1400, "height": 900}, "narrow": {"width": 390, "height": 844}}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for package in ("material", "mkdocstrings"):
        pytest.importorskip(package, reason="needs the extra docs")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    made = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert (made.returncode, made.stderr) == (0, "")
    return folder


def pages(site: Path) -> list[Path]:
    return sorted(page for page in site.rglob("*.html") if page.name != "404.html")


def body(site: Path, page: str) -> str:
    return (site / page).read_text(encoding="utf-8").partition("<article")[2].partition("</article>")[0]


def test_the_home_page_is_the_readme(site: Path) -> None:
    home = body(site, "index.html")
    assert 'src="results/environment.png"' in home
    assert (site / "results/environment.png").read_bytes() == (ROOT / "results/environment.png").read_bytes()
    for line in re.findall(r"^## (.*)$", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.MULTILINE):
        assert f">{line}<a" in home


def test_every_page_of_the_docs_is_on_the_site(site: Path) -> None:
    sources = {path.relative_to(ROOT / "docs").with_suffix(".html") for path in (ROOT / "docs").rglob("*.md")}
    others = {Path(name) for name in ("index.html", "paper.html", "changelog.html", "contributing.html")}
    assert {page.relative_to(site) for page in pages(site)} == sources - {Path("README.html")} | others


def test_what_a_page_links_of_the_repository_exists_there(site: Path) -> None:
    """Links within the site are checked by its build."""
    repository = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["urls"]["Repository"]
    link, found = re.compile(rf'href="{re.escape(repository)}/(blob|tree)/main/([^"#]+)'), set()
    for page in pages(site):
        for kind, path in link.findall(page.read_text(encoding="utf-8")):
            assert (ROOT / path).is_dir() == (kind == "tree"), path
            assert (ROOT / path).exists(), path
            found.add(path)
    assert {"aframe_env/dynamics", "results/comparison/episodes.parquet"} < found


def test_a_list_right_below_its_introduction_is_a_list(site: Path) -> None:
    assert body(site, "architecture.html").count("<ol>") == 3
    assert not re.search(r"<p>[^<]*\n(?:- |\d\. )", body(site, "results.html") + body(site, "learners.html"))


def test_equations_lead_to_functions_and_interfaces_to_their_reference(site: Path) -> None:
    assert "main/aframe_env/dynamics/load.py" in body(site, "physics.html")
    environment = body(site, "api/aframe_env.html")
    for name in ("TaskConfig", "Scenario", "Sensors", "read_scenario"):
        assert f'id="aframe_env.{name}"' in environment
    assert "vertical acceleration of the pulley" in environment
    assert 'id="agents.AgentInterface.feature_names"' in body(site, "api/agents.html")


class Reader:
    """A page of a browser without a network; ``wrong`` has what it complained of or asked elsewhere for."""

    def __init__(self, chromium: Any, size: str) -> None:
        self.context = chromium.new_context(offline=True, viewport=SIZES[size], color_scheme="light")
        self.page = self.context.new_page()
        self.wrong: list[str] = []
        self.page.on(
            "console", lambda message: message.type in ("error", "warning") and self.wrong.append(message.text)
        )
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda asked: asked.url.startswith(("file:", "data:")) or self.wrong.append(asked.url))


@pytest.fixture(params=SIZES)
def reader(chromium: Any, request: pytest.FixtureRequest) -> Iterator[Reader]:
    opened = Reader(chromium, request.param)
    yield opened
    opened.context.close()


def test_every_page_opens_without_an_error_or_the_network(site: Path, reader: Reader) -> None:
    for page in pages(site):
        reader.page.goto(page.as_uri())
        reader.page.wait_for_function("[...document.images].every(image => image.complete && image.naturalWidth > 0)")
        assert reader.page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0, page
        assert reader.wrong == [], page


def test_the_search_finds_a_page_and_leads_to_it(site: Path, reader: Reader) -> None:
    page = reader.page
    page.goto((site / "index.html").as_uri())
    page.locator("header label.md-header__button[for=__search], input.md-search__input").locator(
        "visible=true"
    ).first.click()
    page.keyboard.type("Kalman")
    first = page.locator(".md-search-result__link").first
    first.wait_for()
    assert "Kalman" in first.inner_text()
    first.click()
    page.wait_for_url(re.compile("(?!.*index).*html"))
    assert "Kalman" in page.locator("article").inner_text()
    assert reader.wrong == []


def test_policies_have_the_names_that_the_registry_takes() -> None:
    names = re.findall(
        r"`([^`]+)`",
        "".join(re.findall(r"^\| (`.*?) \|", (ROOT / "docs/policies.md").read_text("utf-8"), flags=re.MULTILINE)),
    )
    listed = {registry.choose(name).name for name in names}
    assert {name for name in registry.REGISTRY if not name.endswith(("for each scenario", "Gauss-Newton"))} < listed
    assert {registry.choose(name).name for name in shipped.AGENTS} < listed


def test_light_and_dark(site: Path, reader: Reader) -> None:
    def ground() -> int:
        colour = reader.page.evaluate("getComputedStyle(document.body).backgroundColor")
        return sum(map(int, re.findall(r"\d+", colour)[:3]))

    reader.page.goto((site / "index.html").as_uri())
    seen = [ground()]
    for _ in range(2):
        reader.page.locator("label.md-header__button[for^=__palette]:visible").click()
        seen.append(ground())
    assert seen[0] > 600
    assert min(seen) < 200
    assert reader.wrong == []
