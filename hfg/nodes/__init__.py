"""The standard library of nodes: one family per module, written on the lower layers as a user would.

    import hfg
    from hfg.nodes import flow

    graph.add(flow.delay(seconds=0.5))

Everything is imported on first use, so `import hfg.nodes` is cheap; families that depend on other packages (OpenCV,
matplotlib) say which extra is missing when they are used. `hfg nodes` lists what there is, `docs/nodes` describes it.
`from_module` makes node types of the functions of any module.
"""

from __future__ import annotations

from pkgutil import iter_modules

from hfg.base.lazy import on_demand

__all__: list[str] = []  # families are found by their names, see __getattr__


__getattr__ = on_demand(__name__, {"modules": ["from_module"]})


def __dir__() -> list[str]:
    return sorted({*globals(), *(found.name for found in iter_modules(__path__) if found.name[0] != "_")})
