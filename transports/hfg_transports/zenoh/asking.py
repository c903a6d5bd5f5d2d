"""Questions and answers: what asks waits on the loop, what answers runs as a task there.

Depends on the inbox and sending.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING, Any, Final

from hfg.base.controls import cleaned
from hfg.base.logs import log
from hfg.errors import MessageTooLarge, NoAnswer, QueryRefused, in_words
from hfg.transport import Answer
from hfg_transports.zenoh.config import LONG

if TYPE_CHECKING:
    import zenoh

    from hfg_transports.zenoh.inbox import Mailbox
    from hfg_transports.zenoh.sending import Sender

MOST: Final = 256
"""Answers that one answerer works on at a time; whoever asks more is refused."""

_LONGEST_REFUSAL: Final = 2000


class Question:
    """One question in progress: replies come from Zenoh's thread, the future lives on the loop."""

    def __init__(self, name: str, loop: asyncio.AbstractEventLoop, mailbox: Mailbox[tuple[Question, Any]]) -> None:
        self.name = name
        self.future: asyncio.Future[bytes] = loop.create_future()
        self._mailbox = mailbox
        self._answered = False

    def on_reply(self, reply: zenoh.Reply) -> None:
        """Take the first reply; in Zenoh's thread."""
        if self._answered:
            return
        self._answered = True
        if reply.ok is not None:
            self._mailbox.leave((self, reply.ok.payload.to_bytes()))
        elif reply.err is not None:
            said = reply.err.payload.to_bytes()[:_LONGEST_REFUSAL].decode(errors="replace")
            self._mailbox.leave((self, QueryRefused(cleaned(said))))

    def on_end(self) -> None:
        """No reply comes any more; in Zenoh's thread."""
        if not self._answered:
            self._mailbox.leave((self, NoAnswer(f'nobody answers to "{self.name}"; is it running?')))

    def settle(self, result: bytes | Exception) -> None:
        """Deliver what has arrived to the waiting code; on the loop."""
        if self.future.done():
            return
        if isinstance(result, Exception):
            self.future.set_exception(result)
        else:
            self.future.set_result(result)


class Answerer:
    """Answers the questions to one name."""

    def __init__(self, key: str, name: str, handler: Answer, sender: Sender, largest: int) -> None:
        self._key = key
        self._name = name
        self._handler = handler
        self._sender = sender
        self._largest = largest
        self._tasks: set[asyncio.Task[None]] = set()
        self._closed = False

    def asked(self, queries: list[zenoh.Query]) -> None:
        """Begin to answer what has come; on the loop."""
        for query in queries:
            if self._closed:
                _drop(query)
            elif len(self._tasks) >= MOST:
                self._refuse(query, f'"{self._name}" answers {MOST} questions already; ask again later')
            else:
                task = asyncio.get_running_loop().create_task(self._answer(query), name=f'answer to "{self._name}"')
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)

    def close(self) -> None:
        """Stop answering; answers in progress are cancelled."""
        self._closed = True
        for task in self._tasks:
            task.cancel()

    async def _answer(self, query: zenoh.Query) -> None:
        try:
            question = query.payload.to_bytes() if query.payload is not None else b""
            answer = await self._handler(question)
            if len(answer) > self._largest:
                raise MessageTooLarge(
                    f'the answer of "{self._name}" has {len(answer)} bytes, {self._largest} can be sent'
                )
        except asyncio.CancelledError:
            _drop(query)
            raise
        except Exception as error:
            self._refuse(query, str(error) or in_words(error))
            return

        def reply() -> None:
            try:
                query.reply(self._key, answer)
            finally:
                _drop(query)

        self._send(reply, len(answer))

    def _refuse(self, query: zenoh.Query, sentence: str) -> None:
        def refuse() -> None:
            try:
                query.reply_err(sentence.encode(errors="replace")[:_LONGEST_REFUSAL])
            finally:
                _drop(query)

        self._send(refuse, 0)

    def _send(self, send: Any, size: int) -> None:
        if size > LONG:
            self._sender.give(send, size)
            return
        try:
            send()
        except Exception as error:  # who has asked is gone, or the session is
            log().debug('an answer of "%s" could not be sent: %s', self._name, error)


def _drop(query: zenoh.Query) -> None:
    """Tell Zenoh that a query is finished.

    The caller waits for this, and Python's garbage collector may run much later.
    """
    with contextlib.suppress(Exception):
        query.drop()
