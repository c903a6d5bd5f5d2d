"""`python -m hfg` is the command `hfg`."""

from __future__ import annotations

import sys

from hfg.cli import main

__all__: list[str] = []

if __name__ == "__main__":
    sys.exit(main())
