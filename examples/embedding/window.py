"""A graph inside a Qt program: qasync lets Qt and asyncio share one loop, so the graph needs no thread.

The slider sets a parameter of the graph, the label shows what a tap sees, at most ten times per second. Closing the
window or Ctrl-C leaves the block, which ends the graph; if the graph fails, the program ends with its error. Run it
with `python -m examples.embedding.window` (`pip install PySide6-Essentials qasync`).
"""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import AsyncIterable, Callable

import qasync
from PySide6.QtCore import Qt
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import QApplication, QLabel, QSlider, QVBoxLayout, QWidget

import hfg
from examples.embedding.thermostat import build


class Window(QWidget):
    """A slider and a label.

    Attributes:
      closed: set when the user has closed it.
    """

    def __init__(self, set_target: Callable[[float], None]) -> None:
        super().__init__()
        self.closed = asyncio.Event()
        self.label = QLabel("-")
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setRange(5, 30)
        self.slider.setValue(20)
        self.slider.valueChanged.connect(lambda degrees: set_target(float(degrees)))
        layout = QVBoxLayout(self)
        layout.addWidget(self.label)
        layout.addWidget(self.slider)

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802  # Qt's name
        self.closed.set()
        event.accept()

    async def show_readings(self, tap: AsyncIterable[hfg.Token[float]]) -> None:
        async for token in tap:
            if isinstance(token.value, float):
                self.label.setText(f"{token.value:.1f} °C")


async def main(graph: hfg.Graph, begun: Callable[[Window], object] = Window.show) -> str:
    """Run the graph until the window is closed or the graph has come to its end; gives how it ended."""
    async with hfg.running(graph) as run:
        window = Window(lambda degrees: run.set("thermostat.target", degrees))
        showing = asyncio.create_task(window.show_readings(run.tap("room.temperature", max_rate_hz=10)))
        closing = asyncio.create_task(window.closed.wait())
        former = signal.signal(signal.SIGINT, lambda *_: window.close())
        begun(window)
        try:
            await asyncio.wait({showing, closing}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            signal.signal(signal.SIGINT, former)
            window.close()
            showing.cancel()
            closing.cancel()
    return run.report().outcome


if __name__ == "__main__":
    application = QApplication(sys.argv)
    with asyncio.Runner(loop_factory=lambda: qasync.QEventLoop(application)) as runner:
        runner.run(main(build()))
