import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pytest

from aframe_env import InvalidValue
from train.learn import ppo
from train.shared.cli import parse, read_options, to_toml


@dataclass(frozen=True)
class Options:
    """Something of each type."""

    count: int = 3
    rate: float = 0.5
    kind: Literal["a", "b"] = "a"
    out: Path | None = None
    flag: bool = False


def test_what_is_written_reads_back(tmp_path):
    for options in (Options(), Options(count=7, rate=1.0, kind="b", out=Path("x/y"), flag=True)):
        path = tmp_path / "options.toml"
        path.write_text(to_toml(options))
        assert read_options(path, Options) == options
    path.write_text(to_toml(ppo.Options(timesteps=5000, seed=3)))
    assert read_options(path, ppo.Options) == ppo.Options(timesteps=5000, seed=3)


def test_the_command_line_overrides_the_file(tmp_path):
    path = tmp_path / "options.toml"
    path.write_text("count = 5\nrate = 2\n")
    assert parse(Options, "train.test", "", ["--config", str(path), "--count", "6"]) == Options(count=6, rate=2.0)
    assert parse(Options, "train.test", "", [f"--config={path}"]) == Options(count=5, rate=2.0)
    assert parse(Options, "train.test", "", []) == Options()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cuont = 5", "unknown key 'cuont': must be one of count, flag, kind, out, rate"),
        ("count = 1.5", r"\[count\] 1.5: must be of type int"),
        ("count = true", r"\[count\] True: must be of type int"),
        ("rate = 'x'", r"\[rate\] 'x': must be a number"),
        ("kind = 'c'", r"\[kind\]"),
        ("count =", "not TOML"),
    ],
)
def test_a_bad_file_is_named_with_its_key(text, words, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(InvalidValue, match=words) as caught:
        read_options(path, Options)
    assert str(path) in str(caught.value)


def test_usage_names_the_command_as_one_calls_it(capsys):
    with pytest.raises(SystemExit):
        parse(ppo.Options, "train.ppo", "", ["--help"])
    assert "python -m train.ppo [" in capsys.readouterr().out
    command = [sys.executable, "-m", "train.vessel", "--frequencies", "many"]
    usage = subprocess.run(command, capture_output=True, text=True, check=False)
    assert usage.returncode == 2
    assert "python -m train.vessel" in usage.stderr + usage.stdout


def test_a_missing_file():
    with pytest.raises(InvalidValue, match="cannot be read"):
        parse(Options, "train.test", "", ["--config", "absent.toml"])
    with pytest.raises(InvalidValue, match="--config needs a file"):
        parse(Options, "train.test", "", ["--config"])
