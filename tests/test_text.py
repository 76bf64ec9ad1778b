"""The readers of text files: what is read alike, and that nothing but InvalidValue comes out of them."""

from __future__ import annotations

import contextlib
import json
import math
import string
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aframe_env import InvalidValue, RecordedMotion
from aframe_env.scenario.file import read_scenario, read_scenarios
from aframe_env.scenario.vessel import Vessel
from aframe_env.text import DATA_LIMIT, DEPTH, TABLE_LIMIT, read_csv, read_json, read_text, read_toml
from agents.drives import map as drive_map
from agents.learned import agent
from train.shared.cli import read_options
from train.shared.scenarios import ScenarioOptions

ROOT = Path(__file__).parents[1]
SUPPLY = ROOT / "aframe_env" / "data" / "supply_vessel.csv"
RECORD = "# of a sea\ntime_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg\n" + "".join(
    f"{0.5 * i},0,0,{math.sin(0.5 * i)},0,0,0\n" for i in range(20)
)
SCENARIO = """load_mass = 60e3
[motion]
kind = "harmonic"
[[motion.harmonics]]
coordinate = "heave"
amplitude = 1.0
period = 8.0
"""
BOM = b"\xef\xbb\xbf"
MIXED = settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


def file(folder: Path, data: str | bytes, name: str = "file") -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def quoted(text: str) -> str:
    return "".join(",".join(f'"{cell}"' for cell in line.split(",")) + "\n" for line in text.splitlines())


def spreadsheet(text: str) -> str:
    """What a spreadsheet makes of it: comments padded to the width of the table, empty lines too."""
    width = max(line.count(",") for line in text.splitlines() if not line.startswith("#"))
    padded = [f'"{line}"' + "," * width if line.startswith("#") else line for line in [*text.splitlines(), "," * width]]
    return "\r\n".join(padded)


WAYS: dict[str, Callable[[str], bytes]] = {
    "plain": str.encode,
    "with a byte order mark": lambda text: BOM + text.encode(),
    "from Windows": lambda text: BOM + text.replace("\n", "\r\n").encode(),
    "quoted": lambda text: quoted(text).encode(),
    "out of a spreadsheet": lambda text: BOM + spreadsheet(text).encode(),
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_a_table_is_the_same_however_it_was_saved(way: Callable[[str], bytes], tmp_path: Path) -> None:
    text = SUPPLY.read_text(encoding="utf-8")
    assert text.startswith("#")
    assert "# reference_point_m:" in text
    saved, supply = Vessel.from_csv(file(tmp_path, way(text))), Vessel.supply()
    assert (saved.response == supply.response).all()
    assert saved.reference_point == supply.reference_point
    plain, record = (RecordedMotion.from_csv(file(tmp_path, data)) for data in (RECORD.encode(), way(RECORD)))
    assert (record.times == plain.times).all()
    assert (record.coordinates == plain.coordinates).all()


@pytest.mark.parametrize("way", ["plain", "with a byte order mark", "from Windows"])
def test_a_scenario_is_the_same_however_it_was_saved(way: str, tmp_path: Path) -> None:
    assert read_scenario(file(tmp_path, WAYS[way](SCENARIO))) == read_scenario(file(tmp_path, SCENARIO, "plain"))
    data = {"a": [1, "Ω"]}
    assert read_json(file(tmp_path, WAYS[way](json.dumps(data, ensure_ascii=False))), "data") == data


def nested(depth: int, left: str, right: str) -> str:
    return left * depth + right * depth


@pytest.mark.parametrize(
    ("read", "data", "words"),
    [
        (read_toml, b"a = 1\nb = '\xff'", "line 2: must be text in UTF-8"),
        (read_toml, "a = 1".encode("utf-16"), "line 1: must be text in UTF-8"),
        (read_json, b"\n\n\xe9", "line 3: must be text in UTF-8"),
        (read_toml, "a = 1\nb =", "not TOML: Invalid value (at end of document)"),
        (read_toml, "a = 1\nb 2", "not TOML: Expected '=' after a key in a key/value pair (at line 2, column 3)"),
        (read_toml, "a = " + "9" * 5000, "not TOML: Exceeds the limit"),
        (read_toml, f"a = {nested(DEPTH, '[', ']')}", "nested too deeply"),
        (read_toml, f"a = {nested(10**5, '[', ']')}", "nested too deeply"),
        (read_toml, f"a = {nested(10**5, '{a = ', '}')}", "nested too deeply"),
        (read_toml, f"{'a.' * 10**5}a = 1", "nested too deeply"),
        (read_toml, f"[{'a.' * 10**5}a]", "nested too deeply"),
        (read_json, nested(DEPTH + 1, "[", "]"), "nested too deeply"),
        (read_json, nested(10**5, "[", "]"), "nested too deeply"),
        (read_json, '{"a": 1,\n}', "line 2: not JSON"),
        (read_json, "[1, NaN]", "not JSON: NaN"),
        (read_json, "9" * 5000, "not JSON: Exceeds the limit"),
        (read_json, "", "line 1: not JSON"),
        (read_toml, b" " * (DATA_LIMIT + 1), "larger than 4 MiB"),
        (lambda *a: list(read_csv(*a)), b"# x\n1,2\n3,\xff", "line 3: must be text in UTF-8"),
        (lambda *a: list(read_csv(*a)), '1,2\n"1,2', "line 2: not CSV"),
        (lambda *a: list(read_csv(*a)), f"1\n{'9' * 2**18}", "line 2: not CSV"),
    ],
)
def test_what_cannot_be_read_is_one_sentence_with_file_and_line(
    read: Callable[[Path, str], Any], data: str | bytes, words: str, tmp_path: Path
) -> None:
    path = file(tmp_path, data)
    with pytest.raises(InvalidValue) as caught:
        read(path, "data")
    assert str(path) in str(caught.value)
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_what_is_just_small_and_shallow_enough_is_read(tmp_path: Path) -> None:
    assert read_toml(file(tmp_path, "a = 1".ljust(DATA_LIMIT)), "data") == {"a": 1}
    read_json(file(tmp_path, nested(DEPTH, "[", "]")), "data")
    read_toml(file(tmp_path, f"a = {nested(DEPTH - 1, '[', ']')}"), "data")


def test_a_huge_table_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.csv"
    with path.open("wb") as sparse:
        sparse.truncate(100 * TABLE_LIMIT)
    with pytest.raises(InvalidValue, match=r"huge.csv': larger than 128 MiB"):
        RecordedMotion.from_csv(path)


@pytest.mark.parametrize("path", [Path("absent"), Path("."), Path("a\0b"), Path("a" * 5000)])
def test_what_is_no_file_is_one_sentence(path: Path) -> None:
    with pytest.raises(InvalidValue, match=r"^data = .*: cannot be read: "):
        read_text(path, "data")


def mutated(data: bytes) -> st.SearchStrategy[bytes]:
    """Bytes with stretches put in place of others, cut off somewhere."""
    at = st.integers(0, len(data))
    stretch = st.one_of(
        st.binary(max_size=6),
        st.sampled_from([b"[", b"{", b'"', b"\x00", b"\r", b"\n", b"1e999", b"nan", b"-1", b"9" * 400, b"9" * 5000]),
        st.text(string.printable, max_size=6).map(str.encode),
        st.just(b"[" * 5000),
        st.just(b"a." * 5000),
    )
    edit = st.tuples(at, st.integers(0, 30), stretch)

    def apply(edits: list[tuple[int, int, bytes]], end: int) -> bytes:
        changed = data
        for begin, length, piece in edits:
            changed = changed[:begin] + piece + changed[begin + length :]
        return changed[:end]

    whole = st.just(len(data) + 10**6)
    return st.builds(apply, st.lists(edit, max_size=4), st.one_of(whole, at))


@contextlib.contextmanager
def only_invalid_value() -> Any:
    with contextlib.suppress(InvalidValue):
        yield


@pytest.mark.parametrize("read", [read_toml, read_json, lambda *a: list(read_csv(*a))], ids=["TOML", "JSON", "CSV"])
@MIXED
@given(data=st.one_of(st.binary(max_size=200), st.text(max_size=200).map(str.encode)))
def test_of_any_bytes_only_invalid_value_comes(read: Callable[[Path, str], Any], data: bytes, tmp_path: Path) -> None:
    with only_invalid_value():
        read(file(tmp_path, data), "data")


SMALL_VESSEL = "".join(
    line + "\n"
    for line in SUPPLY.read_text(encoding="utf-8").splitlines()
    if line.startswith(("#", "omega", "0.1,", "1.0,"))
).encode()
DISTRIBUTION = b'kind = "distribution"\nhs = [1.0, 2.0]\nload_mass = 60e3\n[crane.winch]\nmax_rope_speed = 2.0\n'


@pytest.mark.filterwarnings("ignore::aframe_env.validation.ResponseTableWarning")
@MIXED
@given(data=mutated(SMALL_VESSEL))
def test_of_a_damaged_vessel_only_invalid_value_comes(data: bytes, tmp_path: Path) -> None:
    with only_invalid_value():
        Vessel.from_csv(file(tmp_path, data))


@pytest.mark.filterwarnings("ignore::aframe_env.validation.RecordNoiseWarning")
@MIXED
@given(data=mutated(RECORD.encode()))
def test_of_a_damaged_record_only_invalid_value_comes(data: bytes, tmp_path: Path) -> None:
    with only_invalid_value():
        RecordedMotion.from_csv(file(tmp_path, data))


@pytest.mark.parametrize("text", [SCENARIO.encode(), DISTRIBUTION], ids=["scenario", "distribution"])
@MIXED
@given(draw=st.data())
def test_of_a_damaged_scenario_only_invalid_value_comes(text: bytes, draw: st.DataObject, tmp_path: Path) -> None:
    with only_invalid_value():
        read_scenarios(file(tmp_path, draw.draw(mutated(text))))


@MIXED
@given(data=mutated(b"scenarios = 100\ncount = 10\n"))
def test_of_damaged_options_only_invalid_value_comes(data: bytes, tmp_path: Path) -> None:
    with only_invalid_value():
        read_options(file(tmp_path, data), ScenarioOptions)


@pytest.mark.parametrize(
    ("load", "folder", "card", "arrays"),
    [
        (agent.load, ROOT / "results" / "agents" / "ppo" / "seed-0", agent.CARD, agent.WEIGHTS),
        (drive_map.load, ROOT / "results" / "drive-map", drive_map.CARD, drive_map.ARRAYS),
    ],
    ids=["agent", "drive map"],
)
@MIXED
@given(draw=st.data())
def test_of_a_damaged_card_only_invalid_value_comes(
    load: Callable[[Path], object], folder: Path, card: str, arrays: str, draw: st.DataObject, tmp_path: Path
) -> None:
    file(tmp_path, (folder / arrays).read_bytes(), arrays)
    file(tmp_path, draw.draw(mutated((folder / card).read_bytes())), card)
    with only_invalid_value():
        load(tmp_path)
