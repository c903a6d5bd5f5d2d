"""What a page asks for once: targets of an edge, node types, a value, measures, files. Depends on what answers each.

A page sends `{"t": "ask", "id": 7, "what": "states", "args": {}}` and gets `{"t": "answer", "id": 7, "value": ...}`,
or a `reject`. The value of each question is described where it is made; that of `states` in `hfg.studio.states`.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Final, Literal

import msgspec

from hfg.base.token import Token
from hfg.graph.structure.level import inside, level_of
from hfg.graph.structure.paths import node_at, parameter_at
from hfg.studio.amending import amended, text_of_graph
from hfg.studio.annotating import Annotate, annotate
from hfg.studio.capturing import level_as_svg, value_as_file
from hfg.studio.choosing import edge_options, gates, operators, promotions, stops
from hfg.studio.clipboard import pasted, text_of_nodes
from hfg.studio.following import Following
from hfg.studio.leading_out import shown_by, ways_out
from hfg.studio.muting import muted
from hfg.studio.palette import search_types, type_of_reference
from hfg.studio.places import place_at
from hfg.studio.refusing import Refused
from hfg.studio.running_elsewhere import runs_of_this_user
from hfg.studio.sampled_topics import node_measures
from hfg.studio.showing import shown_value
from hfg.studio.starters import starters
from hfg.studio.states import states_of
from hfg.studio.targets import targets

__all__ = ["ask"]


async def ask(host: Following, what: str, args: dict[str, Any]) -> Any:
    """Answer a question.

    Raises:
      HfgError: it cannot be answered.
    """
    known = _ANSWERS.get(what)
    if known is None:
        raise Refused("unknown", f'a page asks for one of {", ".join(_ANSWERS)}, got "{what:.40}"')
    fields, answer = known
    try:
        said = msgspec.convert(args, fields)
    except msgspec.ValidationError as error:
        raise Refused("usage", f'"{what}" is asked with {", ".join(fields.__struct_fields__)}: {error}') from None
    return await answer(host, said)


class _Args(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Arguments of a question."""


class _Nothing(_Args, frozen=True):
    pass


class _Path(_Args, frozen=True):
    path: str


class _Targets(_Args, frozen=True):
    port: str
    moving: str = ""


class _Search(_Args, frozen=True):
    words: str = ""
    port: str = ""
    category: str = ""
    most: int = 50


class _Type(_Args, frozen=True):
    reference: str


class _Said(_Args, frozen=True):
    path: str
    text: str


class _ValueFile(_Args, frozen=True):
    path: str
    kind: Literal["csv", "npy"]


class _Level(_Args, frozen=True):
    level: str = ""
    view: Literal["", "activity", "mission", "all"] = ""


class _Paths(_Args, frozen=True):
    paths: list[str]


class _Paste(_Args, frozen=True):
    text: str
    level: str = ""


class _Name(_Args, frozen=True):
    name: str
    level: str = ""


async def _targets(host: Following, args: _Targets) -> Any:
    return targets(host.graph, args.port, args.moving)


async def _search(host: Following, args: _Search) -> Any:
    return await search_types(host.graph, args.words, args.port, args.category, min(max(args.most, 1), 1000))


async def _type(host: Following, args: _Type) -> Any:
    return await asyncio.to_thread(type_of_reference, args.reference, host.project.allow)


async def _value(host: Following, args: _Path) -> Any:
    return await asyncio.to_thread(shown_value, await _next_token(host, args.path))


async def _value_file(host: Following, args: _ValueFile) -> Any:
    token = await _next_token(host, args.path)
    return await asyncio.to_thread(value_as_file, token.value, args.path, args.kind)


async def _svg(host: Following, args: _Level) -> Any:
    return await asyncio.to_thread(level_as_svg, host.graph, args.level, args.view)


async def _states(host: Following, args: _Nothing) -> Any:
    return await states_of(host.graph, lambda: host.tables.rev)


async def _next_token(host: Following, path: str) -> Token[Any]:
    """Wait until something passes a place of the run."""
    run = host.steering.run
    if run is None:
        raise Refused("state", "the graph does not run, so nothing passes there")
    with run.tap(place_at(host.graph, path), size=1) as tap:
        try:
            async with asyncio.timeout(_PATIENCE_S):
                return await anext(tap)
        except (TimeoutError, StopAsyncIteration):
            raise Refused("state", f'nothing has passed "{path}" within {_PATIENCE_S:g} s') from None


_PATIENCE_S: Final = 2.0


async def _read_text(host: Following, args: _Said) -> Any:
    port = parameter_at(level_of(host.graph), args.path)
    return {"value": port.spec.encode(port.spec.read_text(args.text))}


async def _node(host: Following, args: _Path) -> Any:
    return node_measures(host, args.path)


async def _folder(host: Following, args: _Path) -> Any:
    return host.project.listing(args.path)


async def _start(host: Following, args: _Nothing) -> Any:
    listed = host.project.listing("")
    runs = await asyncio.to_thread(runs_of_this_user)
    offered = await asyncio.to_thread(starters)
    return {"folder": host.project.folder.name, "files": listed["files"], "runs": runs, "starters": offered}


async def _difference(host: Following, args: _Nothing) -> Any:
    return host.project.difference()


async def _text(host: Following, args: _Paths) -> Any:
    return {"text": text_of_nodes(host.graph, args.paths)}


async def _paste(host: Following, args: _Paste) -> Any:
    return {"commands": pasted(host.graph, args.text, args.level, host.project.allow)}


async def _free_name(host: Following, args: _Name) -> Any:
    root = level_of(host.graph)
    level = root if not args.level else inside(node_at(root, args.level))
    if level is None:
        raise Refused("unknown", f'"{args.level}" is not a subgraph, so nothing is inside it', args.level)
    name = re.sub(r"\W+", "_", args.name).strip("_") or "node"
    return {"name": level.members.free_name(name)[0]}


async def _gates(host: Following, args: _Path) -> Any:
    return gates(host.graph, args.path)


async def _promotions(host: Following, args: _Path) -> Any:
    return promotions(host.graph, args.path)


async def _edge(host: Following, args: _Path) -> Any:
    return edge_options(host.graph, args.path, runs=host.steering.run is not None)


async def _operators(host: Following, args: _Nothing) -> Any:
    return operators(host.graph)


async def _stops(host: Following, args: _Path) -> Any:
    return stops(host.graph, args.path)


async def _ways_out(host: Following, args: _Path) -> Any:
    return ways_out(host.graph, args.path)


async def _shown_by(host: Following, args: _Path) -> Any:
    return shown_by(host.graph, args.path)


async def _muted(host: Following, args: _Path) -> Any:
    return muted(host.graph, args.path)


async def _annotate(host: Following, args: Annotate) -> Any:
    return annotate(host.graph, args)


class _Amended(_Args, frozen=True):
    before: str
    after: str


async def _file(host: Following, args: _Nothing) -> Any:
    return text_of_graph(host.project)


async def _amended(host: Following, args: _Amended) -> Any:
    return await asyncio.to_thread(amended, host.project, args.before, args.after)


_ANSWERS: Final[Mapping[str, tuple[type[msgspec.Struct], Callable[[Following, Any], Awaitable[Any]]]]] = {
    "targets": (_Targets, _targets),
    "search": (_Search, _search),
    "type": (_Type, _type),
    "value": (_Path, _value),
    "value_file": (_ValueFile, _value_file),
    "svg": (_Level, _svg),
    "states": (_Nothing, _states),
    "node": (_Path, _node),
    "read_text": (_Said, _read_text),
    "folder": (_Path, _folder),
    "start": (_Nothing, _start),
    "difference": (_Nothing, _difference),
    "text": (_Paths, _text),
    "paste": (_Paste, _paste),
    "free_name": (_Name, _free_name),
    "gates": (_Path, _gates),
    "promotions": (_Path, _promotions),
    "edge": (_Path, _edge),
    "operators": (_Nothing, _operators),
    "stops": (_Path, _stops),
    "file": (_Nothing, _file),
    "amended": (_Amended, _amended),
    "annotate": (Annotate, _annotate),
    "ways_out": (_Path, _ways_out),
    "shown_by": (_Path, _shown_by),
    "muted": (_Path, _muted),
}
