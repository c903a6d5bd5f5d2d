"""Verbs are imported when they are used."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest
import typer.main

from hfg.cli.app import app

VERBS = typer.main.get_group(app).commands


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_says_the_same_in_the_list_and_of_itself(name: str, command: Callable[..., Any]) -> None:
    said = VERBS[name].help
    assert said
    shown = command(name, "--help")
    assert shown.code == 0
    assert " ".join(said.split())[:40] in " ".join(shown.out.split())


@pytest.mark.slow
def test_the_list_of_verbs_imports_none_of_them() -> None:
    code = """if True:
        import sys
        from hfg.cli.app import main
        main(["--help"])
        verbs = ("run", "agent", "info", "nodes", "new")
        print([one for one in verbs if f"hfg.cli.{one}" in sys.modules])
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert " deploy " in done.stdout
    assert done.stdout.splitlines()[-1] == "[]"
