"""The ordinary suite is the same each time; `make soak` draws examples that nobody has seen.

With `--fuse-after 0` all runs fuse their regions from the first firing on. `--fast` takes half a minute: it runs the
first cases of each test that is not marked `slow`.
"""

from __future__ import annotations

import gc
import logging
import os
import signal
import sys
from collections import Counter
from collections.abc import Generator

import pytest
from hypothesis import settings

from hfg.engine.runtime import settings as run_settings
from tests.limits import patience

# No deadline: how long an example takes says something of the machine only.
settings.register_profile("suite", derandomize=True, deadline=None)
settings.register_profile("soak", derandomize=False, print_blob=True, deadline=None)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--fuse-after", type=int, default=None, help="fuse regions after so many firings of their head; 0: at once"
    )

    parser.addoption("--fast", action="store_true", help="no slow tests, and only the first cases of the others")


def pytest_configure(config: pytest.Config) -> None:
    if config.option.fuse_after is not None:
        run_settings.FUSE_AFTER = config.option.fuse_after
    settings.load_profile("soak" if config.option.markexpr == "soak" else "suite")
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # by a shell that runs the tests in the background
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Limits end what hangs, and nothing else: they are longer on a slow machine."""
    usual = float(config.getini("timeout") or 0)
    for item in items:
        marker = item.get_closest_marker("timeout")
        seconds = marker.args[0] if marker is not None and marker.args else usual
        item.add_marker(pytest.mark.timeout(patience(seconds)), append=False)
    if config.option.fast:
        _keep_the_fast(config, items)


FIRST_CASES = 2
LONG_S = 0.25


def _keep_the_fast(config: pytest.Config, items: list[pytest.Item]) -> None:
    cases: Counter[str] = Counter()
    left_out, kept = [], []
    for item in items:
        test = item.nodeid.partition("[")[0]
        is_slow = item.get_closest_marker("slow") is not None
        cases[test] += not is_slow
        (left_out if is_slow or cases[test] > FIRST_CASES else kept).append(item)
    config.hook.pytest_deselected(items=left_out)
    items[:] = kept


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """With `--fast`, count the processor time of a test, with that of the processes that it has waited for."""
    if not item.config.option.fast:
        return (yield)
    before = sum(os.times()[:4])
    try:
        return (yield)
    finally:
        item.user_properties.append(("cpu_s", sum(os.times()[:4]) - before))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the tests that should have been marked: nothing fails, for the machine may be the reason."""
    if not terminalreporter.config.option.fast:
        return
    reports = [one for one in terminalreporter.getreports("passed") if one.when == "call"]
    long = [(dict(one.user_properties).get("cpu_s", 0.0), one.nodeid) for one in reports]
    for seconds, test in sorted(long, reverse=True):
        if float(str(seconds)) > LONG_S:
            terminalreporter.write_line(f"{test} took {seconds:.2f} s of processor time: @pytest.mark.slow?")


@pytest.fixture(autouse=True, scope="session")
def _state_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Generator[None, None, None]:
    """Programs of a test meet nobody else, neither those of another test process nor those of who runs the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """What a test has shown goes from process to process, which text with half a character does not."""
    report = yield
    report.sections = [(name, text.encode("utf-8", "backslashreplace").decode()) for name, text in report.sections]
    return report


@pytest.fixture(autouse=True, scope="session")
def _caches_are_their_own(tmp_path_factory: pytest.TempPathFactory) -> Generator[None, None, None]:
    """Nothing is read from, or written to, the user's folder for caches."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


_LOGGERS = tuple(logging.getLogger(name) for name in (None, "hfg", "hfg.node", "hfg.graph"))


@pytest.fixture(autouse=True)
def _loggers_are_as_they_were() -> Generator[None, None, None]:
    """A command line that a test has called in this process leaves no level and no handler behind."""
    kept = [(one, one.level, one.propagate, one.disabled, list(one.handlers)) for one in _LOGGERS]
    yield
    for one, level, propagate, disabled, handlers in kept:
        one.setLevel(level)
        one.propagate, one.disabled, one.handlers[:] = propagate, disabled, handlers


@pytest.fixture(autouse=True)
def _modules_are_as_they_were(tmp_path_factory: pytest.TempPathFactory) -> Generator[None, None, None]:
    """A test leaves neither its folders on the path nor its own modules: another test has a `robot.py` too."""
    path, loaded = list(sys.path), set(sys.modules)
    yield
    sys.path[:] = path
    folder = str(tmp_path_factory.getbasetemp())
    for name in set(sys.modules) - loaded:
        if (getattr(sys.modules[name], "__file__", None) or "").startswith(folder):
            del sys.modules[name]


def pytest_collection_finish() -> None:
    """The collector need not look at thousands of tests and their modules again and again: they stay anyway."""
    gc.collect()
    gc.freeze()
