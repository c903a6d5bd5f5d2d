"""`hfg recover FILE -o OUTPUT`: makes a complete recording of one that is damaged or was cut off. Depends on `show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hfg.cli import show
from hfg.cli.info import told_losses
from hfg.cli.options import ForceOption
from hfg.errors import TargetError, UsageError
from hfg.recording import recover as recover_recording


def recover(
    file: Annotated[Path, typer.Argument(help="a recording, or any MCAP file")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The new recording.")],
    force: ForceOption = False,
) -> int:
    """Write everything that can be read from a damaged recording to a new file, and report what is lost."""
    try:
        count, losses = recover_recording(file, output, force=force)
    except UsageError as error:
        raise TargetError(str(error)) from None
    found = f"{count:,} message{'s' * (count != 1)}"
    lines = [f"{output}: {found} of {file}", *(told_losses(losses) or ["nothing is lost"])]
    show.write("\n".join(lines) + "\n")
    return 1 if losses and not count else 0
