"""The command `hfg`: its verbs, and the handling of errors that a verb does not expect.

Depends on `verbs`. Verbs return their exit code; only `main` knows about the process.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer
from typer.exceptions import TyperException

from hfg.cli import show
from hfg.cli.interrupt import Interrupt
from hfg.cli.verbs import Verbs
from hfg.errors import FileError, HfgError, TargetError

app = typer.Typer(
    name="hfg",
    cls=Verbs,
    help="Build, check and run activity flow graphs.",
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    show_version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    """Build, check and run activity flow graphs."""
    if show_version:
        sys.stdout.write(f"hfg {version('hfg')}\n")
        raise typer.Exit
    if context.invoked_subcommand is None:
        sys.stdout.write(context.get_help() + "\n")
        raise typer.Exit


@contextmanager
def _streams() -> Iterator[None]:
    """Handle a standard output or standard error that is closed, before or meanwhile (`hfg nodes | head`)."""
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere, ExitStack() as replaced:
        if sys.stdout is None:
            replaced.enter_context(redirect_stdout(nowhere))
        if sys.stderr is None:
            replaced.enter_context(redirect_stderr(nowhere))
        try:
            yield
            sys.stdout.flush()
        except OSError as error:
            if error.filename is not None:  # of a file, not of a stream
                raise
            os.dup2(nowhere.fileno(), sys.stdout.fileno())  # Python flushes it once more as it leaves
            if not isinstance(error, BrokenPipeError):
                with suppress(OSError):  # the terminal of both may be gone
                    show.sentence(f"standard output cannot be written: {error.strerror}")
            sys.exit(1)
        finally:
            try:
                sys.stderr.flush()
            except OSError:
                os.dup2(nowhere.fileno(), sys.stderr.fileno())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command. Return its exit code.

    Args:
      arguments: arguments after "hfg"; by default those of the process.
    """
    show.set_arguments(sys.argv[1:] if arguments is None else arguments)
    with Interrupt.installed(), _streams():
        try:
            code = app(args=arguments, prog_name="hfg", standalone_mode=False)
        except TyperException as error:
            said = error.format_message().rstrip(".").replace("Value error, ", "")
            show.sentence(f"{said}; hfg --help shows what there is")
            return 2
        except TargetError as error:
            show.user_traceback(error.__cause__)
            show.sentence(str(error))
            return 2
        except FileError as error:
            show.sentence(str(error))
            show.wants(error)
            return 2
        except HfgError as error:
            show.failure(error)
            return 1
        except OSError as error:
            if error.filename is None:  # of a stream, see there
                raise
            show.sentence(f'"{error.filename}" cannot be used: {error.strerror}')  # by --install-completion
            return 1
        except (KeyboardInterrupt, typer.Abort):
            code = Interrupt.TYPERS_CODE
        if code == Interrupt.TYPERS_CODE:
            show.sentence("interrupted")
            return 1
        return int(code or 0)
