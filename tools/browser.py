"""Chromium, a studio in a process of its own, and somebody at its page: for stories, benchmarks and pictures.

Needs Chromium, and the package playwright of the extra test.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page, ViewportSize

__all__ = ["CHROMIUM", "LISTENING", "WINDOW", "Person", "StudioProcess", "browsers", "reserved_port"]

ROOT = Path(__file__).resolve().parents[1]
CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), ""
)
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--disable-background-networking", "--disable-sync"]
WINDOW: ViewportSize = {"width": 1440, "height": 900}
_ENDS_S = 10.0

LISTENING = """
window.link = new EventTarget();
window.WebSocket = class extends WebSocket {
  constructor(...args) {
    super(...args);
    const tell = (what, data) => link.dispatchEvent(Object.assign(new Event(what), {data}));
    this.addEventListener("open", () => tell("opened"));
    this.addEventListener("close", () => tell("closed"));
    this.addEventListener("message", event => typeof event.data === "string" && tell("told", event.data));
    this.tell = tell;
  }
  send(data) {
    this.tell("asked", data);
    super.send(data);
  }
};
"""
"""For the page, before anything else: `link` has an event for each text that the page sends or is sent, as it is."""


@contextmanager
def browsers() -> Iterator[Browser]:
    """Open Chromium, which draws without a graphics card."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright, playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS) as browser:
        yield browser


@contextmanager
def reserved_port() -> Iterator[int]:
    """Find a port that no other program is given while a server is not yet, or no longer, listening on it.

    On Linux, it stays bound without listening, so that only a server that names the port can take it.
    """
    with ExitStack() as held:
        first = held.enter_context(_bound(socket.AF_INET, "127.0.0.1", 0))
        port: int = first.getsockname()[1]
        with suppress(OSError):  # there is no IPv6 here
            held.enter_context(_bound(socket.AF_INET6, "::1", port))
        if sys.platform != "linux":
            held.close()
        yield port


def _bound(family: int, host: str, port: int) -> socket.socket:
    held = socket.socket(family, socket.SOCK_STREAM)
    try:
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        held.bind((host, port))
    except OSError:
        held.close()
        raise
    return held


class StudioProcess:
    """`hfg studio` in a process of its own, which can be killed and started again at the same port.

    Attributes:
      address: of the page, with its token.
      process: the process; another one after each start.
    """

    address: str
    process: subprocess.Popen[str]

    def __init__(self, *arguments: str, folder: Path | None = None) -> None:
        """Start it.

        Args:
          arguments: of the command.
          folder: where it runs, and keeps its journal; default: a folder of its own.
        """
        self._held = ExitStack()
        self._folder = folder or Path(self._held.enter_context(tempfile.TemporaryDirectory(prefix="hfg-studio-")))
        port = self._held.enter_context(reserved_port())
        self._command = [sys.executable, "-m", "hfg", "studio", "--no-browser", "--port", str(port), *arguments]
        self.start()

    def start(self) -> None:
        """Start it, and wait until it serves pages."""
        paths = f"{ROOT}{os.pathsep}{ROOT / 'transports'}"
        self.process = subprocess.Popen(
            self._command, cwd=self._folder, stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": paths}
        )
        assert self.process.stdout is not None
        found = next((one for line in self.process.stdout if (one := re.search(r"http://\S+", line))), None)
        if found is None:
            self.close()
            raise RuntimeError(f"hfg studio ended with {self.process.returncode}")
        self.address = found[0]

    def kill(self) -> None:
        """End it suddenly."""
        self.process.send_signal(signal.SIGKILL)
        self._wait()

    def end(self) -> None:
        """End it as Ctrl-C does."""
        self.process.send_signal(signal.SIGINT)
        self._wait()

    def _wait(self) -> None:
        self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()

    def close(self) -> None:
        """End it, however long that takes, and give the port back."""
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(_ENDS_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
        self._wait()
        self._held.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Person:
    """Somebody at the page of a studio.

    Attributes:
      page: the page.
    """

    def __init__(self, page: Page, address: str) -> None:
        self.page = page
        page.goto(address)
        page.locator("[data-node], .start").first.wait_for()

    def node(self, path: str) -> Locator:
        """Find a node."""
        return self.page.locator(f'[data-node="{path}"]')

    def port(self, path: str) -> Locator:
        """Find a port at its node."""
        return self.page.locator(f'#canvas [data-port="{path}"]')

    def select(self, path: str) -> None:
        """Click on a node, where nothing else lies on it."""
        self.node(path).locator(".t b").click()

    def press(self, *keys: str) -> None:
        """Press keys, one after the other."""
        for key in keys:
            self.page.keyboard.press(key)

    def middle(self, element: Locator) -> tuple[float, float]:
        """Return where on the screen the middle of an element is."""
        box = element.bounding_box()
        assert box is not None
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def empty_place(self) -> tuple[float, float]:
        """Return a place of the canvas where nothing is, as far to the lower right as there is one."""
        x, y = self.page.evaluate(
            """() => {
              const box = document.getElementById("canvas").getBoundingClientRect();
              for (let y = box.bottom - 60; y > box.top + 60; y -= 8)
                for (let x = box.right - 60; x > box.left + 60; x -= 8)
                  if (document.elementFromPoint(x, y)?.classList.contains("react-flow__pane")) return [x, y];
            }"""
        )
        return x, y
