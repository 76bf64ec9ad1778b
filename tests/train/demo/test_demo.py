"""The live viewer: the lift that it plays, and the page in a real browser."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
from dataclasses import replace
from threading import Thread

import numpy as np
import pytest
from rich.console import Console

from aframe_env import InvalidValue, ScenarioDistribution
from agents.rollout import held_out_scenarios, run
from train.demo import __main__ as demo
from train.demo.__main__ import Options
from train.demo.episode import RUN_IN, Setting, begin, reduction
from train.demo.policies import build, choices
from train.shared.episode import between

LAW = "feed-forward + feedback (state)"
SETTING = Setting(policy=LAW, sensors=False, hs=3.0, tp=9.0, heading=2.6, load_mass=6e4, rope_length=500.0, seed=1)


def test_both_lifts_are_those_of_the_rollout():
    episode = begin(SETTING)
    episode.advance_to(20.0)
    history = episode.history()
    assert history[-1, 0] == pytest.approx(20.0)
    for column, policy in ((1, LAW), (2, "drum still")):
        chosen, _ = build(policy, sensors=False)
        rolled = run(chosen, [SETTING.scenario()], episode_duration=20.0)
        np.testing.assert_allclose(history[:, column], rolled.error[0], atol=1e-6)


def test_between_two_steps_the_ship_moves_evenly():
    episode = begin(SETTING)
    episode.advance_to(RUN_IN)
    before, after = episode.at(RUN_IN - 0.1).driven, episode.at(RUN_IN).driven
    middle = episode.at(RUN_IN - 0.05).driven
    assert middle.time == pytest.approx(RUN_IN - 0.05)
    np.testing.assert_allclose(middle.load, 0.5 * (before.load + after.load), atol=1e-9)
    assert between(before, after, 1.0).depth_error == pytest.approx(episode.history()[-1, 1])
    assert abs(after.deck - before.deck).max() > 1e-3


def test_reduction_is_one_minus_the_ratio_of_rms():
    t = np.linspace(0.0, 10.0, 101)
    history = np.column_stack([t, 0.2 * np.sin(t), 2.0 * np.sin(t)])
    assert reduction(history) == pytest.approx(0.9)
    assert np.isnan(reduction(np.zeros((3, 3))))


def test_sensors_decide_what_a_law_is_and_sees():
    offered = {choice.name: choice for choice in choices(())}
    law = offered["predictive control"]
    assert build(law.text(sensors=True), True)[1] == "sensors"
    assert build(law.text(sensors=False), False)[1] == "state"
    noisy = replace(SETTING, policy=law.text(sensors=True), sensors=True)
    assert begin(noisy).on_sensors
    assert not begin(SETTING).on_sensors


def test_policies_can_be_named_and_those_that_need_the_future_are_refused():
    assert [choice.name for choice in choices([LAW, "drum-still", LAW])] == [LAW, "drum still"]
    seeds = [f"results/agents/ppo/seed-{k}" for k in (0, 1)]
    assert [choice.name for choice in choices(seeds)] == seeds
    with pytest.raises(InvalidValue, match="must be one that acts as it goes"):
        choices(["winch-limited optimum"])
    with pytest.raises(InvalidValue, match="'nobody': must be one of"):
        choices(["nobody"])


def command(*options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "train.demo", "--no-open", *options], capture_output=True, text=True, timeout=300
    )


def test_a_port_in_use_names_one_that_is_free():
    pytest.importorskip("viser", reason="needs viser")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = command("--port", str(port))
    assert done.returncode == 2
    said = re.fullmatch(rf"error: port = {port}: is in use.*: python -m train\.demo --port (\d+)\n", done.stderr)
    assert said is not None
    assert int(said[1]) != port


def test_without_viser_the_extra_is_named(monkeypatch):
    monkeypatch.setattr(demo, "find_spec", lambda name: None)
    with pytest.raises(Exception, match=r'pip install "aframe-heave\[demo\]"'):
        demo.run(Options(open=False), Console(quiet=True))


def test_a_recording_that_cannot_be_is_refused(tmp_path):
    pytest.importorskip("viser", reason="needs viser")
    with pytest.raises(InvalidValue, match=r"must end in \.html or \.viser, as in --record a\.html"):
        Options(record=tmp_path / "a.mp4")
    there = tmp_path / "there.html"
    there.write_text("mine")
    done = command("--record", str(there))
    assert done.returncode == 2
    assert re.fullmatch(r"error: record = .*: exists; choose another, or pass --overwrite\n", done.stderr)
    assert list(tmp_path.iterdir()) == [there]
    assert there.read_text() == "mine"


# ---- in the browser: what is recorded first, while no live page keeps the processor busy


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Five seconds of a held-out scenario, as a page and as the recording alone."""
    pytest.importorskip("viser", reason="needs viser")
    folder = tmp_path_factory.mktemp("replay")
    files = [folder / "replay.html", folder / "replay.viser"]
    for file in files:
        options = Options(policy=LAW, scenario=3, start=20.0, seconds=5.0, record=file)
        assert demo.run(options, Console(quiet=True)) == 0
    assert sorted(folder.iterdir()) == files
    return files


def test_a_recording_is_of_the_episode_of_the_comparison(recorded):
    """viser's format: sizes, then messages in msgpack, compressed; a caption says what is shown."""
    msgspec, zstandard = pytest.importorskip("msgspec"), pytest.importorskip("zstandard")
    inner = zstandard.ZstdDecompressor().decompressobj().decompress(recorded[1].read_bytes()[8:])
    told = msgspec.msgpack.decode(inner[8 : 8 + int.from_bytes(inner[:8], "little")])
    assert told["durationSeconds"] == pytest.approx(5.0)
    captions = re.findall(
        r"feed-forward \+ feedback \(state\), ([0-9.]+) s\ndepth error (-?[0-9.]+) (c?m), drum still (-?[0-9.]+) (c?m)",
        "\n".join(
            str(message["updates"]["text"]) for _, message in told["messages"] if "text" in message.get("updates", ())
        ),
    )
    assert len(captions) == 15
    scenarios = held_out_scenarios(ScenarioDistribution(), 4)
    law, still = (run(build(name, sensors=False)[0], scenarios, episode_duration=25.0) for name in (LAW, "drum still"))
    for time, error, unit, left, its_unit in captions[::3]:
        step = round(10.0 * float(time))
        assert float(error) * (0.01 if unit == "cm" else 1.0) == pytest.approx(law.error[3, step], abs=0.006)
        assert float(left) * (0.01 if its_unit == "cm" else 1.0) == pytest.approx(still.error[3, step], abs=0.006)


def test_a_recording_plays_without_a_network(recorded, chromium_in_3d):
    context = chromium_in_3d.new_context(offline=True, viewport={"width": 240, "height": 180})
    opened = context.new_page()
    wrong, asked = [], []
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    opened.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
    opened.on("request", lambda request: asked.append(request.url))
    opened.set_default_timeout(120_000)
    opened.goto(recorded[0].as_uri())
    clock = opened.locator("input").first
    clock.wait_for()
    before = clock.input_value(), opened.screenshot()
    opened.wait_for_function("(before) => document.querySelector('input').value !== before", arg=before[0])
    assert opened.screenshot() != before[1]
    assert wrong == []
    assert [url for url in asked if not url.startswith(("file:", "blob:", "data:"))] == []
    context.close()


@pytest.fixture(scope="module")
def viewer():
    pytest.importorskip("viser", reason="needs viser")
    from train.demo.viewer import Viewer

    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    made = Viewer("127.0.0.1", port, (LAW, "drum still"))
    thread = Thread(target=made.play)
    thread.start()
    yield made
    made.end()
    thread.join(timeout=20.0)
    assert not thread.is_alive()


@pytest.fixture(scope="module")
def page(viewer, chromium_in_3d):
    # A small picture: what is tested here is not how fast a processor draws.
    opened = chromium_in_3d.new_page(viewport={"width": 640, "height": 400})
    opened.wrong = []
    opened.on("pageerror", lambda error: opened.wrong.append(str(error)))
    opened.asked = []
    opened.on("request", lambda request: opened.asked.append(request.url))
    opened.set_default_timeout(120_000)
    opened.goto(viewer.address)
    opened.wait_for_selector("text=heave reduction")
    return opened


def figures(page):
    """Load error and drum still, RMS, in metres, as the page says them."""
    text = page.locator("text=/^[0-9.]+ (cm|m)$/").all_inner_texts()
    return [float(t.split()[0]) * (0.01 if t.endswith("cm") else 1.0) for t in text[:2]]


def test_the_page_shows_the_error_beside_the_drum_still(page):
    driven, still = figures(page)
    assert 0.0 < driven < 0.2 * still


def test_a_slider_changes_the_loads_error(page):
    before = figures(page)
    page.get_by_role("slider").first.press("Home")  # Hs, to its least
    page.wait_for_function(
        "(before) => { const m = document.body.innerText.match(/([0-9.]+) cm[^]*?([0-9.]+) (cm|m)/);"
        " return m && m[3] === 'cm' && Math.abs(m[1] - before) > 0.01 }",
        arg=100.0 * before[0],
    )
    after = figures(page)
    assert after[1] < 0.4 * before[1]
    assert after[0] < before[0]


def test_nothing_went_wrong_and_nothing_was_asked_elsewhere(page, viewer):
    assert page.wrong == []
    assert {url.split("/")[2] for url in page.asked if url.startswith(("http", "ws"))} == {viewer.address.split("/")[2]}
