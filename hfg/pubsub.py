"""`hfg.publish` and `hfg.subscribe`: connect programs that are started separately by a name.

The nodes that they add are in `hfg.nodes.links`, which is imported on first use.
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
    """Publish a port's values to the programs that subscribe to a name.

    Args:
      name: the common name, "camera/front".
      source: an output or event, or the input of a whole graph; its type is the type of the published values.
      **parameters: parameters of `Publish`.

    Returns:
      The publishing node, which was added to the port's graph and connected to the port.

    Raises:
      UsageError: the port does not belong to a graph yet, or the name is not valid.

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
    """Send the values that another program publishes under a name to ports.

    Args:
      name: the common name, "camera/front".
      *targets: inputs, slots or parameters of one type, or outputs of the whole graph; the type has to be the
        publisher's.
      **parameters: parameters of `Subscribe`.

    Returns:
      The subscribing source, which was added to the first port's graph and connected to all ports.

    Raises:
      UsageError: there is no port, it does not belong to a graph yet, or the name is not valid.

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
            f'"{name}" is subscribed to without a port: pass the ports that receive the values and determine '
            f'their type, as in hfg.subscribe("{name}", viewer.picture)'
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
        what = (
            f'"{port.path}" does not belong to a graph yet' if hasattr(port, "path") else f"{port!r:.80} is not a port"
        )
        raise UsageError(f"cannot {verb}: {what}; add its node with graph.add(...) and pass one of its ports")
    return graph
