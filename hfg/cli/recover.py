"""`hfg recover FILE -o OUTPUT`: makes a complete recording of a damaged one, or a bag of ROS 2. Depends on `show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from hfg.cli import show
from hfg.cli.info import told_losses
from hfg.cli.options import ForceOption
from hfg.errors import TargetError, UsageError
from hfg.recording import export_bag
from hfg.recording import recover as recover_recording


def recover(
    file: Annotated[Path, typer.Argument(help="a recording, any MCAP file, or a bag of ROS 2")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The new recording.")],
    force: ForceOption = False,
    form: Annotated[
        Literal["mcap", "rosbag2"], typer.Option("--format", help="rosbag2: a bag of ROS 2, a new folder.")
    ] = "mcap",
) -> int:
    """Write everything that can be read from a damaged recording to a new file, and report what is lost.

    With --format rosbag2, write the values that have a message in ROS 2 to a bag, and report the others.
    """
    if form == "rosbag2":
        return _export(file, output)
    try:
        count, losses = recover_recording(file, output, force=force)
    except UsageError as error:
        raise TargetError(str(error)) from None
    found = f"{count:,} message{'s' * (count != 1)}"
    lines = [f"{output}: {found} of {file}", *(told_losses(losses) or ["nothing is lost"])]
    show.write("\n".join(lines) + "\n")
    return 1 if losses and not count else 0


def _export(file: Path, output: Path) -> int:
    try:
        done = export_bag(file, output)
    except UsageError as error:
        raise TargetError(str(error)) from None
    count = done.written.total()
    lines = [f"{output}: {count:,} message{'s' * (count != 1)} of {file}, {len(done.written)} topics"]
    lines += [f'"{port}": {one:,} not in the bag: {done.why[port]}' for port, one in done.left_out.items()]
    lines += told_losses(done.losses)
    show.write("\n".join(lines) + "\n")
    return 1 if not count else 0
