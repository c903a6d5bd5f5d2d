"""Texts that can be handed to native code: OpenCV ends the process for one that has no encoding."""

from __future__ import annotations

from typing import Any


def is_encodable(text: str) -> bool:
    """Say whether a text can be encoded as UTF-8: half of a pair of surrogates cannot."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def need_encodable(what: str, text: Any) -> None:
    """Refuse a text that has no encoding, such as the name of a file that is not UTF-8.

    Args:
      what: starts the sentence: "the path".
      text: anything but a text passes.

    Raises:
      ValueError: it cannot be encoded.
    """
    if isinstance(text, str) and not is_encodable(text):
        raise ValueError(
            f"{what} {text!r} has half of a character (a lone surrogate), which cannot be encoded: replace it; "
            "of a file whose name is not UTF-8, change the name"
        )
