"""Cards, the JSON beside arrays that says what they are: sealed by a digest, so that an altered one is refused."""

from __future__ import annotations

import hashlib
import json
from typing import Any, Final

from aframe_env.validation import InvalidValue

DIGEST: Final = "digest"
"""Key of the sha256 over the rest of a card, as JSON without spaces and with its keys sorted."""


def sealed(card: dict[str, Any]) -> dict[str, Any]:
    """Return a card with its digest; NaN and infinity raise ValueError, as JSON has neither."""
    return {**card, DIGEST: _digest(card)}


def unsealed(text: bytes, source: str, form: int) -> dict[str, Any]:
    """Return the card without its digest.

    Raises InvalidValue that begins with ``source``: not JSON, of another format than ``form``, or altered.
    """
    try:
        card = json.loads(text)
        if not isinstance(card, dict):
            raise InvalidValue(f"{source}: must be a table")
        if card.get("format") != form:
            raise InvalidValue(f"{source}: format = {card.get('format')!r}: this version reads format {form}")
        stated = card.pop(DIGEST, None)
        if stated != _digest(card):
            raise InvalidValue(f"{source}: does not match its own digest: damaged or altered")
    except InvalidValue:
        raise
    except (ValueError, RecursionError) as error:
        raise InvalidValue(f"{source}: not JSON: {error}") from error
    return card


def _digest(card: dict[str, Any]) -> str:
    text = json.dumps(card, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
