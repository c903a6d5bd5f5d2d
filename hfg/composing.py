"""What stands on an upper floor and is asked for on a lower one: put in its place here, imported when it is used.

`run.record` belongs to a run, and recording stands on the engine. Stands on both.
"""

from __future__ import annotations

from typing import Any

from hfg.engine import Run

__all__: list[str] = []


def _record(*arguments: Any, **options: Any) -> Any:
    """Stand behind `Run.record`, which has the types; who records nothing imports nothing of what that needs."""
    from hfg.recording import record

    return record(*arguments, **options)


Run._recorder = staticmethod(_record)
