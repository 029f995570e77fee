"""JSON from strangers: read into the fields that a protocol names, everything else is skipped without being built.

So a hostile text costs no more memory than a good one: there is no list or object of unknown length in the fields.
"""

from __future__ import annotations

from typing import Any

import msgspec

from naoimitate.core.errors import DatagramError
from naoimitate.live.sample import LARGEST

LONGEST_REASON = 120
"""Characters of a reason: it may quote what the sender wrote."""


def parse(decoder: msgspec.json.Decoder[Any], text: bytes | bytearray, title: str) -> Any:
    """The fields that a typed decoder finds in a JSON text.

    title: what the text should be, for the message. Raises DatagramError for anything that is not so: no JSON, wrong
    types, numbers out of range, NaN, nested too deeply, longer than ``LARGEST``.
    """
    if len(text) > LARGEST:
        raise DatagramError(f"this is not {title}: longer than {LARGEST} bytes")
    try:
        return decoder.decode(text)
    except (msgspec.MsgspecError, RecursionError, ValueError, OverflowError) as error:
        raise DatagramError(f"this is not {title}: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    """What went wrong as one short printable line."""
    text = "nested too deeply" if isinstance(error, RecursionError) else str(error)
    return "".join(letter if letter.isprintable() else "?" for letter in text[:LONGEST_REASON])
