"""Stopwatches in the page of a studio.

A stopwatch runs from the browser's stamp of what the person did until a frame that shows the consequence is painted.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tools.browser import LISTENING, WINDOW, Person

if TYPE_CHECKING:
    from playwright.sync_api import Browser, CDPSession

__all__ = ["Looker", "percentile", "resident_mb"]

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
link.addEventListener("told", event => {
  const message = JSON.parse(event.data);
  if (message.t === "snapshot") heard.run = message.tables.studio.run;
  for (const [table, key, record] of message.t === "patch" ? message.ops : [])
    if (table === "studio" && key === "run") heard.run = record;
  if (message.t === "data" && message.value?.moves) heard.moves.push(...message.value.moves);
});
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


class Looker(Person):
    """A person at the page, with stopwatches.

    Attributes:
      ready_ms: from opening the address to painted nodes and a live connection.
    """

    def __init__(self, browser: Browser, address: str, *, calm: bool = False) -> None:
        motion = "reduce" if calm else "no-preference"
        self.context = browser.new_context(viewport=WINDOW, reduced_motion=motion)  # type: ignore[arg-type]
        self.context.set_default_timeout(PATIENCE_MS)
        page = self.context.new_page()
        page.add_init_script(LISTENING + STOPWATCH)
        began = time.time()
        super().__init__(page, address)
        self.ready_ms: float = page.evaluate("window.ready") - began * 1000
        self.cdp: CDPSession = self.context.new_cdp_session(page)

    def takes(self, event: str, holds: str, act: Callable[[], object]) -> float:
        """Return the milliseconds from an event to the first painted frame for which an expression is true."""
        self.page.evaluate(f"() => {{ moment({event!r}, () => {holds}); }}")
        act()
        return float(self.page.evaluate("window.measured"))

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
