"""The default vessel against long-wave theory and another program's ship; the CSV format."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from waveresponse import JONSWAP

from aframe_env.scenario.long_waves import long_wave_remark
from aframe_env.scenario.sea import Sea, SeaMotion
from aframe_env.scenario.vessel import COLUMNS, Vessel
from aframe_env.validation import InvalidValue, ResponseTableWarning

MSS = Path(__file__).parents[1] / "data" / "mss_supply_motion_rao.csv"
SUPPLY = Vessel.supply()


def mss_response() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies, headings [deg], response (F, D, 6) of the MSS ship, in this package's conventions.

    The source has x forward, y to starboard, z down: sway, heave, pitch and yaw change sign. Its elevation is
    positive upwards, its heading 180° a head sea, as here.
    """
    data = np.loadtxt(MSS, delimiter=",", skiprows=6)
    frequencies, headings = np.unique(data[:, 0]), np.unique(data[:, 1])
    data = data[np.lexsort((data[:, 1], data[:, 0]))].reshape(len(frequencies), len(headings), 14)
    response = data[:, :, 2::2] * np.exp(1j * data[:, :, 3::2])
    return frequencies, headings, response * np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])


def heading(degrees: float) -> int:
    return int(np.argmin(np.abs(SUPPLY.headings - math.radians(degrees))))


@pytest.mark.parametrize("degrees", [0, 45, 90, 135, 180, 270])
def test_long_waves_carry_the_ship(degrees: float) -> None:
    # A particle of a wave travelling towards β follows (-i cos β, -i sin β, 1); the deck follows the slope.
    k = SUPPLY.frequencies[0] ** 2 / 9.81
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    surge, sway, heave, roll, pitch, _ = SUPPLY.response[0, heading(degrees)]
    assert surge == pytest.approx(-1j * c, abs=0.02)
    assert sway == pytest.approx(-1j * s, abs=0.02)
    assert heave == pytest.approx(1.0, abs=0.01)
    assert roll / k == pytest.approx(-1j * s, abs=0.05)
    assert pitch / k == pytest.approx(1j * c, abs=0.02)


def test_short_waves_leave_the_ship_alone() -> None:
    assert np.abs(SUPPLY.response[-1]).max() < 0.03


def test_port_and_starboard_mirror() -> None:
    a, b = SUPPLY.response[:, heading(60)], SUPPLY.response[:, heading(300)]
    np.testing.assert_allclose(a * [1, -1, 1, -1, 1, -1], b, atol=1e-12)


@pytest.mark.parametrize(("degrees", "dof", "bound"), [(180, 2, 0.02), (180, 4, 0.002), (90, 2, 0.04), (0, 4, 0.004)])
def test_like_a_real_supply_ship(degrees: float, dof: int, bound: float) -> None:
    # Another hull of the same main dimensions by another program: amplitudes below 0.75 rad/s (8.4 s and longer), in
    # m/m and rad/m. Their greatest pitch is 0.041 rad/m. Phases of pitch differ with the hulls' fore-aft asymmetry.
    frequencies, headings, other = mss_response()
    j = int(np.flatnonzero(headings == degrees)[0])
    band = frequencies < 0.75
    ours = np.interp(frequencies, SUPPLY.frequencies, np.abs(SUPPLY.response[:, heading(degrees), dof]))
    assert np.abs(ours - np.abs(other[:, j, dof]))[band].max() < bound


def test_heave_phase_of_a_real_supply_ship() -> None:
    frequencies, headings, other = mss_response()
    theirs = other[:, np.flatnonzero(headings == 180.0)[0], 2]
    ours = np.interp(frequencies, SUPPLY.frequencies, SUPPLY.response[:, heading(180), 2])
    large = np.abs(theirs) > 0.5
    assert np.abs(np.angle(ours / theirs))[large].max() < 0.05


def _stern_heave(pitch_sign: float) -> float:
    """Standard deviation of the heave 45 m aft in a head sea (Hs 2.5 m, Tp 9 s, γ 3.3) of the MSS ship."""
    frequencies, headings, response = mss_response()
    head = response[:, np.flatnonzero(headings == 180.0)[0]]
    stern = head[:, 2] + pitch_sign * 45.0 * head[:, 4]
    omega = np.linspace(0.2, 2.5, 4000)
    amplitude = np.interp(omega, frequencies, np.abs(stern))
    density = JONSWAP(omega)(2.5, 9.0, gamma=3.3)[1]
    return math.sqrt(np.trapezoid(amplitude**2 * density, omega))


def test_sign_of_pitch_at_the_stern() -> None:
    # Bow-down pitch (positive here) lifts the stern.
    assert _stern_heave(+1.0) == pytest.approx(0.90, abs=0.01)
    assert _stern_heave(-1.0) == pytest.approx(1.13, abs=0.01)


def test_lever_of_another_point() -> None:
    position = (-45.0, 3.0, 4.0)
    moved = SUPPLY.response_at(position)
    x, y, _z = np.array(position) - SUPPLY.reference_point
    expected = SUPPLY.response[..., 2] + y * SUPPLY.response[..., 3] - x * SUPPLY.response[..., 4]
    np.testing.assert_allclose(moved[..., 2], expected, rtol=1e-12)
    np.testing.assert_array_equal(moved[..., 3:], SUPPLY.response[..., 3:])


def test_stern_of_ours_moves_like_theirs() -> None:
    j = heading(180)
    stern = SUPPLY.response_at((-45.0, 0.0, 0.0))[:, j, 2]
    omega = np.linspace(0.2, 2.5, 4000)
    density = JONSWAP(omega)(2.5, 9.0, gamma=3.3)[1]
    deviation = math.sqrt(np.trapezoid(np.interp(omega, SUPPLY.frequencies, np.abs(stern)) ** 2 * density, omega))
    assert deviation == pytest.approx(_stern_heave(+1.0), rel=0.2)


def test_deck_axes_are_turned_half_round() -> None:
    vessel = Vessel(
        name="v",
        frequencies=SUPPLY.frequencies,
        headings=SUPPLY.headings,
        response=SUPPLY.response,
        reference_point=SUPPLY.reference_point,
        deck_position=SUPPLY.reference_point,
    )
    np.testing.assert_allclose(vessel.deck_response, SUPPLY.response * [-1, -1, 1, -1, -1, 1])


def _text(change: tuple[str, str] | None = None) -> str:
    lines = [",".join(COLUMNS)]
    for omega in (0.5, 1.0):
        for degrees in (0, 45, 90, 135, 180):
            lines.append(f"{omega},{degrees}," + ",".join(["1.0", "0.5"] * 6))
    text = "\n".join(["# title: box", "# reference_point_m: 1, 0, -2", *lines])
    return text.replace(*change, 1) if change else text


def test_own_vessel(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text(_text())
    vessel = Vessel.from_csv(path, deck_position=(-10.0, 0.0, 2.0))
    assert (vessel.name, vessel.reference_point, vessel.deck_position) == ("box", (1, 0, -2), (-10, 0, 2))
    assert vessel.response.shape == (2, 9, 6)
    np.testing.assert_allclose(vessel.response[0, 0], np.exp(0.5j))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("0.5,45,1.0", "0.5,45,x"), r"line 5: surge_amp = 'x': must be a number"),
        (("0.5,45,1.0", "0.5,45,nan"), r"line 5: surge_amp = 'nan': must be finite"),
        (("0.5,45,1.0", "0.5,45,-1.0"), r"line 5: surge_amp = -1: must not be negative"),
        (("0.5,45,", "0.5,450,"), r"line 5: heading_deg = 450°"),
        (("0.5,45,", "-0.5,45,"), r"line 5: omega_rad_s = -0.5 rad/s"),
        (("0.5,45,", "0.5,0,"), r"the row of 0.5 rad/s and 0° is there 2 times"),
        (("0.5,45," + ",".join(["1.0", "0.5"] * 6), ""), r"the row of 0.5 rad/s and 45° is missing"),
        (("omega_rad_s", "omega"), r"line 3: the columns must be"),
        (("# reference_point_m: 1, 0, -2", "# reference_point_m: 1, 0"), r"line 2: reference_point_m"),
        (("0.5,45,1.0,", "0.5,45,"), r"line 5: 13 columns: must be 14"),
    ],
)
def test_bad_vessel_names_file_and_line(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(_text(change))
    with pytest.raises(InvalidValue, match=message):
        Vessel.from_csv(path)


def test_repr_leaves_the_tables_out() -> None:
    text = repr(SeaMotion(sea=Sea(hs=2.0, tp=8.0)))
    assert Vessel.supply().name in text
    assert "array" not in text


def test_missing_vessel(tmp_path: Path) -> None:
    with pytest.raises(InvalidValue, match="cannot be read"):
        Vessel.from_csv(tmp_path / "none.csv")


def _long_wave_text(headings: list[float], frequencies: tuple[float, ...] = (0.1, 0.3, 5.0)) -> str:
    """Closed form of a table: a ship that goes with the wave's particles and slope."""
    lines = [",".join(COLUMNS)]
    for omega in frequencies:
        k = omega**2 / 9.81
        for degrees in headings:
            c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
            response = np.array([-1j * c, -1j * s, 1.0, -1j * k * s, 1j * k * c, 1e-4j * k * s * c])
            cells = np.stack([np.abs(response), np.angle(response)], axis=1).ravel()
            lines.append(",".join(f"{value:.12g}" for value in (omega, degrees, *cells)))
    return "\n".join(lines)


AROUND = {
    "from 15": list(range(15, 360, 30)),
    "from 0": list(range(0, 360, 30)),
    "0 to 360": list(range(0, 361, 30)),
    "-180 to 180": list(range(-180, 181, 30)),
    "-165 to 165": list(range(-165, 166, 30)),
    "0 to 180": list(range(0, 181, 30)),
    "-180 to 0": list(range(-180, 1, 30)),
    "uneven": [-170, -140, -100, -60, -20, 20, 50, 90, 130, 150],
}


@pytest.mark.parametrize("name", AROUND)
def test_headings_close_the_circle(tmp_path: Path, name: str) -> None:
    path = tmp_path / "ship.csv"
    path.write_text(_long_wave_text(AROUND[name]))
    vessel = Vessel.from_csv(path, deck_position=(0.0, 0.0, 0.0))
    assert (vessel.headings[0], vessel.headings[-1]) == (0.0, 2.0 * math.pi)
    assert (np.diff(vessel.headings) > 0.0).all()
    for degrees in range(-180, 360, 5):
        sea = Sea(hs=2.0, tp=2 * math.pi / 0.3, heading=math.radians(degrees), components=8)
        waves = sea.waves()
        surge, sway, heave = SeaMotion(sea=sea, vessel=vessel).components().response[:, :3].T
        wave = waves.amplitude * np.exp(1j * waves.phase)
        np.testing.assert_allclose(heave, wave, rtol=1e-9)
        # The chord between two headings d apart runs within 1 - cos(d/2) of the circle: 0.061 for 40°.
        np.testing.assert_allclose(surge / wave, 1j * math.cos(math.radians(degrees)), atol=0.061)
        np.testing.assert_allclose(sway / wave, 1j * math.sin(math.radians(degrees)), atol=0.061)


@pytest.mark.parametrize(
    ("headings", "message"),
    [
        (list(range(0, 301, 30)), "leave 60° open"),
        (list(range(-90, 91, 30)), "leave 180° open"),
        ([0, 60, 120, 180], "leave 60° open"),
        ([90], "leave 360° open"),
    ],
)
def test_headings_that_leave_a_gap(tmp_path: Path, headings: list[float], message: str) -> None:
    path = tmp_path / "ship.csv"
    path.write_text(_long_wave_text(headings))
    with pytest.raises(InvalidValue, match=message):
        Vessel.from_csv(path)


def test_a_heading_given_twice_around(tmp_path: Path) -> None:
    path = tmp_path / "ship.csv"
    path.write_text(_long_wave_text(list(range(-180, 181, 30))).replace("0.1,180,1,1.57", "0.1,180,1,1.0"))
    with pytest.raises(InvalidValue, match="two responses at the one heading of 180°"):
        Vessel.from_csv(path)


def _table(vessel: Vessel, change: Callable[[np.ndarray], np.ndarray], begin: int = 0, phase_unit: float = 1.0) -> str:
    """A file of a vessel's table with a changed response (F, D, 6), from frequency ``begin`` on."""
    response = change(vessel.response[:, :-1])
    lines = [",".join(COLUMNS)]
    for i in range(begin, len(vessel.frequencies)):
        for j, heading in enumerate(np.degrees(vessel.headings[:-1])):
            cells = np.stack([np.abs(response[i, j]), np.angle(response[i, j]) / phase_unit], axis=1).ravel()
            lines.append(",".join(f"{value:.9g}" for value in (vessel.frequencies[i], heading, *cells)))
    return "\n".join(lines)


WAVE_NUMBER = (SUPPLY.frequencies**2 / 9.81)[:, None, None]
WRONG: dict[str, tuple[Callable[[np.ndarray], np.ndarray], float, str]] = {
    "phases in degrees": (lambda r: r, math.pi / 180, "phases are in degrees"),
    "deg/m": (
        lambda r: r * np.repeat([1, 180 / math.pi], 3),
        1.0,
        r"roll is [56]\d.*pitch is 5[67].*likely.*are in deg/m",
    ),
    "deg/m and degrees": (
        lambda r: r * np.repeat([1, 180 / math.pi], 3),
        math.pi / 180,
        "phases are in degrees.*, and roll, pitch and yaw are in deg/m",
    ),
    "lag": (np.conj, 1.0, "surge is turned by 180°.*pitch is turned by 180°; likely phases are lags"),
    "coming from": (
        lambda r: np.roll(r, 12, axis=1),
        1.0,
        "pitch is turned by 180°; likely headings say where the waves",
    ),
    "x aft": (lambda r: r * [-1, -1, 1, -1, -1, 1], 1.0, "x points aft and y to starboard"),
    "z down": (lambda r: r * [1, 1, -1, 1, 1, 1], 1.0, "heave is turned by 180°; likely z points down"),
    "y to starboard and z down": (
        lambda r: r * [1, -1, -1, 1, -1, -1],
        1.0,
        "sway is turned.*heave is turned.*pitch is turned.*likely y points to starboard and z down",
    ),
    "headings to starboard": (
        lambda r: np.roll(r[:, ::-1], 1, axis=1),
        1.0,
        "sway is turned by 180°, roll is turned by 180°; likely headings count towards starboard",
    ),
    "sine": (lambda r: r * 1j, 1.0, "heave is turned by 90°.*zero crossing"),
    "wave height": (lambda r: r / 2, 1.0, r"heave is 0\.\d+ times.*by wave height"),
    "slope": (
        lambda r: r / np.concatenate([WAVE_NUMBER**0] * 3 + [WAVE_NUMBER] * 3, axis=2),
        1.0,
        "by the wave's slope",
    ),
    "beam for bow": (lambda r: np.roll(r, 6, axis=1), 1.0, "(surge|sway) does not go with the heading"),
}


@pytest.mark.parametrize("begin", [0, 3, 6])
@pytest.mark.parametrize("name", WRONG)
def test_a_table_in_other_conventions_is_told(tmp_path: Path, name: str, begin: int) -> None:
    change, phase_unit, words = WRONG[name]
    path = tmp_path / "ship.csv"
    path.write_text(_table(SUPPLY, change, begin, phase_unit))
    with pytest.warns(ResponseTableWarning, match=rf"ship\.csv: in the longest wave, .*{words}"):
        Vessel.from_csv(path)


@pytest.mark.parametrize("begin", range(0, 44, 4))
def test_the_shipped_table_is_right_wherever_it_begins(tmp_path: Path, begin: int) -> None:
    path = tmp_path / "ship.csv"
    path.write_text(_table(SUPPLY, lambda r: r, begin))
    assert len(Vessel.from_csv(path).frequencies) == len(SUPPLY.frequencies) - begin


def test_another_programs_ship_is_right() -> None:
    frequencies, degrees, response = mss_response()
    assert frequencies[0] < 0.4
    # Its headings count towards starboard, as its y does: the same ship in waves from its other side.
    turned = response * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    headings = np.radians(degrees)
    assert long_wave_remark(frequencies, headings, np.abs(turned), np.angle(turned)) == ""
    as_given = response * np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
    remark = long_wave_remark(frequencies, headings, np.abs(as_given), np.angle(as_given))
    assert "headings count towards starboard" in remark
    assert "y points to starboard and z down" in remark


@pytest.mark.parametrize("roll_period", [8.0, 15.0, 25.0, 32.0])
@pytest.mark.parametrize("depth", [20.0, 60.0, math.inf])
def test_shallow_water_and_resonances_are_right(depth: float, roll_period: float) -> None:
    # ω² = g k tanh(kh); particles at the surface go 1 / tanh(kh) as far along as up; roll of 5 % damping.
    headings = np.radians(np.arange(0, 360, 15))
    for first in np.arange(0.1, 0.4, 0.01):
        frequencies = np.arange(first, 2.0, 0.05)
        k = np.array([brentq(lambda k, w=w: 9.81 * k * math.tanh(k * depth) - w * w, 1e-6, 10.0) for w in frequencies])
        along, c, s = (1.0 / np.tanh(k * depth))[:, None], np.cos(headings), np.sin(headings)
        ratio = frequencies[:, None] * roll_period / (2 * math.pi)
        roll = -1j * k[:, None] * s / (1.0 - ratio**2 + 0.1j * ratio)
        parts = (-1j * c * along, -1j * s * along, 1.0 + 0.0 * roll, roll, 1j * k[:, None] * c, 0.0 * roll)
        response = np.stack(np.broadcast_arrays(*parts), axis=2)
        assert long_wave_remark(frequencies, headings, np.abs(response), np.angle(response)) == ""
