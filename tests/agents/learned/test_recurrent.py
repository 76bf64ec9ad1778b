import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from aframe_env import Crane, InvalidValue, MotionUnit, ScenarioDistribution, TaskConfig, Winch, task
from aframe_env.scenario.sensors import Sensors
from aframe_env.scenario.series import drawn_scenarios
from aframe_env.simulation import Simulation
from aframe_env.suite import find_task
from agents import cards
from agents.control.expected_waves import ExpectedWaves
from agents.control.winch import WinchModel
from agents.learned.agent import digest
from agents.learned.recurrent import CARD, WEIGHTS, RecurrentCard, RecurrentPolicy, card_text, load, serialise
from agents.learned.recurrent_features import RecurrentFeatures
from agents.learned.recurrent_inputs import FORECASTS, RATES_AHEAD, RISES_AHEAD, Lookout, LookoutConfig
from agents.learned.recurrent_network import change_for, change_in_lag, clip_one_sided
from agents.policy import Knowledge
from agents.registry import choose_all
from agents.rollout import held_out_scenarios, run

WAVES = ExpectedWaves(frequency=(0.5, 0.7, 0.9, 1.2), variances=((0.05, 0.1, 0.1, 0.05),), build_up=5.0)
SEAS = ScenarioDistribution(max_rope_speed=(1.5, 2.5), max_rope_acceleration=(1.0, 2.0))


def agent(observation="sensors", seed=1):
    sensors = None if observation == "state" else Sensors()
    card = RecurrentCard(
        algorithm="recurrent APG",
        observation=observation,
        sensors=sensors,
        waves=WAVES,
        memory=8,
        hidden=16,
        control_period=0.1,
        task="AFrameHeave-Storm-v0",
        seed=seed,
        versions={"torch": "2"},
        sha256="",
    )
    torch.manual_seed(seed)
    network = card.network()
    with torch.no_grad():
        for parameter in network.parameters():  # far from the regulator that a fresh one is
            parameter.add_(0.2 * torch.randn_like(parameter))
    weights = serialise(network)
    card = RecurrentCard(**{**vars(card), "sha256": digest(weights)})
    return RecurrentPolicy(network, card), weights


def write(folder, policy, weights, **changes):
    folder.mkdir(exist_ok=True)
    (folder / WEIGHTS).write_bytes(weights)
    card = json.loads(card_text(policy.card))
    del card[cards.DIGEST]
    (folder / CARD).write_text(json.dumps(cards.sealed({**card, **changes})))


def play(policy, scenarios, **arguments):
    observation = "state" if policy.knows is Knowledge.STATE else "sensors"
    return run(policy, scenarios, episode_duration=4.0, observation=observation, **arguments)


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_an_agent_comes_back_from_its_folder_to_the_bit(observation, tmp_path):
    policy, weights = agent(observation)
    write(tmp_path, policy, weights)
    again = load(tmp_path)
    assert again.card == policy.card
    assert (again.name, again.knows) == (policy.name, policy.knows)
    assert serialise(again.network) == weights
    scenarios = held_out_scenarios(SEAS, 3)
    one, other = play(policy, scenarios), play(again, scenarios)
    assert np.array_equal(one.drum_speed, other.drum_speed)
    assert np.ptp(one.drum_speed) > 0.1


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_a_row_does_not_depend_on_the_others(observation):
    policy, _ = agent(observation)
    scenarios = held_out_scenarios(SEAS, 70)  # more than a block
    many = play(policy, scenarios)
    for row in (0, 37, 66):
        alone = play(policy, scenarios[row : row + 1], first=row)
        assert np.array_equal(alone.drum_speed[0], many.drum_speed[row])


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_inputs_of_rows_that_start_anew_are_those_of_a_fresh_start(observation):
    policy, _ = agent(observation)
    scenarios = held_out_scenarios(SEAS, 5)
    simulation = Simulation(5, TaskConfig(scenario=SEAS, observation=observation))
    simulation.reset_rows(np.arange(5), [(scenario, 7) for scenario in scenarios])
    many = RecurrentFeatures(5, policy.card.made_for, policy.network)
    inputs = many.start(simulation.observe(), scenarios)
    for _ in range(12):
        simulation.advance(many.command(np.full(5, 0.2)))
        inputs = many.advance(simulation.observe())
    rows, fresh = np.array([1, 4]), RecurrentFeatures(2, policy.card.made_for, policy.network)
    simulation.reset_rows(rows, [(scenarios[0], 8), (scenarios[2], 9)])
    seen, lifts = simulation.observe()[rows], [scenarios[0], scenarios[2]]
    inputs[rows] = many.start(seen, lifts, rows)
    other = fresh.start(seen, lifts)
    for _ in range(12):
        assert np.array_equal(inputs[rows], other)
        output = 3.0 * inputs[:, 0].astype(float)
        command = many.command(output)
        assert np.array_equal(command[rows], fresh.command(output[rows]))
        simulation.advance(command)
        inputs, other = many.advance(simulation.observe()), fresh.advance(simulation.observe()[rows])


def test_a_new_episode_begins_with_a_fresh_memory():
    policy, _ = agent()
    scenarios = held_out_scenarios(SEAS, 2)
    assert np.array_equal(play(policy, scenarios).drum_speed, play(policy, scenarios).drum_speed)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sha256": "0" * 64}, "does not match the sha256"),
        ({"format": 99}, "format = 99"),
        ({"hidden": 17}, "not the weights of the network"),
        ({"memory": "many"}, "memory"),
    ],
)
def test_files_that_do_not_belong_together_are_refused(changes, words, tmp_path):
    write(tmp_path, *agent(), **changes)
    with pytest.raises(InvalidValue, match=words):
        load(tmp_path)


def test_an_altered_card_and_missing_weights_are_refused(tmp_path):
    policy, weights = agent()
    write(tmp_path, policy, weights)
    (tmp_path / CARD).write_text((tmp_path / CARD).read_text().replace("Storm", "Calm"))
    with pytest.raises(InvalidValue, match="does not match its own digest"):
        load(tmp_path)
    write(tmp_path, policy, weights)
    (tmp_path / WEIGHTS).unlink()
    with pytest.raises(InvalidValue, match="no agent in"):
        load(tmp_path)


def test_weights_that_are_no_numbers_and_another_period_are_refused():
    policy, _ = agent()
    with pytest.raises(InvalidValue, match=r"trained for 0\.1 s"):
        policy.reset(held_out_scenarios(SEAS, 1), 0.2)
    with torch.no_grad():
        policy.network.last.bias[0] = torch.nan
    with pytest.raises(InvalidValue, match="not finite"):
        serialise(policy.network)
    with pytest.raises(InvalidValue, match="not finite"):
        play(policy, held_out_scenarios(SEAS, 1))


def test_the_comparison_finds_it_by_its_folder_and_by_that_of_its_seeds(tmp_path):
    for seed in (3, 12):
        write(tmp_path / f"seed-{seed}", *agent(seed=seed))
    one, other = choose_all([str(tmp_path)])
    assert one.name.startswith("recurrent APG on sensors")
    assert (one.control_period, other.control_period) == (0.1, 0.1)
    assert one.digest != other.digest
    (alone,) = choose_all([str(tmp_path / "seed-12")])
    assert alone.digest == other.digest


def test_a_share_asks_the_winch_for_that_much_more_speed():
    scenario = held_out_scenarios(SEAS, 1)[0]
    lookout = Lookout(3, LookoutConfig(waves=WAVES))
    seen = np.zeros((3, 14), dtype=np.float32)
    seen[:, 11:] = 5e5, 5e4, 500.0  # tension, mass, length
    lookout.start(seen, [scenario] * 3)
    winch = scenario.crane.winch
    command = lookout.command(np.array([0.5, -7.0, 0.0]))
    assert command == pytest.approx(np.array([0.5, -1.0, 0.0]) * 0.1 * winch.max_acceleration)
    assert lookout.most_change[0] == pytest.approx(0.1 * winch.max_rope_acceleration)
    assert lookout.most_speed[0] == pytest.approx(winch.max_rope_speed)


def test_the_change_for_a_mean_speed_is_what_the_winch_model_makes_of_it():
    # The mean speed over a step of a winch that is told its new speed, by the dynamics' own kernel.
    share = np.linspace(-0.79, 0.79, 21)
    winch = WinchModel(len(share), 0.1)
    winch.start([Crane(winch=Winch(lag=0.0))] * len(share))
    most = 0.1 * winch.max_acceleration
    mean = winch.turn(share * most) / 0.1 / most
    assert change_for(torch.from_numpy(mean)).numpy() == pytest.approx(share, abs=1e-9)


def test_the_command_for_a_change_in_lag_is_what_the_winch_model_answers_with_it():
    """As good as exact while the drum does not ramp, and to an eighth while it does for a part of the step."""
    for lag in (0.02, 0.1, 0.15, 0.3):
        share = np.linspace(-1.0, 1.0, 41)
        winch = WinchModel(len(share), 0.1)
        winch.start([Crane(winch=Winch(lag=lag))] * len(share))
        most = 0.1 * winch.max_acceleration
        winch.turn(share * (1.0 + lag / 0.1) * most)
        steps = torch.full((len(share),), lag / 0.1).double()
        error = abs(change_in_lag(torch.from_numpy(winch.speed / most), steps).numpy() - share)
        assert error[abs(share) < lag / (0.1 + lag)].max() < 1e-9
        assert error.max() < 0.125


def test_it_looks_as_much_further_ahead_as_drum_and_readings_are_late():
    """Nobody told: the readings of the drum alone show what is late."""
    unknown = find_task("Unknown")
    scenarios = unknown.scenarios("train", 16)
    config = TaskConfig(**unknown.arguments)
    made_for = LookoutConfig.of(config)
    assert made_for.adapts
    assert made_for.readings[-1] == "lateness"
    simulation = Simulation(16, config.replaced(scenario=scenarios[0], observation=config.sensors))
    simulation.reset_rows(np.arange(16), [(scenario, 0) for scenario in scenarios])
    lookouts = [Lookout(16, made_for), Lookout(16, replace(made_for, adapts=False))]
    foretold, speed = [], []
    for step in range(500):
        seen = simulation.observe()
        told = [scenario.as_told for scenario in scenarios]
        looks = [each.advance(seen) if step else each.start(seen, told) for each in lookouts]
        foretold.append([each.series[:, RATES_AHEAD.index(0.3)] for each in looks])
        speed.append(simulation.state[:, task.PULLEY_VELOCITY_Z].copy())
        command = np.clip((looks[0].rise - looks[0].speed) / lookouts[0].most_change, -1.0, 1.0)
        commands = lookouts[0].command(command)
        assert lookouts[1].follow(commands) is commands
        simulation.advance(commands)
    late = np.array([scenario.crane.winch.lag - 0.15 + scenario.sensor_delay - 0.2 for scenario in scenarios])
    assert looks[0].series[:, FORECASTS + 4] / 5.0 == pytest.approx(late, abs=0.06)
    # What the drum is to do in 0.3 s as told, it has to be told as much earlier as its winch is later than told.
    begin = 0.1 * np.arange(500)
    wanted = 0.3 + np.array([scenario.crane.winch.lag - 0.15 for scenario in scenarios])
    there = np.array([np.interp(begin + w, begin, v) for w, v in zip(wanted, np.transpose(speed), strict=True)])
    missed = np.std(np.array(foretold)[150:480] - there.T[150:480, None], axis=0)
    # In seas that are not so calm that noise is a good part of what is missed.
    mistimed = (abs(late) > 0.05) & (np.std(there, axis=1) > 0.2)
    assert mistimed.sum() >= 4
    assert (missed[0] < 0.8 * missed[1])[mistimed].all()


def test_it_adapts_on_sensors_alone():
    with pytest.raises(InvalidValue, match="adapts = True"):
        LookoutConfig(waves=WAVES, adapts=True)


def test_beyond_a_limit_only_gradients_that_lead_back_come_through():
    value = torch.tensor([0.5, 2.0, 2.0, -2.0, -2.0], requires_grad=True)
    clipped = clip_one_sided(value, torch.ones(5))
    assert clipped.tolist() == [0.5, 1.0, 1.0, -1.0, -1.0]
    clipped.backward(torch.tensor([-1.0, 1.0, -1.0, 1.0, -1.0]))
    assert value.grad.tolist() == [-1.0, 1.0, 0.0, 0.0, -1.0]


def test_forecasts_are_of_the_moments_that_they_are_said_to_be():
    """With readings that are late by two control steps: a step earlier or later they would fit worse in every sea."""
    sensors = replace(Sensors(), delay=0.2)
    seas = replace(SEAS, hs=(2.0, 4.0))  # not so calm that noise is a good part of the motion
    scenarios = held_out_scenarios(seas, 4)
    config = LookoutConfig(sensors=sensors, waves=ExpectedWaves.of(seas))
    simulation = Simulation(4, TaskConfig(scenario=scenarios[0], observation=sensors, episode_duration=60.0))
    simulation.reset_rows(np.arange(4), [(scenario, 0) for scenario in scenarios])
    lookout = Lookout(4, config)
    speed, heave, outlooks = [], [], []
    for step in range(600):
        seen = simulation.observe()
        outlooks.append(lookout.advance(seen) if step else lookout.start(seen, scenarios))
        speed.append(simulation.state[:, task.PULLEY_VELOCITY_Z].copy())
        heave.append(simulation.state[:, task.PULLEY_HEAVE].copy())
        simulation.advance(lookout.command(np.full(4, 0.3 * np.sin(0.2 * step))))
    series = np.array([each.series for each in outlooks])
    speed, heave = np.array(speed), np.array(heave)
    rate, rise = series[:, :, RATES_AHEAD.index(0.3)], series[:, :, len(RATES_AHEAD) + RISES_AHEAD.index(1.0)]
    steps = np.arange(200, 560)

    def missed(foretold, true, later):
        """Root mean square of what is missed in each sea, as a share of the motion's, were it of a moment later."""
        return np.std(foretold[steps] - true(steps + later), axis=0) / np.std(true(steps), axis=0)

    soon = np.array([each.rise for each in outlooks])
    for foretold, true, most in (
        (rate, lambda at: speed[at + 3], 0.15),
        (rise, lambda at: heave[at + 10] - heave[at], 0.15),
        (soon, lambda at: (heave[at + 1] - heave[at]) / 0.1, 0.1),
    ):
        now = missed(foretold, true, 0)
        assert now.max() < most
        assert (now < missed(foretold, true, -1)).all()
        assert (now < missed(foretold, true, 1)).all()


def test_other_ropes_retune_it():
    scenarios = held_out_scenarios(SEAS, 2)
    seen = np.zeros((2, 14), dtype=np.float32)
    seen[:, 11:] = 5e5, 5e4, 500.0  # tension, mass, length
    lookout, longer = Lookout(2, LookoutConfig(waves=WAVES)), Lookout(2, LookoutConfig(waves=WAVES))
    lookout.start(seen, scenarios)
    before = lookout.gains.copy()
    lookout.retune(np.full(2, 800.0), np.zeros(2), np.ones(2))
    seen[:, 13] = 800.0
    longer.start(seen, scenarios)
    assert lookout.gains == pytest.approx(longer.gains)
    assert lookout.figures == pytest.approx(longer.figures, abs=1e-6)
    assert abs(lookout.gains - before).max() > 1e-3


def seen_of_the_unit(unit):
    """Whether the unit is heard, and what the depth says against it, in 20 s with the drum still, (200, 6) each."""
    mru = find_task("MRU")
    sensors = replace(mru.distribution.sensors, motion_unit=unit)
    config = TaskConfig(scenario=replace(mru.distribution, sensors=sensors, sensor_delay=None), observation="sensors")
    scenarios = drawn_scenarios(config.source, 3, 6)
    simulation = Simulation(6, config)
    simulation.reset_rows(np.arange(6), [(scenario, i) for i, scenario in enumerate(scenarios)])
    made_for = LookoutConfig.of(config)
    lookout, at = Lookout(6, made_for), FORECASTS + made_for.readings.index("heard")
    lookout.start(simulation.observe(), scenarios)
    series, rates = [], [simulation.observe()[:, 0]]
    for _ in range(200):
        simulation.advance(lookout.follow(np.zeros(6)))
        series.append(lookout.advance(simulation.observe()).series[:, at : at + 2])
        rates.append(simulation.observe()[:, 0])
    heard, missed = np.moveaxis(series, 2, 0)
    assert np.array_equal(heard == 1.0, np.diff(rates, axis=0) != 0.0)
    return heard, missed


def test_it_sees_dropouts_and_what_the_depth_says_against_the_unit():
    whole = MotionUnit(heave_period=20.0, heave_damping=0.707)
    heard, missed = seen_of_the_unit(whole)
    assert heard.all()
    heard, _ = seen_of_the_unit(replace(whole, dropouts=6.0, dropout_time=2.0))
    assert 0.05 < 1.0 - heard.mean() < 0.4
    _, misled = seen_of_the_unit(replace(whole, lever_arm_error=10.0))
    assert np.sqrt(np.mean(misled**2)) > 1.5 * np.sqrt(np.mean(missed**2))
