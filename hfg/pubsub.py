"""`hfg.publish` and `hfg.subscribe`: how programs that were started by themselves meet by a name.

What they add is in `hfg.nodes.links`, which is imported when somebody meets.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hfg.errors import UsageError
from hfg.graph import Graph
from hfg.links.offers import need_link_name
from hfg.ports import Source, Target

if TYPE_CHECKING:
    from hfg.nodes.links import Publish, Subscribe

__all__ = ["publish", "subscribe"]


def publish(name: str, source: Source[Any], **parameters: Any) -> Publish:
    """Let a port's values be taken by the programs that subscribe to a name.

    Args:
      name: by which they meet, "camera/front".
      source: an output or event, or the input of a whole graph; its type is what is published.
      **parameters: of `Publish`.

    Returns:
      The node that publishes, which was added beside the port and connected to it.

    Raises:
      UsageError: the port belongs to no graph yet, or the name is none.

    Examples:
      >>> import hfg
      >>> from hfg.testing.nodes import script
      >>> graph = hfg.Graph()
      >>> source = graph.add(script())
      >>> hfg.publish("numbers", source.out).place.path
      'publish'
    """
    from hfg.nodes.links import Publish

    node = Publish(name=need_link_name(name), **parameters)
    graph = _graph_of(source, "publish")
    graph.add(node)
    graph.connect(source, node.value)
    return node


def subscribe(name: str, *targets: Target[Any], **parameters: Any) -> Subscribe:
    """Let what another program publishes by a name come into ports.

    Args:
      name: by which they meet, "camera/front".
      *targets: inputs, slots or parameters of one type, or outputs of the whole graph; the type has to be the
        publisher's.
      **parameters: of `Subscribe`.

    Returns:
      The source that subscribes, which was added beside the first port and connected to all.

    Raises:
      UsageError: there is no port, it belongs to no graph yet, or the name is none.

    Examples:
      >>> import hfg
      >>> from hfg.testing.nodes import double
      >>> graph = hfg.Graph()
      >>> twice = graph.add(double())
      >>> hfg.subscribe("numbers", twice.value, overflow="latest").place.path
      'subscribe'
    """
    if not targets:
        raise UsageError(
            f'"{name}" is subscribed to for no port: give the ports that its values go to, which say their type, as in '
            f'hfg.subscribe("{name}", viewer.picture)'
        )
    from hfg.nodes.links import Subscribe

    node = Subscribe(name=need_link_name(name), **parameters)
    graph = _graph_of(targets[0], "subscribe")
    graph.add(node)
    for target in targets:
        graph.connect(node.out, target)
    return node


def _graph_of(port: Any, verb: str) -> Graph:
    graph = getattr(port, "graph", None)
    if not isinstance(graph, Graph):
        what = f'"{port.path}" belongs to no graph yet' if hasattr(port, "path") else f"{port!r:.80} is no port"
        raise UsageError(f"cannot {verb}: {what}; add its node with graph.add(...) and give a port of it")
    return graph
