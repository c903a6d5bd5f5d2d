"""The catalogue: the available node types, and a description of each.

    documentation   reads the docstring of a node type
    describing      a node type in words and plain data: ports, parameters, errors, names in CS::APEX
    offers          where node types may be: the standard library, installed packages, the project
    finding         imports those places and lists their types; reports broken ones and continues
    searching       by words, by name, by category
    keeping         the index of installed types, in a file, so that a search imports nothing

Depends on node types, not on graphs, runs or the command line. Everything is imported on demand: `installed()` imports
every place, `installed_index()` only if something has changed, and `hfg.registry.find` one module.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hfg.base.lazy import on_demand
from hfg.catalogue.offers import Offer, offers  # now: a module and its function have the same name

if TYPE_CHECKING:
    from hfg.catalogue.describing import (
        ErrorDescription,
        ParameterDescription,
        PortDescription,
        TypeDescription,
        describe_type,
        undocumented,
    )
    from hfg.catalogue.finding import Catalogue, installed, types_of
    from hfg.catalogue.keeping import Kept, installed_index
    from hfg.catalogue.searching import Entry, Index, categories, index_of, named, near_words, ranked, search, unmatched

__all__ = [
    "Catalogue",
    "Entry",
    "ErrorDescription",
    "Index",
    "Kept",
    "Offer",
    "ParameterDescription",
    "PortDescription",
    "TypeDescription",
    "categories",
    "describe_type",
    "index_of",
    "installed",
    "installed_index",
    "named",
    "near_words",
    "offers",
    "ranked",
    "search",
    "types_of",
    "undocumented",
    "unmatched",
]

if not TYPE_CHECKING:
    __getattr__ = on_demand(
        __name__,
        {
            "describing": (
                "ErrorDescription",
                "ParameterDescription",
                "PortDescription",
                "TypeDescription",
                "describe_type",
                "undocumented",
            ),
            "finding": ("Catalogue", "installed", "types_of"),
            "keeping": ("Kept", "installed_index"),
            "searching": (
                "Entry",
                "Index",
                "categories",
                "index_of",
                "named",
                "near_words",
                "ranked",
                "search",
                "unmatched",
            ),
        },
    )
