import json
import shutil
from pathlib import Path

import hypothesis
import pytest
from hypothesis import strategies as st

from aframe_env import InvalidValue
from agents import cards
from agents.drives import map as drive_map
from agents.learned import agent

RESULTS = Path(__file__).parents[2] / "results"
SHIPPED = {
    agent.CARD: (RESULTS / "agents" / "ppo-sensors" / "seed-0", agent.load),
    drive_map.CARD: (RESULTS / "drive-map", drive_map.load),
}
PIECES = (b"[" * 100_000, b"NaN", b"1e999", b"9" * 5000, b"\xff", b"\xef\xbb\xbf", b"{}", b'"', b"null", b"\x00")


def loaded(card, text, folder):
    """What comes of a card with this text beside the shipped arrays: True, or the sentence that refuses it."""
    place, load = SHIPPED[card]
    if not folder.exists():
        folder.mkdir()
        for arrays in place.glob("*.safetensors"):
            shutil.copy(arrays, folder)
    (folder / card).write_bytes(text)
    try:
        load(folder)
    except InvalidValue as error:
        return str(error)
    return True


@pytest.mark.parametrize("card", SHIPPED)
@hypothesis.settings(max_examples=100, deadline=None)
@hypothesis.given(data=st.data())
def test_a_card_with_other_bytes_is_refused_in_one_sentence(card, tmp_path_factory, data):
    text = (SHIPPED[card][0] / card).read_bytes()
    begin = data.draw(st.integers(0, len(text) - 1))
    end = data.draw(st.integers(begin, min(begin + 40, len(text))) | st.just(len(text)))
    damaged = text[:begin] + data.draw(st.binary(max_size=4) | st.sampled_from(PIECES)) + text[end:]
    said = loaded(card, damaged, tmp_path_factory.getbasetemp() / card)
    try:
        whole = json.loads(damaged) == json.loads(text)  # spaces, and other spellings of the same
    except (ValueError, RecursionError):
        whole = False
    if whole:
        assert said is True
    else:
        assert card in said
        assert "\n" not in said


@pytest.mark.parametrize("card", SHIPPED)
def test_no_entry_of_a_card_can_be_altered_left_out_or_added(card, tmp_path):
    whole = json.loads((SHIPPED[card][0] / card).read_text(encoding="utf-8"))
    for name in whole:
        for altered in ({**whole, name: "other"}, {k: v for k, v in whole.items() if k != name}):
            said = loaded(card, json.dumps(altered).encode(), tmp_path / "made")
            expected = "this version reads format" if name == "format" else "does not match its own digest"
            assert expected in said, name
    assert "does not match its own digest" in loaded(card, json.dumps({**whole, "note": 1}).encode(), tmp_path / "made")


def test_the_digest_does_not_go_by_order_or_spaces_and_refuses_nan(tmp_path):
    sealed = cards.sealed({"format": 1, "b": [1.5, None], "a": "Ω"})
    (tmp_path / "card.json").write_text(json.dumps(dict(sorted(sealed.items())), indent=3))
    assert cards.read(tmp_path / "card.json", "card", 1) == {"format": 1, "a": "Ω", "b": [1.5, None]}
    with pytest.raises(ValueError, match="not JSON compliant"):
        cards.sealed({"format": 1, "a": float("nan")})
