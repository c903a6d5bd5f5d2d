"""A graph inside programs with a loop of their own: FastAPI, a notebook, Qt; and what reaches the host from it."""

from __future__ import annotations

import ast
import asyncio
import contextlib
import inspect
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import hfg
from examples.embedding.thermostat import build
from hfg.errors import NodeError, RunError

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "embedding"


# --- a loop of one's own ---


@pytest.mark.rule("R5", "X3")
@pytest.mark.parametrize("failing", [("a",), ("b",), ("a", "b")], ids=" and ".join)
def test_two_graphs_in_one_block_end_together_and_the_host_task_is_whole_afterwards(failing: tuple[str, ...]) -> None:
    async def host() -> None:
        with pytest.raises(NodeError, match="the sensor in the room has no contact"):  # noqa: PT012  # of the block
            async with hfg.running(build("a")) as first, hfg.running(build("b")) as second:
                for name in failing:
                    await {"a": first, "b": second}[name].trigger("room.unplug")
                await asyncio.Event().wait()
        assert first.report().outcome == ("failed" if "a" in failing else "stopped")
        task = asyncio.current_task()
        assert task is not None
        assert task.cancelling() == 0  # else time limits and task groups of the host misbehave from here on
        await asyncio.sleep(0)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(host())


# --- FastAPI ---


@pytest.fixture
def web() -> Any:
    pytest.importorskip("fastapi", reason="FastAPI is not installed")
    from examples.embedding import web

    return web


def client_of(web: Any, app: Any) -> Any:
    del web
    from fastapi.testclient import TestClient

    return TestClient(app)


@pytest.mark.slow
def test_requests_speak_with_the_graphs_of_an_application(web: Any) -> None:
    with client_of(web, web.application({"room": build, "hall": lambda: build("hall")})) as client:
        before = client.get("/temperature").json()
        assert client.put("/target/30").json() == 30.0
        readings = [float(line) for line in client.get("/temperatures?count=3").text.split()]
        assert before < readings[0] < readings[1] < readings[2]
        assert client.get("/temperature?room=hall").json() > 10
        hall = client.app_state["runs"]["hall"].graph["thermostat"]
        assert hall.ports.parameters["target"].value == 20.0
        assert client.get("/health").json() == ["room", "hall"]
        assert client.get("/temperature?room=attic").status_code == 400
        refused = client.put("/target/99")
        assert refused.status_code == 422
        assert "thermostat.target" in refused.json()["detail"]


@pytest.mark.slow
def test_an_application_whose_graph_fails_says_so_and_asks_to_end(web: Any) -> None:
    asked: list[str] = []
    with client_of(web, web.application({"room": build}, lambda: asked.append("to end"))) as client:
        run = client.app_state["runs"]["room"]
        client.portal.call(run.trigger, "room.unplug")
        with pytest.raises(RunError):
            client.portal.call(run.wait_finished)
        for path in ("/temperature", "/health"):
            answer = client.get(path)
            assert answer.status_code == 503
            assert "the sensor in the room has no contact" in answer.json()["detail"]
    assert asked == ["to end"]


@pytest.mark.slow
def test_an_application_whose_graph_ends_early_goes_on_and_says_so(web: Any) -> None:
    asked: list[str] = []
    with client_of(web, web.application({"room": build}, lambda: asked.append("to end"))) as client:
        client.portal.call(client.app_state["runs"]["room"].stop)
        answer = client.get("/temperature")
        assert answer.status_code == 503
        assert answer.json()["detail"] == 'graph "room" has come to its end'
    assert asked == []


@pytest.fixture
def served(web: Any) -> Iterator[subprocess.Popen[str]]:
    del web
    with subprocess.Popen(
        [sys.executable, "-m", "examples.embedding.web", "0"],
        cwd=FOLDER.parents[1],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    ) as process:
        yield process
        process.kill()


@pytest.mark.slow
def test_ctrl_c_ends_the_server_and_its_graph(served: subprocess.Popen[str]) -> None:
    assert served.stderr is not None
    assert any("Uvicorn running" in line for line in iter(served.stderr.readline, ""))
    served.send_signal(signal.SIGINT)
    said = served.stderr.read()
    assert "Application shutdown complete" in said
    assert "Traceback" not in said
    assert served.wait() in (0, -signal.SIGINT)


# --- a notebook ---


def cells() -> list[str]:
    notebook = json.loads((FOLDER / "notebook.ipynb").read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]


@pytest.mark.slow
def test_cells_of_the_notebook_run_one_after_the_other_on_one_loop(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Jupyter does it: each cell is a task of its own, so the run's block is entered and left by different ones."""
    monkeypatch.syspath_prepend(str(FOLDER))
    names: dict[str, Any] = {}

    async def notebook() -> None:
        for number, cell in enumerate(cells()):
            code = compile(cell, f"cell {number}", "exec", ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)
            outcome = eval(code, names)
            if inspect.iscoroutine(outcome):
                await asyncio.create_task(outcome)

    asyncio.run(notebook())
    assert names["run"].report().outcome == "failed"
    assert "the sensor in the room has no contact" in capsys.readouterr().out


@pytest.mark.slow
def test_notebook_runs_in_a_kernel_of_jupyter(monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat = pytest.importorskip("nbformat", reason="nbclient and ipykernel are not installed")
    nbclient = pytest.importorskip("nbclient", reason="nbclient and ipykernel are not installed")
    pytest.importorskip("ipykernel", reason="nbclient and ipykernel are not installed")
    monkeypatch.setenv("PYTHONPATH", str(FOLDER.parents[1]))
    notebook = nbformat.read(FOLDER / "notebook.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, resources={"metadata": {"path": str(FOLDER)}}).execute()
    said = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert "'stopped'" in json.dumps(said)


# --- Qt ---


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    for package in ("PySide6.QtWidgets", "qasync"):
        pytest.importorskip(package, reason="PySide6-Essentials and qasync are not installed", exc_type=ImportError)
    from examples.embedding import window

    return window


@contextlib.contextmanager
def qt_loop(window: Any) -> Iterator[asyncio.Runner]:
    application = window.QApplication.instance() or window.QApplication([])
    with asyncio.Runner(loop_factory=lambda: window.qasync.QEventLoop(application)) as runner:
        yield runner


@pytest.mark.slow
def test_window_shows_readings_and_ends_the_graph_when_it_is_closed(window: Any) -> None:
    shown: list[str] = []

    def use(opened: Any) -> None:
        opened.slider.setValue(30)

        async def look() -> None:
            while opened.label.text() == "-":
                await asyncio.sleep(0.01)
            shown.append(opened.label.text())
            signal.raise_signal(signal.SIGINT)  # Ctrl-C closes the window

        tasks.append(asyncio.get_running_loop().create_task(look()))

    tasks: list[Any] = []
    with qt_loop(window) as runner:
        assert runner.run(window.main(graph := build(), use)) == "stopped"
    assert shown[0].endswith("°C")
    assert graph["thermostat"].ports.parameters["target"].value == 30.0


@pytest.mark.slow
def test_error_of_the_graph_ends_the_qt_program(window: Any) -> None:
    graph = build()
    graph.connect(graph["room"].ports.outputs["temperature"].sent, graph["room"].ports.slots["unplug"])
    with qt_loop(window) as runner, pytest.raises(NodeError, match="has no contact"):
        runner.run(window.main(graph, lambda _: None))
