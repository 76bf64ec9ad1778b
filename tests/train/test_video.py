"""The command that writes an episode as a video, read back."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from rich.console import Console

import aframe_env
from aframe_env import InvalidValue, ScenarioDistribution
from aframe_env.rendering.palette import HEAVE, LOAD
from agents.policy import DrumStill
from agents.registry import BuildContext, choose
from agents.rollout import held_out_scenarios
from agents.rollout import run as roll_out
from train import video
from train.video import Options, begin, frames, run

Image = pytest.importorskip("PIL.Image", reason="needs the extra video: Pillow")
pytest.importorskip("pygame", reason="needs the extra video: pygame")
LAW = "feed-forward + feedback (state)"
BELOW, MAGNIFIED = (slice(372, 452), slice(12, 614)), (slice(216, 442), slice(690, 938))
"""Parts of the picture with the load at the ship's scale, and magnified, right of the ruler."""


def written(options: Options) -> list[np.ndarray]:
    """Write the GIF, and read it back."""
    assert run(options, Console(quiet=True)) == 0
    assert options.out is not None
    with Image.open(options.out) as read:
        pictures = []
        for index in range(read.n_frames):
            read.seek(index)
            assert read.info["duration"] == 100
            pictures.append(np.asarray(read.convert("RGB")))
    return pictures


def rows_of(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Rows of the pixels of about a colour: a GIF has few of them."""
    return np.argwhere((abs(picture.astype(int) - colour) <= 10).all(axis=-1))[:, 0]


def still_error(scenario: int, start: float, seconds: float) -> np.ndarray:
    """Depth error of a held-out scenario with the drum still, ten times a second, m."""
    chosen = held_out_scenarios(ScenarioDistribution(), scenario + 1)[-1]
    error = roll_out(DrumStill(), [chosen], episode_duration=start + seconds).error[0]
    return error[round(10 * start) : round(10 * (start + seconds))]


def test_in_a_gif_the_load_moves_as_in_the_rollout(tmp_path: Path) -> None:
    options = Options(
        out=tmp_path / "a.gif", policy="drum still", scenario=1, start=15.0, seconds=4.0, beside_still=False
    )
    pictures = written(options)
    assert [picture.shape for picture in pictures] == [(640, 960, 3)] * 40
    levels = [np.median(rows_of(picture[BELOW], LOAD)) for picture in pictures]
    error = still_error(1, 15.0, 4.0)
    # At the ship's scale, 11 pixels a metre; higher is a lower row.
    slope, _ = np.polyfit(error, levels, 1)
    assert np.ptp(error) > 0.5
    assert slope == pytest.approx(-11.0, rel=0.08)


def test_beside_the_load_held_still_moves_that_of_the_still_drum(tmp_path: Path) -> None:
    pictures = written(Options(out=tmp_path / "a.gif", policy=LAW, scenario=504, start=33.0, seconds=4.0))
    held = [np.median(rows_of(picture[MAGNIFIED], LOAD)) for picture in pictures]
    error = still_error(504, 33.0, 4.0)
    assert np.ptp(error) > 3.0
    assert np.ptp(held) < 12.0
    below = np.flatnonzero(error < -1.0)  # elsewhere the load hides its lower edge
    lower_edge = [rows_of(pictures[k][MAGNIFIED], HEAVE).max() for k in below]
    assert len(below) > 5
    assert np.corrcoef(error[below], lower_edge)[0, 1] < -0.99


def test_an_mp4_has_every_picture(tmp_path: Path) -> None:
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs the extra video: imageio-ffmpeg")
    options = Options(
        out=tmp_path / "new" / "a.mp4", policy=LAW, scenario=2, start=3.0, seconds=1.0, fps=24.0, width=501
    )
    assert run(options, Console(quiet=True)) == 0
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["a.mp4"]
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(options.out), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    decoded = subprocess.run(command, capture_output=True, check=True)
    assert re.search(r"Video: h264 .* yuv420p.* 500x334.* 24 fps", decoded.stderr.decode())
    read = np.frombuffer(decoded.stdout, np.uint8).reshape(-1, 334, 500, 3).astype(float)
    drawn = np.array(list(frames(begin(options), 3.0 + np.arange(24) / 24.0, options)), dtype=float)
    assert read.shape == drawn.shape
    difference = abs(read[:, None] - drawn[None]).mean(axis=(2, 3, 4))
    assert difference.diagonal().max() < 3.0
    assert (difference.argmin(axis=1) == np.arange(24)).mean() > 0.9


def test_the_episode_is_the_comparison_s() -> None:
    episode = begin(Options(policy="feed-forward + feedback", scenario=2, start=0.0, seconds=8.0))
    episode.advance_to(8.0)
    scenarios = held_out_scenarios(ScenarioDistribution(), 3)
    config = aframe_env.TaskConfig(episode_duration=8.0)
    law = choose("feed-forward + feedback").build(BuildContext(scenarios=scenarios, config=config))
    error = roll_out(law, scenarios, config, observation="sensors").error[2]
    assert episode.on_sensors
    np.testing.assert_allclose(episode.history()[:, 1], error, atol=1e-6)


def test_an_episode_of_a_file_is_that_of_reset(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text('kind = "distribution"\nhs = [1.0, 3.0]\n')
    episode = begin(Options(policy="drum still", scenario=mine, seed=5, start=0.0, seconds=6.0))
    episode.advance_to(6.0)
    env = gymnasium.make("AFrameHeave-v0", scenario=str(mine))
    error = [env.reset(seed=5)[0][0]]
    error += [env.step(np.zeros(1, dtype=np.float32))[0][0] for _ in range(60)]
    np.testing.assert_allclose(episode.history()[:, 1], error, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a.avi", r"must end in \.mp4 or \.gif, as in --out a\.mp4"),
        ("a", r"must end in \.mp4 or \.gif"),
        ("folder.gif", "is a folder"),
        ("there.gif", "exists; choose another, or pass --overwrite"),
        ("there.gif/below/a.gif", "is a file; choose another with --out"),
    ],
)
def test_a_file_that_cannot_be_is_refused(tmp_path: Path, name: str, said: str) -> None:
    (tmp_path / "folder.gif").mkdir()
    (tmp_path / "there.gif").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InvalidValue, match=said):
        run(Options(out=tmp_path / name), Console(quiet=True))
    assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "there.gif").read_text() == "mine"


def test_values_out_of_range_are_refused() -> None:
    for name, value in (("seconds", 0.0), ("fps", 100.0), ("width", 10), ("scenario", -1), ("start", -1.0)):
        with pytest.raises(InvalidValue, match=f"^{name} = "):
            Options(**{name: value})  # type: ignore[arg-type]


def test_without_the_extra_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video, "find_spec", lambda name: None)
    with pytest.raises(Exception, match=r'pip install "aframe-heave\[video\]"'):
        run(Options(out=tmp_path / "a.gif"), Console(quiet=True))


@pytest.mark.parametrize("suffix", ["mp4", "gif"])
def test_a_full_disk_leaves_nothing(tmp_path: Path, suffix: str) -> None:
    resource = pytest.importorskip("resource", reason="needs a limit of a file's size")
    if suffix == "mp4":
        pytest.importorskip("imageio_ffmpeg", reason="needs the extra video: imageio-ffmpeg")
    options = ["--policy", "drum still", "--seconds", "1", "--out", str(tmp_path / f"a.{suffix}")]
    done = subprocess.run(
        [sys.executable, "-m", "train.video", *options],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)),
    )
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("error: ")
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="needs Ctrl-C as a signal")
def test_an_interrupted_video_leaves_nothing(
    tmp_path: Path, start: Callable[..., subprocess.Popen[str]], interrupt: Callable[..., str]
) -> None:
    options = ["--policy", "drum still", "--seconds", "600", "--out", str(tmp_path / "a.gif")]
    command = [sys.executable, "-m", "train.video", *options]
    started = start(command, stderr=subprocess.PIPE)
    said = interrupt(started, lambda: list(tmp_path.iterdir()))
    assert (started.returncode, said) == (130, "interrupted\n")
    assert list(tmp_path.iterdir()) == []
