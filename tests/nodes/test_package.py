"""The package of the standard library: light, and a family is there when it is named."""

from __future__ import annotations

import subprocess
import sys

import pytest

import hfg.nodes


def test_no_family_is_imported_before_it_is_asked_for() -> None:
    told = "import sys, hfg.nodes; print([name for name in sys.modules if name.startswith('hfg.nodes.')])"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_what_is_no_family_is_no_attribute() -> None:
    with pytest.raises(AttributeError, match="no attribute 'no_such_family'"):
        _ = hfg.nodes.no_such_family
    assert not hasattr(hfg.nodes, "_private")
