"""Packages that only some families need: a missing one is reported in one message."""

from __future__ import annotations

import importlib
import sys
from typing import Any


def require(module: str, extra: str) -> Any:
    """Import a package that an extra of hfg installs, and give it.

    Args:
      module: what is imported: "cv2".
      extra: the extra that installs it: "vision".

    Raises:
      ModuleNotFoundError: it is not installed; the message says who needs it and what to install.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise  # it is there, what it stands on itself is not
        caller = sys._getframe(1).f_globals.get("__name__", "this")
        raise ModuleNotFoundError(
            f'{caller} needs {_CALLED.get(module, module)}: pip install "hfg[{extra}]"', name=module
        ) from None


_CALLED = {"cv2": "OpenCV", "PIL": "Pillow"}
