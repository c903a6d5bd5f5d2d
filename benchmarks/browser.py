"""A studio in a process of its own, and its page in Chromium, with stopwatches in the page.

A stopwatch runs from the browser's stamp of what the person did until a frame that shows the consequence is painted.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.measure import ROOT

if TYPE_CHECKING:
    from playwright.sync_api import Browser, CDPSession, Locator, Page

__all__ = ["CHROMIUM", "Looker", "StudioProcess", "browsers", "percentile", "resident_mb"]

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), ""
)
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync"]
PATIENCE_MS = 60_000

STOPWATCH = """
window.painted = act => {
  const channel = new MessageChannel();
  channel.port1.onmessage = act;
  channel.port2.postMessage(null);
};
window.moment = (type, holds) => window.measured = new Promise(done =>
  addEventListener(type, event => {
    const look = () => {
      if (!holds()) requestAnimationFrame(look);
      else painted(() => done(performance.now() - event.timeStamp));
    };
    requestAnimationFrame(look);
  }, {capture: true, once: true}));
window.heard = {run: null, moves: []};
window.WebSocket = class extends WebSocket {
  constructor(...args) {
    super(...args);
    this.addEventListener("message", event => {
      if (typeof event.data !== "string") return;
      const message = JSON.parse(event.data);
      if (message.t === "snapshot") heard.run = message.tables.studio.run;
      for (const [table, key, record] of message.t === "patch" ? message.ops : [])
        if (table === "studio" && key === "run") heard.run = record;
      if (message.t === "data" && message.value?.moves) heard.moves.push(...message.value.moves);
    });
  }
};
const hasWord = () => {
  const word = document.querySelector(".live");
  return word !== null && !/away|connecting/.test(word.textContent) && document.querySelector("[data-node]") !== null;
};
window.becomes = state => new Promise(done => {
  const look = () => {
    if (hasWord() !== state) requestAnimationFrame(look);
    else painted(() => done(performance.timeOrigin + performance.now()));
  };
  requestAnimationFrame(look);
});
window.ready = becomes(true);
"""


class StudioProcess:
    """`hfg studio` in a process of its own.

    Attributes:
      address: of the page, with its token.
    """

    def __init__(self, *arguments: str) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="hfg-bench-")  # of its journal
        self._command = [sys.executable, "-m", "hfg", "studio", "--no-browser", *arguments]
        self._begin()

    def _begin(self) -> None:
        paths = f"{ROOT}{os.pathsep}{ROOT / 'transports'}"
        self.process = subprocess.Popen(
            self._command,
            cwd=self._folder.name,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": paths},
        )
        assert self.process.stdout is not None
        found = next((one for line in self.process.stdout if (one := re.search(r"http://\S+", line))), None)
        if found is None:
            raise RuntimeError(f"hfg studio ended with {self.process.wait()}")
        self.address = found[0]

    def kill_and_restart(self) -> float:
        """Kill it, start it again at the same port, and return when it served again."""
        port = self.address.split(":")[2].partition("/")[0]
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        if "--port" not in self._command:
            self._command += ["--port", port]
        self._begin()
        return time.time()

    def close(self) -> None:
        """End it."""
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
        self._folder.cleanup()


@contextmanager
def browsers() -> Iterator[Browser]:
    """Open Chromium, which draws without a graphics card."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


class Looker:
    """A person at the page."""

    def __init__(self, browser: Browser, address: str, *, calm: bool = False) -> None:
        motion = "reduce" if calm else "no-preference"
        self.context = browser.new_context(viewport={"width": 1440, "height": 900}, reduced_motion=motion)  # type: ignore[arg-type]
        self.context.set_default_timeout(PATIENCE_MS)
        self.page: Page = self.context.new_page()
        self.page.add_init_script(STOPWATCH)
        self.began = time.time()
        self.page.goto(address)
        self.page.locator("[data-node]").first.wait_for()
        self.ready_ms: float = self.page.evaluate("window.ready") - self.began * 1000
        self.cdp: CDPSession = self.context.new_cdp_session(self.page)

    def node(self, path: str) -> Locator:
        return self.page.locator(f'[data-node="{path}"]')

    def port(self, path: str) -> Locator:
        return self.page.locator(f'#canvas [data-port="{path}"]')

    def select(self, path: str) -> None:
        """Click on the name of a node."""
        self.node(path).locator(".t b").click()

    def middle(self, element: Locator) -> tuple[float, float]:
        box = element.bounding_box()
        assert box is not None
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def takes(self, event: str, holds: str, act: Callable[[], object]) -> float:
        """Return the milliseconds from an event to the first painted frame for which an expression is true."""
        self.page.evaluate(f"() => {{ moment({event!r}, () => {holds}); }}")
        act()
        return float(self.page.evaluate("window.measured"))

    def empty_place(self) -> tuple[float, float]:
        """Return a place of the canvas where nothing is."""
        x, y = self.page.evaluate(
            """() => {
              const box = document.getElementById("canvas").getBoundingClientRect();
              for (let y = box.bottom - 80; y > box.top + 80; y -= 8)
                for (let x = box.right - 80; x > box.left + 80; x -= 8)
                  if (document.elementFromPoint(x, y)?.classList.contains("react-flow__pane")) return [x, y];
            }"""
        )
        return x, y

    def busy(self, seconds: float) -> tuple[float, float]:
        """Return which share of the time the main thread works, and which share of a processor that takes it."""
        clocks = [self.cdp, self.context.new_cdp_session(self.page)]
        for session, domain in zip(clocks, ("timeTicks", "threadTicks"), strict=True):
            session.send("Performance.enable", {"timeDomain": domain})

        def spent(session: CDPSession) -> float:
            metrics: list[dict[str, Any]] = session.send("Performance.getMetrics")["metrics"]
            return next(float(one["value"]) for one in metrics if one["name"] == "TaskDuration")

        before, began = [spent(one) for one in clocks], time.perf_counter()
        self.page.wait_for_timeout(1000 * seconds)
        after, took = [spent(one) for one in clocks], time.perf_counter() - began
        wall, cpu = (100 * (b - a) / took for a, b in zip(before, after, strict=True))
        return wall, cpu

    def frames(self, act: Callable[[], object]) -> tuple[float, float]:
        """Return frames a second, and the longest task in milliseconds, while something is done."""
        self.page.evaluate(
            """() => {
              window.frames_ = {count: 0, began: performance.now(), longest: 0, on: true};
              const count = () => { if (frames_.on) { frames_.count++; requestAnimationFrame(count); } };
              requestAnimationFrame(count);
              frames_.observer = new PerformanceObserver(list => {
                for (const one of list.getEntries()) frames_.longest = Math.max(frames_.longest, one.duration);
              });
              frames_.observer.observe({type: "longtask"});
            }"""
        )
        act()
        rate, longest = self.page.evaluate(
            """() => {
              frames_.on = false;
              const last = frames_.observer.takeRecords().map(one => one.duration);
              frames_.longest = Math.max(frames_.longest, ...last);
              return [1000 * frames_.count / (performance.now() - frames_.began), frames_.longest];
            }"""
        )
        return rate, longest

    def close(self) -> None:
        self.context.close()


def resident_mb(process: int) -> float:
    """Return how much memory of a process is resident, on Linux."""
    status = Path(f"/proc/{process}/status").read_text()
    return float(status.partition("VmRSS:")[2].split()[0]) / 1024


def percentile(values: list[float], share: float = 0.95) -> float:
    """Return the value that this share of all values does not exceed."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
