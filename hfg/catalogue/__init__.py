"""The catalogue: which node types there are, and what each of them is.

    documentation   reads the docstring of a node type
    describing      a node type in words and plain data: ports, parameters, errors, names in CS::APEX
    offers          where node types may be: the standard library, installed packages, the project
    finding         imports those places and lists their types; what is broken is told and stops nobody
    searching       by words, by name, by category
    page            docs/nodes, written from the catalogue

Stands on the node types' floor; knows neither graphs, runs nor the command line. Nothing is imported before it is asked
for: `installed()` imports every place, `hfg.registry.find` one module.
"""

from __future__ import annotations

from hfg.catalogue.describing import (
    ErrorDescription,
    ParameterDescription,
    PortDescription,
    TypeDescription,
    describe_type,
    undocumented,
)
from hfg.catalogue.finding import Catalogue, installed, types_of
from hfg.catalogue.offers import Offer, offers
from hfg.catalogue.searching import categories, named, search

__all__ = [
    "Catalogue",
    "ErrorDescription",
    "Offer",
    "ParameterDescription",
    "PortDescription",
    "TypeDescription",
    "categories",
    "describe_type",
    "installed",
    "named",
    "offers",
    "search",
    "types_of",
    "undocumented",
]
