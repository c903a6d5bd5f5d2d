"""The fixtures of the plugin, also where hfg is not installed and its entry point not there."""

from hfg.testing.pytest_plugin import run_graph, virtual_time

__all__ = ["run_graph", "virtual_time"]
