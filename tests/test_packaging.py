"""What somebody gets who installs the package: wheel, sdist, the command ``aframe``, a word on foreign packages."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest

import aframe_env
import agents
import train
from aframe_env.cli import COMMANDS
from agents import shipped

ROOT = Path(__file__).parents[1]
AFRAME = ("-c", "import sys; from aframe_env.cli import main; sys.exit(main())")
"""What the console script does."""


def python(*arguments: str, path: Path = ROOT, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder; ``path`` is where it finds the package, behind that folder."""
    environment = {**os.environ, "PYTHONPATH": str(path), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, *arguments], cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Folders of an unpacked wheel, and of the unpacked sdist that it was made from."""
    pytest.importorskip("build")
    folder = tmp_path_factory.mktemp("packaging")
    leave_out = shutil.ignore_patterns(
        ".*cache", ".git", ".hypothesis", ".venv*", "__pycache__", "build", "dist", "runs"
    )
    shutil.copytree(ROOT, folder / "source", ignore=leave_out)
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", folder / "dist", folder / "source"]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stdout + made.stderr
    (wheel,) = (folder / "dist").glob("*.whl")
    (sdist,) = (folder / "dist").glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder / "sdist", filter="data")
    (top,) = (folder / "sdist").iterdir()
    return folder / "site", top


def test_a_wheel_has_one_seed_of_each_agent_and_the_map_by_name(built: tuple[Path, Path], tmp_path: Path) -> None:
    site, _ = built
    code = """
import agents, agents.drives.map, agents.registry
print(agents.__file__)
for name in agents.shipped.AGENTS:
    print(name, agents.load(name).card.sha256, [spec.name for spec in agents.registry.choose_all([name])])
for name in agents.shipped.RECURRENT:
    print(name, [spec.name for spec in agents.registry.choose_all([name])])
print(agents.drives.map.load().shape, agents.registry.choose("drive-map:clock").name)
"""
    said = python("-c", code, path=site, cwd=tmp_path)
    assert said.returncode == 0, said.stderr
    where, *loaded, drive_map = said.stdout.splitlines()
    assert Path(where).is_relative_to(site)
    expected = []
    folders = sorted((ROOT / "results" / "agents").iterdir())
    recurrent = [folder for folder in folders if (folder / "seed-0" / "recurrent.json").exists()]
    for folder in (folder for folder in folders if folder not in recurrent):
        agent = agents.load(folder / "seed-0")
        expected.append(f"{folder.name} {agent.card.sha256} ['{agent.name}']")
    assert len(expected) == 12
    names = {"apg-state-storm": "recurrent APG"}
    expected += [f"{folder.name} ['{names.get(folder.name, 'recurrent APG on sensors')}']" for folder in recurrent]
    assert [folder.name for folder in recurrent] == [
        "apg-deeprope",
        "apg-mru",
        "apg-preview",
        "apg-state-storm",
        "apg-storm",
        "apg-unknown",
    ]
    assert loaded == expected
    assert drive_map == "(5, 8, 5, 8) drive map by the clock"
    assert not list(tmp_path.iterdir())


def test_a_wheel_s_page_has_links_that_work_anywhere(built: tuple[Path, Path]) -> None:
    site, _ = built
    (info,) = site.glob("*.dist-info")
    metadata = message_from_bytes((info / "METADATA").read_bytes())
    assert metadata["Version"] == aframe_env.__version__ == agents.__version__ == train.__version__
    text = str(metadata.get_payload(decode=True), "utf-8")
    ours = re.findall(r"\]\(([^)]+)\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    links = re.findall(r"\]\(([^)]+)\)", text)
    repository = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["urls"]["Repository"]
    assert len(ours) > 15
    assert links == [
        link
        if link.startswith("https://")
        else f"{repository}/{'raw' if link.endswith(('.png', '.gif')) else 'blob'}/main/{link}"
        for link in ours
    ]


def test_an_sdist_has_docs_tests_and_examples(built: tuple[Path, Path]) -> None:
    _, sdist = built
    for name in ("docs/use.md", "tests/test_packaging.py", "tests/data", "examples", "benchmarks", "Makefile"):
        assert (sdist / name).exists(), name
    assert not [path for path in sdist.rglob("*") if path.suffix in (".pyc", ".nbc", ".nbi")]


def test_a_name_is_what_is_shipped_and_a_path_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ppo").mkdir()
    assert agents.load("ppo").card.seed == 0
    for own in ("./ppo", Path("ppo")):
        with pytest.raises(aframe_env.InvalidValue, match="no agent in 'ppo'"):
            agents.load(own)
    with pytest.raises(aframe_env.InvalidValue, match=r"agent = 'pppo': must be one of 'ppo', .*, 'sac', "):
        agents.load("pppo")
    assert shipped.folder("drive-map") == ROOT / "results" / "drive-map"


def test_every_command_of_train_is_one_of_aframe(tmp_path: Path) -> None:
    doors = {
        path.parent if path.name == "__main__.py" else path.with_suffix("")
        for path in (ROOT / "train").rglob("*.py")
        if '__name__ == "__main__"' in path.read_text(encoding="utf-8")
    }
    assert {door.name.replace("_", "-") for door in doors} == set(COMMANDS)
    said = python(*AFRAME, "--help", cwd=tmp_path)
    assert said.returncode == 0
    assert re.findall(r"^  (\S+)  +\S", said.stdout, flags=re.MULTILINE) == list(COMMANDS)


def test_aframe_s_version_usage_and_exit_status(tmp_path: Path) -> None:
    said = python(*AFRAME, "--version", cwd=tmp_path)
    assert (said.returncode, said.stdout) == (0, f"aframe-heave {aframe_env.__version__}\n")
    for arguments in (("pppo",), ()):
        said = python(*AFRAME, *arguments, cwd=tmp_path)
        assert said.returncode == 2
        assert re.fullmatch(r"error: command = '\w*': must be one of ppo, sac, .*\n", said.stderr)
    said = python(*AFRAME, "render", "--help", cwd=tmp_path)
    assert said.returncode == 0
    assert said.stdout.startswith("usage: aframe render [")
    said = python(*AFRAME, "verify", "--out", "result.json", cwd=tmp_path)
    assert said.returncode == 2
    assert "--out goes with --load-case" in said.stdout + said.stderr


def test_a_command_of_aframe_does_what_python_does(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text("rfes = [20, 16]\n")
    options = ("--load-case", "case.toml")
    short, long = (
        python(*AFRAME, "verify", *options, cwd=tmp_path),
        python("-m", "train.verify", *options, cwd=tmp_path),
    )
    assert '"R_AR_D"' in short.stdout
    assert (short.returncode, short.stdout) == (long.returncode, long.stdout) == (0, long.stdout)


def test_aframe_s_help_leaves_the_slow_libraries_for_later(tmp_path: Path) -> None:
    code = """
import sys
from aframe_env.cli import main
sys.argv = ["aframe", "--help"]
main()
print([name for name in ("agents", "train", "torch", "numba", "scipy", "tyro", "rich") if name in sys.modules])
"""
    assert python("-c", code, cwd=tmp_path).stdout.endswith("\n[]\n")


FOREIGN = 'print("foreign")\n'


@pytest.mark.parametrize("file", ["agents/__init__.py", "agents.py", "train/__init__.py", "train.py"])
def test_aframe_says_in_one_sentence_what_stands_in_the_way(file: str, tmp_path: Path) -> None:
    foreign = tmp_path / file
    foreign.parent.mkdir(exist_ok=True)
    foreign.write_text(FOREIGN)
    said = python(*AFRAME, "ppo", "--help", cwd=tmp_path)
    assert (said.returncode, said.stdout) == (2, "")
    name = file.removesuffix(".py").partition("/")[0]
    assert re.fullmatch(
        rf"error: {re.escape(str(foreign))} stands in the way of aframe-heave's own package '{name}': rename it.*\n",
        said.stderr,
    )


@pytest.mark.parametrize("command", [("-m", "train.ppo", "--help"), ("-c", "import train.learn.run")])
def test_train_says_which_agents_stand_in_the_way(command: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "agents.py").write_text(FOREIGN)
    said = python(*command, cwd=tmp_path)
    assert (said.returncode, said.stdout) == (1, "")
    last = said.stderr.splitlines()[-1]
    assert f"{tmp_path / 'agents.py'} stands in the way of aframe-heave's own package 'agents'" in last
    if "-m" in command:
        assert said.stderr.splitlines() == [last]


def test_the_environment_goes_with_agents_of_the_users_own(tmp_path: Path) -> None:
    (tmp_path / "agents.py").write_text(FOREIGN)
    said = python("-W", "error", "-c", "import aframe_env, agents", cwd=tmp_path)
    assert (said.returncode, said.stdout, said.stderr) == (0, "foreign\n", "")


def test_a_distribution_that_overwrites_agents_is_named(tmp_path: Path) -> None:
    site, folder = tmp_path / "site", tmp_path / "folder"
    folder.mkdir()
    for package in ("aframe_env", "agents", "train"):
        shutil.copytree(ROOT / package, site / package, ignore=shutil.ignore_patterns("__pycache__"))
    (site / "agents" / "__init__.py").write_text(FOREIGN)
    info = site / "openai_agents-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: openai-agents\nVersion: 1.0\n")
    (info / "RECORD").write_text("agents/__init__.py,,\nopenai_agents-1.0.dist-info/METADATA,,\n")
    sentence = f"{site / 'agents' / '__init__.py'}, of openai-agents, stands in the way of aframe-heave's own package"
    said = python(*AFRAME, "ppo", path=site, cwd=folder)
    assert said.returncode == 2
    assert said.stdout == ""
    assert said.stderr.splitlines()[-1].startswith(f"error: {sentence} 'agents': install the two into environments")
    said = python("-c", "import aframe_env; import agents", path=site, cwd=folder)
    assert said.returncode == 0
    assert f"UserWarning: {sentence}" in said.stderr
    # As an uninstaller of the other distribution leaves it.
    shutil.rmtree(info)
    (site / "agents" / "__init__.py").unlink()
    said = python(*AFRAME, "ppo", path=site, cwd=folder)
    damaged = f"error: {site / 'agents'}: aframe-heave's own package 'agents' is damaged: pip install --force-reinstall"
    assert (said.returncode, said.stderr) == (2, f"{damaged} aframe-heave\n")


def test_the_citation_is_of_this_version() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.*)$", text, flags=re.MULTILINE) == [aframe_env.__version__]
