"""What a run failed with, for people: the sentence, the node, and what helps. Depends on errors."""

from __future__ import annotations

import traceback
from typing import Any, Final

from hfg.errors import CheckFailed, HfgError
from hfg.graph.editing.commands import Disable, encode
from hfg.studio.records import ProblemRecord
from hfg.studio.refusing import parts_of

__all__ = ["error_record", "problem_of_run", "problems_of_check"]

_MOST_LETTERS: Final = 20_000


def error_record(error: HfgError) -> dict[str, str]:
    """Return an error as a page shows it; the traceback is that of the user's code."""
    cause = error.__cause__
    text = "" if cause is None else "".join(traceback.format_exception(cause))
    parts = parts_of(error)
    return {
        "message": str(error),
        "path": parts["path"],
        "what": str(getattr(error, "what", "")),
        "remedy": parts["remedy"],
        "traceback": text[-_MOST_LETTERS:],
    }


def problem_of_run(path: str, what: str, message: str, at_s: float, last_edit: str) -> ProblemRecord:
    """Return what has gone wrong in a run, with commands that may help."""
    fixes: list[dict[str, Any]] = []
    if last_edit:
        fixes.append({"text": f"Undo: {last_edit}", "message": {"t": "undo"}})
    if path:
        disable = {"t": "edit", "commands": _plain(Disable(path))}
        fixes.append({"text": f"Disable {path}", "message": disable})
    return ProblemRecord(path, "error", what, message, "", "run", "run", at_s, fixes)


def _plain(command: Disable) -> list[Any]:
    import msgspec

    plain: list[Any] = msgspec.json.decode(encode([command]))
    return plain


def problems_of_check(error: HfgError) -> dict[str, ProblemRecord]:
    """Return the findings of a check that kept a graph from running; of another error, none."""
    found = error.problems if isinstance(error, CheckFailed) else ()
    return {str(one): ProblemRecord(*_fields(one), "check") for one in found}


def _fields(one: Any) -> tuple[str, str, str, str, str, str]:
    return one.path, one.severity, one.what, one.why, one.remedy, one.check
