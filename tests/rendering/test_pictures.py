"""The pictures, and how the environments show them."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RenderCollection

from aframe_env import Crane, Harmonic, HarmonicMotion, InvalidValue, Rope, Scenario, Winch
from aframe_env.rendering.palette import INK, LOAD, WARNING
from aframe_env.scenario import Frame

STILL = np.zeros(1, dtype=np.float32)
SIDE_VIEW, INSTRUMENTS, MAGNIFIED, CHART = (
    (slice(12, 452), slice(12, 614)),
    (slice(12, 172), slice(624, 948)),
    (slice(182, 452), slice(624, 948)),
    (slice(462, 628), slice(12, 948)),
)


def make(**arguments: Any) -> Any:
    return gymnasium.make("AFrameHeave-v0", render_mode="rgb_array", **arguments).unwrapped


def frame_after(env: Any, steps: int, action: float = 0.0) -> np.ndarray:
    for _ in range(steps):
        env.step(np.array([action], dtype=np.float32))
    return env.render()


def pixels_of(frame: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Places (n, 2), row and column, of pixels of a colour."""
    return np.argwhere((frame == colour).all(axis=-1))


def test_frame_is_a_picture() -> None:
    env = make()
    env.reset(seed=1)
    frame = env.render()
    assert frame.shape == (640, 960, 3)
    assert frame.dtype == np.uint8
    assert len(np.unique(frame.reshape(-1, 3), axis=0)) > 100
    np.testing.assert_array_equal(frame, env.render())


def test_every_part_shows_what_moves() -> None:
    env = make(scenario=Scenario.paper())
    env.reset(seed=0)
    before = env.render()
    after = frame_after(env, 30, 0.5)
    for part in (SIDE_VIEW, INSTRUMENTS, MAGNIFIED, CHART):
        assert (before[part] != after[part]).any()


def test_load_is_seen_where_it_is() -> None:
    env = make(scenario=Scenario.paper())
    env.reset(seed=0)
    levels, errors = [], []
    for _ in range(4):
        frame = frame_after(env, 20)
        levels.append(float(np.median(pixels_of(frame[372:452, 12:614], LOAD)[:, 0])))
        errors.append(env.simulation.state[0, 0])
    # At the ship's scale, 11 pixels a metre; higher is a lower row.
    slope, _ = np.polyfit(errors, levels, 1)
    assert np.ptp(errors) > 2.0
    assert slope == pytest.approx(-11.0, rel=0.06)


@pytest.mark.parametrize("level", [4.0, -3.0])
def test_a_load_near_the_ship_is_seen_where_it_is(level: float) -> None:
    winch = Winch(min_rope_length=1.0)
    centres = []
    for target in (level, level + 2.0):
        env = make(scenario=Scenario(motion=HarmonicMotion(), target_level=target, crane=Crane(winch=winch)))
        env.reset(seed=0)
        centres.append(pixels_of(env.render()[SIDE_VIEW], LOAD).mean(axis=0))
    (low, left), (high, right) = centres
    assert low - high == pytest.approx(2.0 * 11.0, abs=0.6)
    assert right == pytest.approx(left, abs=0.6)
    # The deck's origin is 187 pixels below the view's upper edge.
    assert low == pytest.approx(187.0 - level * 11.0, abs=1.5)


def test_heave_lifts_the_ship() -> None:
    heaves = []
    for amplitude in (0.0, 2.0):
        motion = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=amplitude, period=12.0),))
        env = make(scenario=Scenario(motion=motion))
        env.reset(seed=0)
        frame = frame_after(env, 30)
        # The topmost rows that show the yellow of the frame.
        yellow = (np.abs(frame[SIDE_VIEW].astype(int) - (245, 184, 46)).sum(axis=-1) < 12).nonzero()[0]
        heaves.append(float(yellow.min()))
    assert heaves[0] - heaves[1] == pytest.approx(2.0 * 11.0, abs=2.0)


def test_slack_rope_is_shown_in_red() -> None:
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=6.0, period=4.0),))
    env = make(scenario=Scenario(motion=motion, ramp=10.0))
    _, info = env.reset(seed=0)
    above_water = (slice(90, 240), slice(480, 560))
    for _ in range(100):
        *_, info = env.step(STILL)
        red = len(pixels_of(env.render()[above_water], WARNING)) if info["slack"] else 0
        if info["slack"]:
            break
    assert info["slack"]
    assert red > 50
    env.reset(seed=0)
    assert len(pixels_of(env.render()[above_water], WARNING)) == 0


def test_parted_rope_can_be_drawn() -> None:
    env = make(scenario=Scenario(crane=Crane(rope=Rope(breaking_load=1.0e6))))
    env.reset(seed=0)
    terminated = False
    for _ in range(200):
        _, _, terminated, _, _ = env.step(STILL)
        if terminated:
            break
    assert terminated
    assert len(pixels_of(env.render()[SIDE_VIEW], WARNING)) > 500
    frame_after(env, 300)


@pytest.mark.parametrize("rope", [25.0, 2900.0])
def test_extreme_scenarios_can_be_drawn(rope: float) -> None:
    motion = HarmonicMotion(
        harmonics=(
            Harmonic(coordinate="roll", amplitude=1.0, period=9.0),
            Harmonic(coordinate="heave", amplitude=20.0, period=11.0),
            Harmonic(coordinate="surge", amplitude=50.0, period=13.0),
        )
    )
    scenario = Scenario(motion=motion, target_level=Crane().pulley_position[2] - rope, load_mass=1e3)
    env = make(scenario=scenario, control_period=1.0)
    env.reset(seed=0)
    for action in (4.0, -4.0, 0.0, 4.0):
        assert frame_after(env, 4, action).shape == (640, 960, 3)


def test_scalar_and_vector_frames_are_equal() -> None:
    vector: Any = gymnasium.make_vec(
        "AFrameHeave-v0", num_envs=2, vectorization_mode="vector_entry_point", render_mode="rgb_array"
    )
    assert vector.metadata["render_fps"] == 10.0
    vector.reset(seed=3)
    scalar = make()
    scalar.reset(seed=4)
    for _ in range(20):
        vector.step(np.full((2, 1), 0.3, dtype=np.float32))
    frames = vector.render()
    assert len(frames) == 2
    np.testing.assert_array_equal(frames[1], frame_after(scalar, 20, 0.3))
    assert (frames[0] != frames[1]).any()


def test_render_collection() -> None:
    env = RenderCollection(gymnasium.make("AFrameHeave-v0", render_mode="rgb_array"))
    env.reset(seed=0)
    for _ in range(3):
        env.step(STILL)
    frames = env.render()
    assert len(frames) == 4
    assert (frames[0] != frames[3]).any()


def test_gymnasium_check_with_pictures() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*symmetric and normalized.*")
        check_env(make())


def test_human_mode_shows_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    import pygame

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gymnasium.make("AFrameHeave-v0", render_mode="human", control_period=0.02).unwrapped
    assert env.metadata["render_fps"] == pytest.approx(50.0)
    assert pygame.display.get_surface() is None
    try:
        env.reset(seed=2)
        window = pygame.display.get_surface()
        shown = pygame.surfarray.array3d(window).transpose(1, 0, 2)
        env.step(np.array([2.0], dtype=np.float32))
        now = pygame.surfarray.array3d(window).transpose(1, 0, 2)
        assert (shown != now).any()
        assert env.render() is None
    finally:
        env.close()
    assert pygame.display.get_surface() is None
    env.close()


def test_rgb_array_opens_no_window() -> None:
    import pygame

    env = make()
    env.reset(seed=0)
    env.render()
    assert not pygame.display.get_init()


@pytest.mark.parametrize("frame", [{}, {"height": 40.0}, {"height": 15.0, "luffing_angle": 1.2}])
@pytest.mark.parametrize("amplitude", [0.0, 6.0])
def test_pulley_and_heave_are_in_the_picture_however_large_the_crane(frame: dict[str, float], amplitude: float) -> None:
    heave = Harmonic(coordinate="heave", amplitude=amplitude, period=12.0)
    crane = Crane(frame=Frame(**frame))
    env = make(scenario=Scenario(crane=crane, motion=HarmonicMotion(harmonics=(heave,))))
    env.reset(seed=0)
    shown = frame_after(env, 30)[SIDE_VIEW]
    # At the right edge nothing but the heave's words is written in ink.
    places = pixels_of(shown[:200, -66:], INK)
    assert len(places) > 20
    assert places[:, 0].min() >= 3
    assert places[:, 1].max() < 66 - 3
    if not amplitude:
        yellow = (np.abs(shown.astype(int) - (245, 184, 46)).sum(axis=-1) < 12).nonzero()[0]
        assert yellow.min() > 20


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_draw(clone: Any) -> None:
    env = make()
    env.reset(seed=6)
    env.render()
    frame_after(env, 20)
    other = clone(env)
    np.testing.assert_array_equal(other.render()[SIDE_VIEW], env.render()[SIDE_VIEW])
    frames = frame_after(env, 2), frame_after(other, 2)
    np.testing.assert_array_equal(frames[0][SIDE_VIEW], frames[1][SIDE_VIEW])
    assert (frames[0][CHART] != frames[1][CHART]).any()


def test_render_before_reset_and_without_a_mode() -> None:
    with pytest.raises(gymnasium.error.ResetNeeded):
        make().render()
    env = gymnasium.make("AFrameHeave-v0").unwrapped
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render mode"):
        assert env.render() is None


def test_wrong_render_modes() -> None:
    from aframe_env.env import AFrameHeaveEnv
    from aframe_env.vector_env import AFrameHeaveVectorEnv

    with pytest.raises(InvalidValue, match=r"render_mode = 'ansi': must be one of 'human', 'rgb_array'"):
        AFrameHeaveEnv(render_mode="ansi")
    with pytest.raises(InvalidValue, match=r"render_mode = 'human': must be one of 'rgb_array'"):
        AFrameHeaveVectorEnv(2, render_mode="human")


def test_the_chart_begins_with_the_first_picture() -> None:
    """What nobody looks at is not recorded."""
    late, early = make(), make()
    for env in (late, early):
        env.reset(seed=6)
    early.render()
    frames = frame_after(late, 100), frame_after(early, 100)
    np.testing.assert_array_equal(frames[0][SIDE_VIEW], frames[1][SIDE_VIEW])
    columns = (frames[0][CHART] != frames[1][CHART]).any(axis=(0, 2))
    assert columns.sum() > 100


LEARNER = """
import sys

sys.modules["pygame"] = None
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

model = PPO("MlpPolicy", "aframe_env:AFrameHeave-v0", n_steps=64, batch_size=64, n_epochs=1, device="cpu")
assert model.get_env().render_mode == "rgb_array"
model.learn(64)
envs = make_vec_env("AFrameHeave-v0", n_envs=2)
envs.reset()
envs.step([envs.action_space.low] * 2)
try:
    envs.get_images()
except Exception as error:
    print(error)
"""


def test_learners_that_ask_for_pictures_they_never_look_at_need_no_pygame() -> None:
    done = subprocess.run([sys.executable, "-c", LEARNER], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == 'pygame is not installed: pip install "aframe-heave[render]"'


@pytest.mark.parametrize("mode", ["human", "rgb_array"])
def test_missing_pygame_names_the_extra_at_the_first_picture(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    env = gymnasium.make("AFrameHeave-v0", render_mode=mode)
    if mode == "rgb_array":
        env.reset(seed=0)
    with pytest.raises(gymnasium.error.DependencyNotInstalled, match=r'pip install "aframe-heave\[render\]"'):
        env.reset(seed=0) if mode == "human" else env.render()
    vector = gymnasium.make_vec("AFrameHeave-v0", num_envs=2, render_mode="rgb_array")
    vector.reset(seed=0)
    vector.step(np.zeros((2, 1), dtype=np.float32))
    with pytest.raises(gymnasium.error.DependencyNotInstalled, match=r'pip install "aframe-heave\[render\]"'):
        vector.render()
