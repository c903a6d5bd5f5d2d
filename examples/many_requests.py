"""Two hundred requests to a server that is slow and hangs up now and then: eight at once, tried again, in order.

    numbers ── ask (8 at once, 3 retries) ── collect

Shown: `concurrency` (the answers leave in the order of the questions), `retries` with back-off, a time limit for each
attempt, and what the report tells of it. `python examples/many_requests.py` starts a server on this machine and asks
that; `hfg run examples/many_requests.py --clock virtual` simulates it. tests/examples/plain_requests.py does the same
without hfg.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Iterator

import hfg

AT_ONCE, RETRIES, BACKOFF_S, LIMIT_S = 8, 3, 0.05, 1.0
TAKES_S = 0.08


class Service:
    """Knows the squares; hangs up at the first request for every tenth number."""

    def __init__(self) -> None:
        self.asked: Counter[int] = Counter()

    async def answer(self, number: int) -> int:
        self.asked[number] += 1
        await asyncio.sleep(TAKES_S)
        if number % 10 == 3 and self.asked[number] == 1:
            raise ConnectionResetError("the server hung up")
        return number * number

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one request: a number in a line."""
        try:
            writer.write(f"{await self.answer(int(await reader.readline()))}\n".encode())
        except ConnectionResetError:
            pass
        finally:
            writer.close()


SIMULATED = Service()


async def request(number: int, port: int) -> int:
    """Ask the server at this port of this machine; at port 0 a simulated one."""
    if not port:
        return await SIMULATED.answer(number)
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        writer.write(f"{number}\n".encode())
        line = await reader.readline()
    finally:
        writer.close()
    if not line:
        raise ConnectionResetError("the server hung up")
    return int(line)


@hfg.node
def numbers(*, count: int = 200) -> Iterator[int]:
    yield from range(count)


@hfg.node
async def ask(number: int, *, port: int = 0) -> int:
    return await request(number, port)


class Collect(hfg.Node):
    """Keeps the answers."""

    answer = hfg.Input(int)
    answers = hfg.State(factory=list[int])

    def process(self, answer: int) -> None:
        self.answers.append(answer)


def build(count: int = 200, port: int = 0) -> hfg.Graph:
    graph = hfg.Graph("many-requests")
    asking = graph.add(
        ask(port=port),
        concurrency=AT_ONCE,
        retries=RETRIES,
        retry_backoff_s=BACKOFF_S,
        max_duration_s=LIMIT_S,
        on_error="skip",
    )
    graph.connect(graph.add(numbers(count=count)).out, asking.number)
    graph.connect(asking.out, graph.add(Collect()).answer)
    return graph


async def main() -> None:
    async with await asyncio.start_server(Service().serve, "127.0.0.1", 0) as server:
        print(await hfg.run_async(build(port=server.sockets[0].getsockname()[1])))


if __name__ == "__main__":
    asyncio.run(main())
