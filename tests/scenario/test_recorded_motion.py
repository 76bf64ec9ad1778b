import math

import numpy as np
import pytest
import scipy

from aframe_env import InvalidValue, RecordedMotion, RecordedWindow, RecordNoiseWarning, Scenario
from aframe_env.env import AFrameHeaveEnv
from aframe_env.rfem.deck import deck_coordinates
from aframe_env.scenario.motion import Components

HEADER = "time_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg"
FREQUENCY = np.array([0.4, 0.7, 1.1])
AMPLITUDES = np.array([1.0, 0.5, 0.2])


def components() -> Components:
    rng = np.random.default_rng(5)
    response = AMPLITUDES[:, None] * np.exp(1j * rng.uniform(0, 2 * np.pi, (3, 6)))
    response[:, 3:] *= 0.1
    return Components(FREQUENCY, response)


def lines(duration=70.0, step=0.25, first=12.0):
    times = np.arange(0.0, duration + step / 2, step)
    table = components().at(times)[0]
    table[:, 3:] = np.degrees(table[:, 3:])
    return [
        HEADER,
        *(",".join(f"{v:.12g}" for v in (first + t, *row)) for t, row in zip(times, table, strict=True)),
    ]


def write(path, content):
    path.write_text("\n".join(content) + "\n", encoding="utf-8")
    return path


def test_csv_follows_the_motion_that_it_samples(tmp_path):
    text = lines()
    text.insert(0, "# a comment before the header")
    text.insert(10, "# and one within")
    motion = RecordedMotion.from_csv(write(tmp_path / "m.csv", text))
    assert motion.duration == pytest.approx(70.0, abs=1e-9)
    table = motion.table(0.1)
    assert table.shape == (701, 18)
    truth = components().at(np.arange(701) * 0.1)
    got = table.reshape(701, 3, 6).transpose(1, 0, 2)
    # The documented A (ωT)⁶/14000, and a factor 1/T more for each derivative; the ends are left out.
    inner = slice(30, -30)
    bound = np.sum(AMPLITUDES * (FREQUENCY * 0.25) ** 6) / 14000
    for order in range(3):
        worst = np.abs(got[order, inner] - truth[order, inner]).max()
        assert worst < bound * (2 * math.pi / 0.25) ** order + 1e-10, order
    assert np.abs(got[0] - truth[0]).max() < 2e-4  # the ends too


def test_documented_accuracy_of_the_spline():
    for per_period, stated in ((8, 2e-5), (17, 2e-7)):
        step = 2 * math.pi / per_period
        times = np.arange(0.0, 100.0, step)
        coordinates = np.repeat(np.sin(times)[:, None], 6, axis=1) * 0.5
        motion = RecordedMotion(times=times, coordinates=coordinates)
        fine = np.arange(20.0, 80.0, 0.01)
        error = np.abs(motion.at(fine)[0][:, 0] - 0.5 * np.sin(fine)).max() / 0.5
        assert stated / 3 < error < 1.2 * stated


def test_units_and_column_order(tmp_path):
    si = RecordedMotion.from_csv(write(tmp_path / "si.csv", lines()))
    out = ["yaw_rad,heave_cm,surge_ft,sway_mm,pitch_rad,roll_rad,time_ms"]
    for t, row in zip(si.times, si.coordinates, strict=True):
        x, y, z, r, p, w = row
        out.append(
            f"{w!r},{z * 100!r},{x / 0.3048!r},{y * 1000!r},{p!r},{r!r},{t * 1000!r}".replace(
                "np.float64(", ""
            ).replace(")", "")
        )
    other = RecordedMotion.from_csv(write(tmp_path / "other.csv", out))
    np.testing.assert_allclose(other.coordinates, si.coordinates, atol=1e-12)
    np.testing.assert_allclose(other.times, si.times, atol=1e-9)


def test_heading_that_wraps_is_unwrapped():
    times = np.arange(0.0, 60.0, 0.5)
    yaw = 3.1 + 0.3 * np.sin(0.5 * times)
    coordinates = np.zeros((len(times), 6))
    coordinates[:, 5] = (yaw + np.pi) % (2 * np.pi) - np.pi
    motion = RecordedMotion(times=times, coordinates=coordinates)
    assert np.abs(motion.table(0.1)[:, 11]).max() < 0.16  # the rate, with no spike


def replaced(index, cell, value):
    text = lines()
    cells = text[index].split(",")
    cells[cell] = value
    text[index] = ",".join(cells)
    return text


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (lines()[:40] + lines()[42:], 41, "gap"),
        (replaced(20, 3, "nan"), 21, "heave"),
        (replaced(20, 4, "inf"), 21, "roll"),
        (replaced(20, 0, "nan"), 21, "time"),
        (replaced(20, 0, "3.0"), 21, "must increase"),
        (replaced(20, 2, "abc"), 21, "'abc' is not a number"),
        (replaced(20, 2, ""), 21, "not a number"),
        (lines()[:9], 9, "8 samples: must be at least 12"),
        (lines()[:1], None, "0 samples"),
        (lines()[1:], 1, "column"),
        (["time_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg", *lines()[1:]], 1, "'yaw' is missing"),
        ([HEADER.replace("heave_m", "heave_furlong"), *lines()[1:]], 1, "must be one of m, cm, mm, ft"),
        ([HEADER.replace("heave_m", "sway_m"), *lines()[1:]], 1, "twice"),
        ([*lines()[:30], lines()[30] + ",7", *lines()[31:]], 31, "8 columns: must be 7"),
        ([], None, "no header"),
    ],
)  # fmt: skip
def test_bad_file_is_named_with_its_line(tmp_path, text, line, words):
    path = write(tmp_path / "bad.csv", text)
    with pytest.raises(InvalidValue) as caught:
        RecordedMotion.from_csv(path)
    message = str(caught.value)
    assert str(path) in message
    assert words in message
    if line is not None:
        assert f"line {line}:" in message


def test_unreadable_files(tmp_path):
    with pytest.raises(InvalidValue, match="cannot be read"):
        RecordedMotion.from_csv(tmp_path / "absent.csv")
    path = tmp_path / "binary.csv"
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InvalidValue, match="UTF-8"):
        RecordedMotion.from_csv(path)


def test_arrays_of_wrong_shape():
    with pytest.raises(InvalidValue, match=r"must be \(T,\) and \(T, 6\)"):
        RecordedMotion(times=np.arange(20.0), coordinates=np.zeros((20, 5)))


def test_an_episode_longer_than_the_record_is_refused(tmp_path):
    motion = RecordedMotion.from_csv(write(tmp_path / "m.csv", lines()))
    scenario = Scenario(motion=motion)
    with pytest.raises(InvalidValue, match=r"episode_duration = 71 s: must be in \(0, 70\] s.*m.csv"):
        AFrameHeaveEnv(scenario=scenario, episode_duration=71.0).reset(seed=0)
    env = AFrameHeaveEnv(scenario=scenario, episode_duration=70.0)
    env.reset(seed=0)
    for _ in range(700):
        truncated = env.step(np.zeros(1, dtype=np.float32))[3]
    assert truncated
    with pytest.raises(InvalidValue, match="episode_duration"):
        AFrameHeaveEnv(episode_duration=71.0).reset(options={"scenario": scenario})


def test_engine_follows_the_record_as_the_components(tmp_path):
    """A load under a recorded motion goes where it goes under the motion that was recorded."""

    class Exact:
        def components(self):
            return components()

    step = 0.05
    times = np.arange(0.0, 30.0 + step / 2, step)
    record = RecordedMotion(times=times, coordinates=components().at(times)[0])
    ends = []
    for motion in (record, Exact()):
        env = AFrameHeaveEnv(scenario=Scenario(motion=motion), episode_duration=30.0)
        env.reset(seed=0)
        for _ in range(300):
            info = env.step(np.full(1, 0.3, dtype=np.float32))[4]
        ends.append(info["load_position"])
    assert np.abs(ends[0] - ends[1]).max() < 1e-6


def test_a_window_may_end_with_the_record():
    times = np.arange(0.0, 60.0, 0.1)
    record = RecordedMotion(times=times, coordinates=np.zeros((600, 6)))
    for start in np.random.default_rng(0).uniform(0.0, 59.0, 200):
        window = RecordedWindow(record=record, start=start, duration=record.duration - start)
        assert len(window.table(0.1)) == math.floor(window.duration / 0.1 + 1e-6) + 1


def test_a_window_beyond_the_record_is_refused():
    record = RecordedMotion(times=np.arange(600) * 0.1, coordinates=np.zeros((600, 6)))
    with pytest.raises(InvalidValue, match=r"start = 65 s: must be in \[0, 59.9\] s"):
        RecordedWindow(record=record, start=65, duration=1.0)
    with pytest.raises(InvalidValue, match=r"duration = 30.0 s: must be in \(0, 19.9\] s"):
        RecordedWindow(record=record, start=40.0, duration=30.0)


def test_a_table_that_no_machine_holds_is_refused_with_its_size(tmp_path):
    text = [HEADER, *(f"{k}e7,0,0,{k % 3},0,0,0" for k in range(20))]
    scenario = Scenario(motion=RecordedMotion.from_csv(write(tmp_path / "m.csv", text)))
    # 19e7 s at 0.1 s, 18 numbers of 8 bytes a line: 1.9e9 · 144 / 2**30.
    with pytest.raises(InvalidValue, match=r"1.9e\+08 s of recorded motion at steps of 0.1 s take 255 GiB"):
        AFrameHeaveEnv(scenario=scenario).reset(seed=0)


def test_records_of_past_episodes_are_dropped():
    env = AFrameHeaveEnv()
    times = np.arange(601) * 0.1
    coordinates = np.zeros((601, 6))
    for k in range(60):
        coordinates[:, 2] = np.sin(0.7 * times + k)
        motion = RecordedMotion(times=times, coordinates=coordinates)
        env.reset(seed=k, options={"scenario": Scenario(motion=motion)})
        assert env.simulation.engine.deck()[0, 2] == pytest.approx(math.sin(k), abs=1e-9)
    assert len(env.simulation.engine.records) <= 4 * 601


def swell(phase, step=0.1, decimals=None, yaw=0.0):
    """70 s of heave of 1 m and 9 s, and a yaw [deg]; the file's digits."""
    times = np.arange(0.0, 70.0, step)
    coordinates = np.zeros((len(times), 6))
    coordinates[:, 2] = np.sin(2 * np.pi * times / 9.0 + phase)
    coordinates[:, 5] = np.radians(yaw)
    return times, coordinates if decimals is None else np.round(coordinates, decimals)


@pytest.mark.parametrize("phase", [0.0, 0.3, 1.0, 2.0, 3.0, 4.5])
@pytest.mark.parametrize("decimals", [6, 2])
def test_a_record_of_few_digits_starts_and_ends_as_the_ship_does(phase, decimals):
    times, coordinates = swell(phase, decimals=decimals)
    if decimals == 2:
        with pytest.warns(RecordNoiseWarning):
            record = RecordedMotion(times=times, coordinates=coordinates)
    else:
        record = RecordedMotion(times=times, coordinates=coordinates)
    # Within the record the rounding is 1.1 m/s² and 0.035 m/s at 1 cm and 10 Hz; a free end has ten times that.
    share = 10.0 ** (2 - decimals)
    omega = 2 * np.pi / 9.0
    for time in (0.0, record.duration):
        _, rate, acceleration = record.at(time)[:, 0, 2]
        assert rate == pytest.approx(omega * math.cos(omega * time + phase), abs=0.06 * share + 2e-5)
        assert acceleration == pytest.approx(-(omega**2) * math.sin(omega * time + phase), abs=0.3 * share + 1e-3)
    np.testing.assert_allclose(record.at(times)[0], coordinates, atol=1e-9)


@pytest.mark.parametrize(("step", "decimals"), [(0.1, 2), (0.1, 3), (0.05, 3), (0.2, 2)])
def test_the_warning_says_how_much_acceleration_the_rounding_is(step, decimals):
    times, coordinates = swell(0.3, step=step, decimals=decimals)
    exact = swell(0.3, step=step)[1]
    rounding = scipy.interpolate.make_interp_spline(times, (coordinates - exact)[:, 2], k=5)
    fine = np.linspace(5.0, 65.0, 5003)
    implied = np.sqrt(np.mean(rounding(fine, nu=2) ** 2))
    with pytest.warns(RecordNoiseWarning, match="most of it by heave") as caught:
        RecordedMotion(times=times, coordinates=coordinates)
    said = float(str(caught[0].message).split(" m/s² of acceleration")[0].split()[-1])
    assert said == pytest.approx(implied, rel=0.2)


def test_fine_or_coarse_records_are_not_noisy():
    for step, decimals in ((0.1, 4), (1.0, 2), (0.5, 2), (0.1, None), (1.1, None), (2.0, None)):
        times, coordinates = swell(0.3, step=step, decimals=decimals)
        RecordedMotion(times=times, coordinates=coordinates)


def test_samples_at_uneven_times_are_not_noisy():
    times = swell(0.0)[0] + np.random.default_rng(0).uniform(-0.02, 0.02, 700)
    coordinates = np.zeros((700, 6))
    coordinates[:, 2] = np.sin(2 * np.pi * times / 9.0)
    RecordedMotion(times=times, coordinates=coordinates)


@pytest.mark.parametrize("yaw", [235.0, -90.0, 5.0])
def test_a_heading_does_not_turn_the_ship(yaw):
    ends = []
    for heading in (0.0, yaw):
        times, coordinates = swell(0.3, yaw=heading)
        scenario = Scenario(motion=RecordedMotion(times=times, coordinates=coordinates), ramp=10.0, initial="rest")
        env = AFrameHeaveEnv(scenario=scenario, observation="state")
        env.reset(seed=0)
        for _ in range(150):
            observation = env.step(np.zeros(1, dtype=np.float32))[0]
            assert env.simulation.engine.deck()[0, 5] == pytest.approx(math.radians(heading), abs=1e-12)
        ends.append(observation)
    np.testing.assert_allclose(ends[1][:2], ends[0][:2], rtol=1e-5)


def test_a_heading_across_north_builds_up_about_its_start():
    times, coordinates = swell(0.0)
    swing = np.radians(4.0) * np.sin(0.6 * times + 1.0)
    coordinates[:, 5] = (np.radians(359.0) + swing) % (2 * np.pi)
    scenario = Scenario(motion=RecordedMotion(times=times, coordinates=coordinates), ramp=10.0)
    env = AFrameHeaveEnv(scenario=scenario)
    env.reset(seed=0)
    first = coordinates[0, 5]
    for k in range(1, 200):
        env.step(np.zeros(1, dtype=np.float32))
        s = min(0.01 * k, 1.0)
        built_up = s**3 * (10 - 15 * s + 6 * s * s)
        turned = env.simulation.engine.deck()[0, 5] - first
        assert turned == pytest.approx(built_up * (swing[k] - swing[0]), abs=1e-9)
    place = deck_coordinates(scenario, 0.1, 200)
    np.testing.assert_allclose(place[0, 199, 5], first + swing[199] - swing[0], atol=1e-9)
    np.testing.assert_allclose(place[0, 0, 5], first, atol=1e-12)
    # Its derivatives are the path's own.
    np.testing.assert_allclose(place[1, 1:-1, 5], np.gradient(place[0, :, 5], 0.1)[1:-1], atol=2e-4)
    np.testing.assert_allclose(place[2, 1:-1, 5], np.gradient(place[1, :, 5], 0.1)[1:-1], atol=4e-4)
