"""What a reader copies works: code blocks run, and commands are what their own parsers take.

Python runs in small settings (``SMALL``), a command's arguments go through its parser and their own checks, and its
policies are looked up; then it is stopped. Nothing is skipped: a block in another language has its test elsewhere.
"""

from __future__ import annotations

import argparse
import functools
import importlib
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tyro
from packaging.requirements import Requirement
from rich.console import Console
from stable_baselines3 import PPO
from sybil import Document, Example, Sybil
from sybil.parsers.markdown import CodeBlockParser, PythonCodeBlockParser

from aframe_env import ScenarioDistribution, TaskConfig, cli
from agents.policy import DrumStill
from agents.registry import choose_all
from agents.rollout import held_out_scenarios, run
from train import dataset
from train.learn.sb3_env import TrainingVecEnv

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted((ROOT / "docs/tutorials").glob("*.md"))
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
SMALL = {
    "gpu.md": {'65_536, device="cuda"': '64, device="cpu"', "torch.zeros(65_536": "torch.zeros(64"},
    "results.md": {"held_out_scenarios(ScenarioDistribution(), 200)": "held_out_scenarios(ScenarioDistribution(), 2)"},
    "learners.md": {"num_envs=64": "num_envs=2"},
}
"""What a page's code says, and what is run for it."""
ELSEWHERE = {
    ("scenario-files.md", "toml"): "tests/scenario/test_scenario_docs.py",
    ("scenario-files.md", "csv"): "tests/scenario/test_scenario_docs.py",
    ("cluster.md", "bash"): "test_scripts_for_clusters_are_taken",
    ("cluster.md", "yaml"): "test_scripts_for_clusters_are_taken",
    ("architecture.md", "text"): "the layers, which lint-imports holds",
}
"""Blocks of other languages than Python and the shell, and what tests them."""
OF_RECIPES = {"aframe a2c", 'python -m train.evaluate --policies "proportional (state)"'}
"""Commands in the text that are there once a recipe of extend.md has been followed."""
MY_MODULE = """
def my_function(observation):
    return observation[:, 0]

my_law = policy = my_function
"""


class Stopped(Exception):
    """A command has parsed its arguments."""


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A reader's working folder: the files that the pages tell him to have, made as they say."""
    page = (ROOT / "docs/scenario-files.md").read_text("utf-8").partition("### My crane in my seas")[2]
    (tmp_path / "mine.toml").write_text(re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL)[0], "utf-8")
    for module in ("my_module", "my_agent"):
        (tmp_path / f"{module}.py").write_text(MY_MODULE, "utf-8")
    (tmp_path / "my_law.py").write_text("from agents.policy import DrumStill as Ahead\n", "utf-8")
    shutil.copytree(ROOT / "results/agents/ppo-sensors/seed-0", tmp_path / "runs/mine")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Any]:
    """Parse a command line by the command's own parser; return its options."""
    real, parse_plainly = tyro.cli, argparse.ArgumentParser.parse_args

    def stop(kind: Any, *args: Any, **keywords: Any) -> Any:
        if not isinstance(kind, type):  # tyro calls a function: parse for it, and leave it
            kind = functools.wraps(kind)(lambda **options: options)
        raise Stopped(real(kind, *args, **keywords))

    def stop_plain(parser: argparse.ArgumentParser) -> None:
        raise Stopped(parse_plainly(parser))

    def parse(line: str) -> Any:
        words = shlex.split(line)
        while "=" in words[0]:
            del words[0]
        program, *arguments = words
        if program == "aframe":
            call: Callable[[], object] = cli.main
        elif arguments[0] == "-m":
            module, arguments = arguments[1], arguments[2:]
            package = (ROOT / module.replace(".", "/")).is_dir()
            call = importlib.import_module(f"{module}.__main__" if package else module).main
        else:
            script, arguments = str(ROOT / arguments[0]), arguments[1:]
            call = functools.partial(runpy.run_path, script, run_name="__main__")
        with monkeypatch.context() as patch:
            patch.setattr(tyro, "cli", stop)
            patch.setattr(argparse.ArgumentParser, "parse_args", stop_plain)
            patch.setattr(sys, "argv", [program, *arguments])
            with pytest.raises(Stopped) as stopped:
                call()
        options = stopped.value.args[0]
        if {"evaluate", "train.evaluate"} & set(words[1:3]):
            choose_all(options.policies)
        return options

    return parse


def blocks(page: Path) -> list[str]:
    """Languages of the fenced blocks of a page."""
    return re.findall(r"^ *```(.*)\n(?:.*\n)*?^ *```$", page.read_text("utf-8"), flags=re.MULTILINE)


def commands(block: str) -> list[str]:
    """Command lines of a shell block."""
    joined = block.replace("\\\n", " ")
    return [line for line in (each.partition("  #")[0].strip() for each in joined.splitlines()) if line]


def test_every_block_has_a_test() -> None:
    for page in PAGES:
        languages = set(blocks(page)) - {"python", "sh"}
        assert languages == {language for name, language in ELSEWHERE if name == page.name}, page
        prose = re.sub(r"^( *)```.*?^\1```$", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
        assert not re.search(r"\n\n {4}\S", prose), f"{page}: an indented code block has no language"


@pytest.mark.parametrize("page", [page for page in PAGES if "python" in blocks(page)], ids=lambda page: page.stem)
def test_python_runs(page: Path, desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if page.name == "gpu.md":
        pytest.importorskip("rsl_rl", reason="needs the extra cuda")
    if page.name == "learners.md":
        PPO("MlpPolicy", TrainingVecEnv(2, TaskConfig(observation="sensors")), device="cpu").save("my_ppo.zip")
    if page.name == "data.md":
        pytest.importorskip("minari", reason="needs the extra data")
        monkeypatch.setenv("MINARI_DATASETS_PATH", str(desk))
        one = dataset.Options(kinds=("noisy",), observations=("state",), episodes=1)
        assert dataset.run(one, Console(quiet=True)) == 0
    source = page.read_text("utf-8")
    for said, small in SMALL.get(page.name, {}).items():
        assert said in source
        source = source.replace(said, small)
    (desk / page.name).write_text(source, "utf-8")
    document = Sybil([PythonCodeBlockParser()]).parse(desk / page.name)
    count = evaluate(document)
    assert count == blocks(page).count("python")
    if page.name == "extend.md":
        seas = held_out_scenarios(ScenarioDistribution(), 4)
        left = run(document.namespace["Proportional"](), seas).rms / run(DrumStill(), seas).rms
        assert np.median(left) < 0.1


@pytest.mark.parametrize("page", [page for page in PAGES if "sh" in blocks(page)], ids=lambda page: page.stem)
def test_commands_are_taken(page: Path, desk: Path, parsed: Callable[[str], Any]) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    made: set[Path] = set()

    def check(example: Example) -> None:
        for line in commands(example.parsed):
            program, *words = shlex.split(line)
            if program == "make":
                subprocess.run(["make", "-n", *words], cwd=ROOT, check=True, capture_output=True)
            elif program == "pip":
                assert words[0] == "install"
                assert all(Requirement(word).extras <= set(extras) for word in words[1:])
            elif program == "xdg-open":
                assert Path(words[0]).parent in made
            elif "rl_zoo3.train" in words:
                assert (ROOT / words[words.index("-c") + 1]).is_file()  # `make compat` has the library, and runs it
            else:
                made.add(getattr(parsed(line), "out", None))

    assert evaluate(Sybil([CodeBlockParser("sh", check)]).parse(page)) == blocks(page).count("sh")


def test_a_script_with_worker_processes_runs_as_a_file(tmp_path: Path) -> None:
    """Sybil calls no block ``__main__``, and workers import the script: it has to be run as a reader runs it."""
    page = (ROOT / "docs/use.md").read_text("utf-8")
    (script,) = (each for each in re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL) if "__main__" in each)
    (tmp_path / "compare.py").write_text(script, "utf-8")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "default"}
    command = [sys.executable, "compare.py"]
    ran = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    rows = re.findall(r"^(\S.*?) +(-?\d+\.\d\d)%$", ran.stdout, flags=re.MULTILINE)
    assert [name for name, _ in rows] == ["drum still", "S-Ω1 for each scenario", "feed-forward + feedback (state)"]
    assert float(rows[1][1]) > 95


def test_commands_within_the_text_are_taken(desk: Path, parsed: Callable[[str], Any]) -> None:
    found = set()
    for page in [*PAGES, *TUTORIALS]:
        prose = re.sub(r"^( *)```.*?^\1```$", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
        for span in re.findall(r"`((?:aframe|python -m (?:train|benchmarks)[.\w]*)(?:\s[^`]*)?)`", prose):
            line = " ".join(span.split())
            if line != "aframe" and not re.search("…|--help|COMMAND", line):
                found.add(line)
    assert len(found) > 30
    assert found >= OF_RECIPES
    for line in sorted(found - OF_RECIPES):
        parsed(line)


def test_scripts_for_clusters_are_taken(desk: Path, parsed: Callable[[str], Any]) -> None:
    """The shell reads them, and our commands and Ray's take their arguments; there is no Slurm or Kubernetes here."""
    yaml = pytest.importorskip("yaml", reason="needs PyYAML")
    start = pytest.importorskip("ray.scripts.scripts", reason="needs the extra cluster").start
    found = re.findall(r"```(bash|yaml)\n(.*?)```", (ROOT / "docs/cluster.md").read_text("utf-8"), flags=re.DOTALL)
    assert [language for language, _ in found] == ["bash", "bash", "yaml"]
    for language, block in found:
        if language == "yaml":
            job = yaml.safe_load(block)["spec"]
            assert set(job["rayClusterSpec"]) == {"headGroupSpec", "workerGroupSpecs"}
            assert parsed(job["entrypoint"]).cluster == "auto"
            continue
        subprocess.run(["bash", "-n"], input=block, text=True, check=True)
        script = block.replace("\\\n", " ").replace("$SLURM_CPUS_PER_TASK", "64").replace("$address", "10.0.0.1:6379")
        ours = [parsed(line) for line in re.findall(r"^python .*", script, flags=re.MULTILINE)]
        assert [options.cluster is not None for options in ours] == [True]
        rays = re.findall(r"ray start (.*?)(?: &)?$", script, flags=re.MULTILINE)
        assert [start.make_context("start", shlex.split(line)).params["head"] for line in rays] == [True, False]


def evaluate(document: Document) -> int:
    """Evaluate all examples of a document; return how many there were."""
    examples = list(document.examples())
    for example in examples:
        example.evaluate()
    return len(examples)
