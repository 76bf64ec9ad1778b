"""Exported controllers beside Python's, and what they do with bad readings."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from rich.console import Console

import agents
from aframe_env import InvalidValue, MotionUnit, Scenario, ScenarioDistribution
from aframe_env.scenario.crane import Crane, Rope, Winch
from agents import shipped
from agents.learned.agent import LearnedPolicy, load
from agents.policy import DrumStill
from agents.rollout import held_out_scenarios, run
from train.export import __main__ as command
from train.export.check import Lifts, check
from train.export.interface import crane_values, readings_of, told_of
from train.export.session import Session

for needed in ("onnx", "onnxscript", "onnxruntime"):
    pytest.importorskip(needed, reason=f"needs the extra onnx: {needed}")

NAN = float("nan")
EXAMPLE = Path(__file__).parents[2] / "examples" / "deploy"


class Exported(NamedTuple):
    agent: LearnedPolicy
    folder: Path

    @property
    def model(self) -> Path:
        return self.folder / command.MODEL


@pytest.fixture(scope="module", params=["ppo", "sac-sensors"])
def exported(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    folder = tmp_path_factory.mktemp("export") / request.param
    assert command.run(command.Options(agent=request.param, out=folder), Console(quiet=True)) == 0
    return Exported(agents.load(request.param), folder)


def first_rows(exported: Exported, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Readings, told values and drum speeds of the episode's first steps."""
    with (exported.folder / command.EPISODE).open(encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    readings, told = readings_of(exported.agent.card).names, told_of(exported.agent.card).names
    assert header == [*readings, *told, "drum_speed"]
    values = np.array(rows[:count], dtype=np.float64)
    return values[:, : len(readings)], values[:, len(readings) : -1], values[:, -1]


def test_a_model_commands_what_python_does(exported: Exported) -> None:
    scenarios = held_out_scenarios(ScenarioDistribution(), 2)
    agreement = check(exported.agent, exported.model, scenarios)
    assert agreement.drum_speed.shape == (600, 2)
    assert agreement.drum_speed.max() < 1e-8
    # Loops that differ by the network's rounding part a little where the sea is calm: held to what there is to hold.
    still = run(DrumStill(), scenarios, observation="state").rms
    assert (np.abs(agreement.rms - agreement.rms_python) < 0.01 * still).all()


def test_a_model_is_told_the_crane(exported: Exported) -> None:
    """Another drum, rope and winch, which lags behind its command."""
    (scenario,) = held_out_scenarios(ScenarioDistribution(), 1)
    winch = Winch(drum_diameter=1.1, max_rope_speed=1.5, max_rope_acceleration=1.2, lag=0.25)
    slow = replace(scenario, crane=Crane(winch=winch, rope=Rope(axial_stiffness=1.2e8)))
    assert check(exported.agent, exported.model, [slow]).drum_speed.max() < 1e-8


def test_a_model_says_what_it_is(exported: Exported) -> None:
    import onnx

    description = json.loads((exported.folder / command.DESCRIPTION).read_text(encoding="utf-8"))
    assert description["sha256"] == exported.agent.card.sha256
    metadata = Session(exported.model).metadata
    assert metadata["sha256"] == exported.agent.card.sha256
    assert json.loads(metadata["inputs"]) == description["inputs"]
    graph = onnx.load(exported.model).graph
    # A constant in single precision would be a number of a formula that was rounded on the way.
    assert onnx.TensorProto.FLOAT not in {each.data_type for each in graph.initializer}
    for values, described in ((graph.input, description["inputs"]), (graph.output, description["outputs"])):
        assert [value.name for value in values] == [tensor["name"] for tensor in described]
        for value, tensor in zip(values, described, strict=True):
            assert value.type.tensor_type.elem_type == onnx.TensorProto.DOUBLE
            assert [dimension.dim_value for dimension in value.type.tensor_type.shape.dim] == tensor["shape"]
            ends = [each["start"] + int(np.prod(each["shape"])) for each in tensor["quantities"]]
            assert [each["start"] for each in tensor["quantities"]] + tensor["shape"] == [0, *ends]
    units = {each["name"]: each["unit"] for each in description["inputs"][0]["quantities"]}
    assert units["rope_tension"] == "N"


def test_a_bad_reading_stops_the_drum_within_its_acceleration(exported: Exported) -> None:
    session = Session(exported.model)
    readings, told, _ = first_rows(exported, 120)
    state = np.zeros(session.state_size)
    moving = state
    fastest = 0.0
    for step in range(120):
        speed, fault, state = session.step(readings[step], told[step], state)
        assert not fault
        if abs(speed) > fastest:
            fastest, moving, after = abs(speed), state, step + 1
    winch = crane_values(Crane())
    most = winch["max_acceleration"] * exported.agent.card.control_period
    # The reckoned speed of the drum lies behind the flags.
    last = moving[2]
    assert abs(last) > 0.05
    for place, bad in [(place, bad) for place in range(readings.shape[1]) for bad in (NAN, np.inf, -np.inf, 1e12)]:
        broken = readings[min(after, 119)].copy()
        broken[place] = bad
        speed, fault, state = session.step(broken, told[0], moving)
        assert fault
        np.testing.assert_allclose(speed, np.sign(last) * max(abs(last) - most, 0.0), atol=1e-12)
        # It stays so, whatever is read from then on, until somebody begins another lift.
        for _ in range(20):
            before = speed
            speed, fault, state = session.step(readings[-1], told[0], state)
            assert fault
            assert abs(speed - before) <= most + 1e-12
            assert np.isfinite(state).all()
        assert speed == 0.0
    _, fault, _ = session.step(readings[0], told[0], np.zeros(session.state_size))
    assert not fault


def test_a_lift_does_not_begin_with_what_is_told_wrongly(exported: Exported) -> None:
    session = Session(exported.model)
    readings, told, commanded = first_rows(exported, 1)
    for place in range(told.shape[1]):
        for bad in (NAN, np.inf, -1.0):
            wrong = told[0].copy()
            wrong[place] = bad
            speed, fault, state = session.step(readings[0], wrong, np.zeros(session.state_size))
            assert fault
            assert speed == 0.0
            speed, fault, state = session.step(readings[0], told[0], state)
            assert (speed, fault) == (0.0, True)
    speed, fault, state = session.step(readings[0], told[0], np.zeros(session.state_size))
    assert (speed, fault) == (commanded[0], False)
    # Told once, before the lift: what comes later is not looked at.
    again = session.step(readings[0], np.full_like(told[0], NAN), state)
    once = session.step(readings[0], told[0], state)
    assert again[:2] == once[:2]
    np.testing.assert_array_equal(again[2], once[2])


def said(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *arguments: str) -> str:
    """What the command says on standard error when it refuses."""
    monkeypatch.setattr(sys, "argv", ["train.export", *arguments])
    with pytest.raises(SystemExit) as stopped:
        command.main()
    assert stopped.value.code == 2
    return capsys.readouterr().err


def test_bad_input_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    assert f"no agent in {str(foreign)!r}" in said(capsys, monkeypatch, str(foreign), "--out", str(out))
    predictive = said(capsys, monkeypatch, "predictive-ppo", "--out", str(out))
    assert "quadratic programme" in predictive
    assert "aframe export ppo-sensors" in predictive
    for name in ("apg-storm", str(shipped.folder("apg-storm") / "seed-0")):
        recurrent = said(capsys, monkeypatch, name, "--out", str(out))
        assert f"agent = {name!r}: is a recurrent agent" in recurrent
    agent = load("ppo-sensors")
    assert agent.card.sensors is not None
    unit = replace(agent.card, sensors=replace(agent.card.sensors, motion_unit=MotionUnit()))
    with monkeypatch.context() as patched:
        patched.setattr(command, "load", lambda name: LearnedPolicy(agent.actor, unit))
        assert "was trained with a motion_unit" in said(capsys, monkeypatch, "ppo-sensors", "--out", str(out))
    monkeypatch.setitem(sys.modules, "onnx", None)
    assert 'is not installed: pip install "aframe-heave[onnx]"' in said(capsys, monkeypatch, "ppo", "--out", str(out))
    assert not out.exists()
    with pytest.raises(InvalidValue, match=r"check = -1: must be in \[0, 20000\]"):
        command.Options(agent="ppo", check=-1)


def header_folder() -> Path | None:
    """Where the headers of ONNX Runtime's C interface lie: ORT_INCLUDE, a fetched release, or the system's."""
    places = [
        *([Path(os.environ["ORT_INCLUDE"])] if "ORT_INCLUDE" in os.environ else []),
        *sorted(EXAMPLE.glob("onnxruntime-*/include")),
        *(Path(prefix, "include", inner) for prefix in ("/usr/local", "/usr") for inner in ("", "onnxruntime")),
    ]
    return next((place for place in places if (place / "onnxruntime_c_api.h").is_file()), None)


@pytest.fixture(scope="module")
def lift(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example in C, built against the library of the Python package."""
    import onnxruntime

    if shutil.which("make") is None or shutil.which("cc") is None:
        pytest.skip("needs make and a C compiler")
    include = header_folder()
    if include is None:
        pytest.skip("needs onnxruntime_c_api.h: make -C examples/deploy, or ORT_INCLUDE=FOLDER")
    libraries = list((Path(onnxruntime.__file__).parent / "capi").glob("libonnxruntime.so*"))
    if not libraries:
        pytest.skip("needs libonnxruntime.so in the package onnxruntime")
    program = tmp_path_factory.mktemp("deploy") / "lift"
    places = (f"INCLUDE={include}", f"LIBRARY={libraries[0]}", f"OUT={program}")
    made = subprocess.run(["make", "-C", EXAMPLE, *places], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    return program


def flown(program: Path, model: Path, episode: Path) -> tuple[subprocess.CompletedProcess[str], np.ndarray]:
    """Run the example on an episode; what it printed, (steps, 2)."""
    done = subprocess.run([program, model, episode, "--fast"], capture_output=True, text=True, check=False)
    return done, np.loadtxt(done.stdout.splitlines(), delimiter=",", ndmin=2)


def test_the_example_in_c_commands_what_python_does(exported: Exported, lift: Path) -> None:
    done, printed = flown(lift, exported.model, exported.folder / command.EPISODE)
    assert done.returncode == 0, done.stderr
    _, _, expected = first_rows(exported, 600)
    np.testing.assert_allclose(printed[:, 0], expected, rtol=0.0, atol=1e-12)
    assert not printed[:, 1].any()
    assert re.fullmatch(r"600 steps, 0 late, the worst took \d+\.\d+ ms\n", done.stderr)


@pytest.mark.parametrize("row", ["nan,1,1,1,1,1,1,1,1,1,1,1,1,1", "what?", ""], ids=["nan", "word", "empty"])
def test_the_example_in_c_stops_on_a_row_that_is_broken(
    exported: Exported, lift: Path, tmp_path: Path, row: str
) -> None:
    lines = (exported.folder / command.EPISODE).read_text(encoding="utf-8").splitlines()[:301]
    lines[200] = row
    broken = tmp_path / "broken.csv"
    broken.write_text("\n".join(lines) + "\n", encoding="utf-8")
    done, printed = flown(lift, exported.model, broken)
    assert done.returncode == 3
    assert "step 199: bad readings, safe stop" in done.stderr
    np.testing.assert_array_equal(printed[:, 1], np.arange(300) >= 199)
    assert (np.diff(abs(printed[199:, 0])) <= 0.0).all()
    assert printed[-1, 0] == 0.0


def test_models_are_for_light_ropes(exported: Exported) -> None:
    heavy = Scenario(crane=Crane(rope=Rope.six_strand()))
    with pytest.raises(InvalidValue, match="exported controllers take a rope without mass in air"):
        Lifts(exported.agent, [heavy])
