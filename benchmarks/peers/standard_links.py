"""Two processes with only the standard library: a pipe, slots in shared memory that semaphores guard, a socket pair.

Nothing is lost; the one that sends waits. A leaky variant is not tried.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import socket
from collections.abc import Callable
from multiprocessing.shared_memory import SharedMemory
from typing import Any

import numpy as np

from benchmarks.parcels import HEAD, LETTER, SHAPE, Job, Picture, Post, letter, opened, picture, picture_bytes

__all__ = ["pipe", "ring", "socket_pair"]

SLOTS = 8
CONTEXT = multiprocessing.get_context("spawn")


def pipe(job: Job) -> dict[str, float]:
    """`multiprocessing.Pipe`, bytes."""
    there, here = CONTEXT.Pipe()

    def take(post: Post) -> None:
        received = here.recv_bytes()
        if job.what == "letter":
            post.take_letter(received)
        else:
            picture = np.frombuffer(here.recv_bytes(), np.uint8).reshape(SHAPE)
            post.take_picture(*opened(received), picture)

    return run(job, take, send_to_pipe, there)


def send_to_pipe(job: Job, pipe: Any) -> None:
    """Send: the other process."""
    for number in job.numbers():
        pipe.send_bytes(letter(number))
        if job.what == "picture":
            pipe.send_bytes(picture_bytes())
    pipe.recv_bytes()


def ring(job: Job) -> dict[str, float]:
    """Slots in shared memory: what has arrived is looked at where it lies, and its slot returned then."""
    size = HEAD.size + (len(letter(0)) if job.what == "letter" else len(picture_bytes()))
    memory = SharedMemory(create=True, size=SLOTS * size)
    buffer = view_of(memory)
    free, full = CONTEXT.Semaphore(SLOTS), CONTEXT.Semaphore(0)
    turn = 0

    def take(post: Post) -> None:
        nonlocal turn
        full.acquire()
        begin = turn * size
        if job.what == "letter":
            post.take_letter(buffer[begin + HEAD.size : begin + size])
        else:
            view: Picture = np.ndarray(SHAPE, np.uint8, buffer, begin + HEAD.size)
            post.take_picture(*opened(buffer[begin : begin + HEAD.size]), view)
        turn = (turn + 1) % SLOTS
        free.release()

    try:
        return run(job, take, send_to_ring, memory.name, size, free, full)
    finally:
        buffer.release()
        memory.close()
        memory.unlink()


def socket_pair(job: Job) -> dict[str, float]:
    """A socket between two asyncio loops: a letter, its answer, the next letter, which is a window of 1."""
    there, here = socket.socketpair()
    post = Post(job)
    process = CONTEXT.Process(target=send_to_socket, args=(job, there), daemon=True)
    process.start()
    there.close()

    def arrived(letters: asyncio.Transport, received: bytes) -> bool:
        post.take_letter(received)
        letters.write(b".")
        return post.is_over

    asyncio.run(hear(here, LETTER, arrived))
    process.join()
    return post.figures()


def send_to_socket(job: Job, there: socket.socket) -> None:
    """Send: the other process."""
    numbers = iter(range(job.number))

    def answered(answers: asyncio.Transport, _received: bytes) -> bool:
        number = next(numbers, None)
        if number is not None:
            answers.write(letter(number))
        return number is None

    asyncio.run(hear(there, 1, answered, begins=True))


async def hear(
    end: socket.socket, size: int, arrived: Callable[[asyncio.Transport, bytes], bool], *, begins: bool = False
) -> None:
    """Hear what arrives at one end of a socket, in pieces of that size, until `arrived` says that it is over."""
    loop = asyncio.get_running_loop()
    over = loop.create_future()

    class Ear(asyncio.Protocol):
        pending = b""
        transport: asyncio.Transport

        def connection_made(self, transport: Any) -> None:
            self.transport = transport
            if begins:
                arrived(transport, b"")

        def data_received(self, data: bytes) -> None:
            self.pending += data
            while len(self.pending) >= size and not over.done():
                piece, self.pending = self.pending[:size], self.pending[size:]
                if arrived(self.transport, piece):
                    over.set_result(None)

    transport, _ = await loop.create_connection(Ear, sock=end)
    await over
    transport.close()


def view_of(memory: SharedMemory) -> memoryview:
    """Return its bytes."""
    assert memory.buf is not None
    return memory.buf


def send_to_ring(job: Job, name: str, size: int, free: Any, full: Any) -> None:
    """Send: the other process."""
    memory = SharedMemory(name)
    buffer = view_of(memory)
    turn = 0
    for number in job.numbers():
        free.acquire()
        begin = turn * size
        if job.what == "letter":
            buffer[begin + HEAD.size : begin + size] = letter(number)
        else:
            HEAD.pack_into(buffer, begin, *opened(letter(number)))
            np.copyto(np.ndarray(SHAPE, np.uint8, buffer, begin + HEAD.size), picture())
        turn = (turn + 1) % SLOTS
        full.release()
    buffer.release()
    memory.close()


def run(job: Job, take: Callable[[Post], None], send: Callable[..., None], *arguments: Any) -> dict[str, float]:
    """Begin the other process, and take all that it sends."""
    post = Post(job)
    process = CONTEXT.Process(target=send, args=(job, *arguments), daemon=True)
    process.start()
    while not post.is_over:
        take(post)
    process.terminate()
    process.join()
    return post.figures()
