"""The preview of the heave: its error against the closed form, and whom it tells what."""

from __future__ import annotations

from dataclasses import replace

import gymnasium
import numpy as np
import numpy.typing as npt
import pytest

from aframe_env import (
    Harmonic,
    HarmonicMotion,
    InvalidValue,
    Luffing,
    Preview,
    RecordedMotion,
    Scenario,
    ScenarioDistribution,
    Sea,
    SeaMotion,
    Sensors,
    TaskConfig,
    find_task,
)
from aframe_env.env import AFrameHeaveEnv
from aframe_env.scenario.preview import PreviewBank
from aframe_env.simulation import Simulation
from aframe_env.task import PULLEY_HEAVE, SENSED, quantities

FloatArray = npt.NDArray[np.float64]
FIRST = len(SENSED)
STILL = np.zeros(1, dtype=np.float32)
TRUE = Sensors(preview=Preview(frequency_error=0.0))


def heaves(scenario: Scenario, steps: int) -> FloatArray:
    """Pulley's heave as the engine has it, (steps + 1,) m."""
    env = AFrameHeaveEnv(scenario=scenario, episode_duration=1e3)
    env.reset(seed=0)
    found = [env.simulation.state[0, PULLEY_HEAVE]]
    for _ in range(steps):
        env.step(STILL)
        found.append(env.simulation.state[0, PULLEY_HEAVE])
    return np.array(found)


ROUGH = SeaMotion(sea=Sea(hs=5.0, tp=9.0, heading=2.2, seed=3))
SWAYED = HarmonicMotion(
    harmonics=(
        Harmonic(coordinate="heave", amplitude=2.0, period=8.0, phase=0.3),
        Harmonic(coordinate="pitch", amplitude=0.2, period=11.0),
        Harmonic(coordinate="roll", amplitude=0.3, period=9.0, phase=1.0),
    )
)


@pytest.mark.parametrize("motion", [ROUGH, SWAYED], ids=["sea", "harmonics"])
def test_a_radar_without_error_foretells_the_pulleys_real_path(motion: SeaMotion | HarmonicMotion) -> None:
    """Large angles and the building up of the motion included: it is the path that the engine takes."""
    scenario = Scenario(motion=motion, ramp=10.0)
    true = heaves(scenario, 250)
    env = AFrameHeaveEnv(scenario=scenario, observation=TRUE)
    told = [env.reset(seed=0)[0][FIRST:]]
    told += [env.step(STILL)[0][FIRST:] for _ in range(100)]
    assert abs(true).max() > 1.0
    for step in range(101):
        np.testing.assert_allclose(told[step], true[step + 5 : step + 151 : 5], atol=2e-5)


def test_the_error_grows_with_the_lead_as_the_closed_form_says() -> None:
    """Σ A² (1 - exp(-(σ ω τ)²/2)) for frequencies that are off by σ, over many draws of a single sea."""
    scenario, rows, sigma = Scenario(motion=ROUGH), 4000, 0.05
    preview = Preview(frequency_error=sigma, horizon=20.0, interval=2.0)
    bank, true = PreviewBank(preview, rows, 0.1), PreviewBank(replace(preview, frequency_error=0.0), 1, 0.1)
    true.start_row(0, scenario, 0)
    for row in range(rows):
        bank.start_row(row, scenario, row)
    components, (x, y, _) = ROUGH.components(), scenario.crane.pulley_position
    heave, roll, pitch = components.response[:, 2:5].T
    amplitude = abs(heave + y * roll - x * pitch)
    off = sigma * np.outer(preview.leads, components.frequency)
    expected = (amplitude**2 * (1.0 - np.exp(-0.5 * off**2))).sum(axis=1)
    # Averaged over times, too: at a single one the variance goes with the waves' phases.
    times = range(0, 6000, 37)
    squares = [np.square(bank.at(np.full(rows, t)) - true.at(np.array([t]))).mean(axis=0) for t in times]
    np.testing.assert_allclose(np.mean(squares, axis=0), expected, rtol=0.06)


def test_the_error_is_none_at_once_and_as_large_as_it_is_said_to_be_in_the_task() -> None:
    task = find_task("Preview")
    scenarios, preview = task.scenarios("train", 100), task.distribution.sensors.preview
    assert preview is not None
    soon = replace(preview, horizon=0.01, interval=0.01)
    ratio = {}
    for name, kind in (("soon", soon), ("all", preview)):
        bank = PreviewBank(kind, 100, 0.1)
        true = PreviewBank(replace(kind, frequency_error=0.0), 100, 0.1)
        for row, scenario in enumerate(scenarios):
            bank.start_row(row, scenario, row)
            true.start_row(row, scenario, row)
        told, real = (np.array([each.at(np.full(100, t)) for t in range(100, 600, 13)]) for each in (bank, true))
        ratio[name] = np.sqrt(np.square(told - real).mean(axis=(0, 1)) / np.square(real).mean(axis=(0, 1)))
    assert ratio["soon"][0] < 1e-3
    assert ratio["all"][9] == pytest.approx(0.114, rel=0.08)
    assert ratio["all"][29] == pytest.approx(0.339, rel=0.08)
    assert (np.diff(ratio["all"]) > 0.0).all()


def test_noise_is_white_and_of_its_deviation() -> None:
    rest = Scenario(motion=HarmonicMotion())
    bank = PreviewBank(Preview(noise=0.2), 1, 0.1)
    bank.start_row(0, rest, 5)
    told = np.array([bank.at(np.array([step]))[0] for step in range(2000)])
    assert told.std() == pytest.approx(0.2, rel=0.02)
    beside = (told[1:] * told[:-1], told[:, 1:] * told[:, :-1])
    assert max(abs(each.mean()) for each in beside) < 0.2**2 * 0.02


def test_rows_are_told_what_each_would_be_alone() -> None:
    """Whatever the number of waves of the others, and after a row has begun anew."""
    preview = Preview(noise=0.1)
    scenarios = [Scenario(motion=replace(ROUGH, sea=replace(ROUGH.sea, components=n))) for n in (5, 64, 32)]
    bank = PreviewBank(preview, 3, 0.1)
    for row, scenario in enumerate(reversed(scenarios)):
        bank.start_row(row, scenario, 99)
    for row, scenario in enumerate(scenarios):
        bank.start_row(row, scenario, row)
    steps = np.array([3, 200, 51])
    for row, scenario in enumerate(scenarios):
        alone = PreviewBank(preview, 1, 0.1)
        alone.start_row(0, scenario, row)
        assert np.array_equal(bank.at(steps)[row], alone.at(steps[row : row + 1])[0])


def test_a_seed_makes_the_preview_and_a_state_has_it() -> None:
    env = gymnasium.make("AFrameHeave-Preview-v0").unwrapped
    assert isinstance(env, AFrameHeaveEnv)
    first = env.reset(seed=1)[0]
    env.step(STILL)
    state = env.get_state()
    after = [env.step(STILL)[0] for _ in range(3)]
    other = env.reset(seed=2)[0]
    env.set_state(state)
    assert np.array_equal([env.step(STILL)[0] for _ in range(3)], after)
    assert np.array_equal(env.reset(seed=1)[0], first)
    assert not np.array_equal(first[FIRST:], other[FIRST:])
    # The errors are an episode's own: another seed of the noise in the same sea.
    scenario, steps = env.scenario, np.array([0, 0])
    bank = PreviewBank(Preview(), 2, 0.1)
    bank.start_row(0, scenario, 1)
    bank.start_row(1, scenario, 2)
    assert not np.array_equal(*bank.at(steps))


def test_readings_are_what_they_are_without_a_preview() -> None:
    seas = ScenarioDistribution(hs=(2.0, 4.0))
    plain, with_radar = (AFrameHeaveEnv(scenario=seas, observation=s) for s in (Sensors(), Sensors(preview=Preview())))
    pairs = [(plain.reset(seed=4)[0], with_radar.reset(seed=4)[0])]
    pairs += [(plain.step(STILL)[0], with_radar.step(STILL)[0]) for _ in range(20)]
    for one, other in pairs:
        assert other.shape == (FIRST + 30,)
        assert np.array_equal(one, other[:FIRST])


def test_columns_are_named_by_their_leads() -> None:
    config = TaskConfig(observation=Sensors(preview=Preview(horizon=2.0, interval=0.8 - 0.3)))
    names = [quantity.name for quantity in config.quantities[FIRST:]]
    assert names == [f"pulley_heave_in_{lead}_s" for lead in ("0.5", "1", "1.5", "2")]
    assert quantities(Sensors()) == SENSED
    space = Simulation(1, config).observation_space
    assert (space.low[FIRST:] == -100.0).all()
    assert (space.high[FIRST:] == 100.0).all()


def test_what_cannot_be_foretold_is_refused() -> None:
    times = np.arange(0.0, 100.0, 0.5)
    record = RecordedMotion(times=times, coordinates=np.sin(times)[:, None] * np.eye(1, 6, k=2))
    angle = Scenario().crane.frame.luffing_angle
    luffing = Luffing.swing(angle, angle + 0.2, 1.0, 30.0)
    for scenario, words in (
        (Scenario(motion=record), "preview: the scenario follows a recorded motion: must be a sea or harmonics"),
        (Scenario(luffing=luffing), "preview: the frame luffs: must stand still"),
    ):
        with pytest.raises(InvalidValue, match=words):
            AFrameHeaveEnv(scenario=scenario, observation=TRUE).reset(seed=0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"horizon": 0.0}, r"horizon = 0.0 s: must be in \[0.01, 600\]"),
        ({"interval": -1.0}, "interval = -1.0 s"),
        ({"frequency_error": 1.5}, "frequency_error = 1.5 of the frequency"),
        ({"noise": -0.1}, "noise = -0.1 m"),
        ({"horizon": 15.2}, "horizon = 15.2 s: must be 1 to 1000 whole intervals of 0.5 s"),
        ({"interval": 0.01, "horizon": 20.0}, "horizon = 20 s: must be 1 to 1000 whole intervals of 0.01 s"),
    ],
)
def test_a_preview_that_is_none_is_refused(change: dict[str, float], words: str) -> None:
    with pytest.raises(InvalidValue, match=words):
        Preview(**change)
