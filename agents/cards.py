"""Cards, the JSON beside arrays that says what they are: sealed by a digest, so that an altered one is refused."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, Final

from aframe_env.text import read_json
from aframe_env.validation import InvalidValue

DIGEST: Final = "digest"
"""Key of the sha256 over the rest of a card, as JSON without spaces and with its keys sorted."""


def sealed(card: dict[str, Any]) -> dict[str, Any]:
    """Return a card with its digest; NaN and infinity raise ValueError, as JSON has neither."""
    return {**card, DIGEST: _digest(card)}


def read(path: Path, name: str, form: int) -> dict[str, Any]:
    """Read a card without its digest; ``name`` is what the user calls it, as in "agent".

    Raises InvalidValue with the file's name: not JSON, of another format than ``form``, or altered.
    """
    card = read_json(path, name)
    if not isinstance(card, dict):
        raise InvalidValue(f"{path}: must be a table")
    if card.get("format") != form:
        raise InvalidValue(f"{path}: format = {card.get('format')!r}: this version reads format {form}")
    stated = card.pop(DIGEST, None)
    try:
        whole = stated == _digest(card)
    except ValueError:  # a number that is too large for a float: nobody sealed that
        whole = False
    if not whole:
        raise InvalidValue(f"{path}: does not match its own digest: damaged or altered")
    return card


def _digest(card: dict[str, Any]) -> str:
    text = json.dumps(card, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
