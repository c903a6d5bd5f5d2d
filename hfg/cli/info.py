"""`hfg info FILE`: says what is in a recording. Depends on `hfg.recording` and `show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hfg.cli import show
from hfg.engine.observing.tables import table
from hfg.errors import TargetError, UsageError
from hfg.recording import File, Loss, RecordingInfo


def info(
    file: Annotated[Path, typer.Argument(help="a recording, any MCAP file, or a bag of ROS 2")],
    json: Annotated[bool, typer.Option("--json", help="Write JSON.")] = False,
) -> int:
    """Show what a recording contains: ports, types, counts, rates, and damage."""
    try:
        with File(file) as recording:
            found = recording.info()
    except UsageError as error:
        raise TargetError(str(error)) from None
    if json:
        show.json(found)
    else:
        show.write("\n".join(_lines(found)) + "\n")
    return 0 if found.whole and not found.losses else 1


def _lines(found: RecordingInfo) -> list[str]:
    whole = _state(found)
    lines = [f"{found.path}: {found.bytes / 1e6:.3f} MB, {found.duration_s:.3f} s, {whole}"]
    if found.graph:
        outcome = f", {found.outcome}" if found.outcome else ""
        lines.append(f'graph "{found.graph}", {found.clock} clock{outcome}')
    else:
        lines.append(f"written by {found.library or 'an unknown program'}")
    rows = [(one.path, one.kind, one.type or one.schema, one.values, f"{one.rate_hz:.4g}") for one in found.ports]
    lines += ["", *table(("port", "kind", "type", "values", "Hz"), rows)]
    if found.markers:
        lines.append(f"and {found.markers} marker{'s' * (found.markers != 1)}")
    lines += [
        f'{count} tokens of "{path}" were skipped because the disk was too slow'
        for path, count in found.left_out.items()
    ]
    lines += [
        f'{count} values of "{path}" were skipped because they are not data' for path, count in found.refused.items()
    ]
    if found.held_s:
        lines.append(f"nodes waited {found.held_s:.3f} s for the recording")
    return lines + told_losses(found.losses)


def _state(found: RecordingInfo) -> str:
    if not found.whole:
        return "cut off, or its end is damaged: hfg recover makes a complete file of what is there"
    return "damaged, see below" if found.losses else "whole"


def told_losses(losses: list[Loss]) -> list[str]:
    """Say what is lost, in lines; the last one sums it up if there are several."""
    lines = [f"damaged: {one}" for one in losses]
    if len(losses) > 1:
        known = sum(one.messages or 0 for one in losses)
        least = "at least " if any(one.messages is None for one in losses) else ""
        lines.append(f"lost in all: {least}{known:,} message{'s' * (known != 1)}")
    return lines
