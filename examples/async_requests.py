"""Each question goes to two servers at once; one breaks now and then, the other may be slow, and the graph continues.

    questions ─┬─ ask near ─┬─ compare
               └─ ask far ──┘                 failed ──> note

Shown: async functions as nodes, a time limit (`max_duration_s`), errors that cost one answer and not the run
(`on_error="skip"`), the event `failed` of every node, and optional inputs. In virtual time it takes no time. Run it
with `python examples/async_requests.py` or `hfg run examples/async_requests.py --clock virtual`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import hfg


@hfg.node
def questions() -> Iterator[str]:
    yield from ["How warm is it?", "Does it rain?", "Where does the wind come from?", "Will it rain in the night?"]


@hfg.node
async def ask(question: str, *, server: str = "near") -> str:
    """Simulate a request: the near server answers in 0.3 s if it can, the far one in 0.1 s for each word."""
    if server == "near":
        await asyncio.sleep(0.3)
        if "rain" in question:
            raise ConnectionResetError("the near server hung up")
    else:
        await asyncio.sleep(0.1 * len(question.split()))
    return f"{server} answers after {len(question)} letters"


@hfg.node
def compare(near: str = "-", far: str = "-") -> None:
    """Print both answers; one that did not come takes the default, and if none came there is nothing to compare."""
    print(f"{hfg.elapsed():5.2f} s  {near:32}{far}")


class Note(hfg.Node):
    """Writes down what went wrong."""

    @hfg.slot
    def write(self, failure: hfg.Failure) -> None:
        print(f"{hfg.elapsed():5.2f} s  {failure.error}")


def build() -> hfg.Graph:
    graph = hfg.Graph("async-requests")
    source = graph.add(questions())
    near = graph.add(ask(), name="near", on_error="skip", max_duration_s=1)
    far = graph.add(ask(server="far"), name="far", on_error="skip", max_duration_s=0.5)
    both, note = graph.add(compare()), graph.add(Note())

    graph.connect(source.out, near.question)
    graph.connect(source.out, far.question)
    graph.connect(near.out, both.near)
    graph.connect(far.out, both.far)
    graph.connect(near.failed, note.write)
    graph.connect(far.failed, note.write)
    return graph


if __name__ == "__main__":
    hfg.run(build(), clock="virtual")
