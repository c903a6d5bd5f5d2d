"""Errors that are sent from one part to another: a class of hfg and messages remain of them (rules L4, X1).

The tokens that a failed firing had taken are sent with the event `failed`, by the declared types of the inputs. A value
that cannot be sent is left out and named, because a second error would only hide the first.
"""

from __future__ import annotations

import traceback
from typing import Any

import msgspec

from hfg import errors
from hfg.base.controls import cleaned
from hfg.base.frames import users_part
from hfg.base.token import Token
from hfg.encoding import TokenCodec
from hfg.encoding.wire import Place, View
from hfg.errors import EncodingError, Failure, HfgError, NodeError, RunError
from hfg.parts.model.messages import Failed
from hfg.ports import Port


def as_failed(error: BaseException | None) -> Failed | None:
    """Put what went wrong into words."""
    if error is None:
        return None
    cause = error.__cause__
    trace = ""
    if cause is not None:
        trace = "".join(traceback.format_exception(type(cause), cause, users_part(cause.__traceback__), chain=False))
    if isinstance(error, NodeError):
        begin = f'node "{error.path}" failed in {error.what}: '
        return Failed(type(error).__name__, str(error).removeprefix(begin), error.path, error.what, trace)
    kind = type(error).__name__ if isinstance(error, HfgError) else "RunError"
    text = str(error) if isinstance(error, HfgError) else errors.in_words(error)
    return Failed(kind, text, trace=trace)


def as_error(failed: Failed, where: str) -> HfgError:
    """Make an error from what was received.

    Args:
      failed: the received data.
      where: the process, for a note on the error.
    """
    failed = cleaned(failed)
    kind = getattr(errors, failed.kind, RunError)
    error: HfgError
    if failed.path:
        of_node = isinstance(kind, type) and issubclass(kind, NodeError)
        error = (kind if of_node else NodeError)(failed.path, failed.what, failed.text)
    elif isinstance(kind, type) and issubclass(kind, HfgError) and kind.__init__ is HfgError.__init__:
        error = kind(failed.text)
    else:
        error = RunError(failed.text)
    error.add_note(f"in {where}" + (f":\n{failed.trace}" if failed.trace else ""))
    return error


def codec_of(port: Port, hint: Any, what: str) -> TokenCodec[Any]:
    """Return the codec for the values of a port, including failures.

    Args:
      port: the port that sends them.
      hint: their type.
      what: the name of a value in messages.

    Raises:
      EncodingError: values of this type cannot be sent to another process.
    """
    return _FailureCodec(port, what) if hint is Failure else TokenCodec(hint, what=what)


class _Told(msgspec.Struct, frozen=True):
    """A `Failure` in transit.

    Attributes:
      failed: the error.
      taken: metadata and values of the tokens that the firing had taken, by name of the input.
      left_out: why a value is missing there, by name of the input.
    """

    failed: Failed
    taken: dict[str, tuple[bytes, bytes]]
    left_out: dict[str, str]


class _FailureCodec(TokenCodec[Any]):
    """Encodes what the event `failed` of a node carries."""

    def __init__(self, port: Port, what: str) -> None:
        super().__init__(_Told, what=what)
        self._inputs = dict(port.node.ports.inputs) if port.name == "failed" else {}
        self._path = port.node.place.path
        self._codecs: dict[str, TokenCodec[Any]] = {}

    def encode(self, token: Token[Any], *, place: Place | None = None) -> tuple[bytes, bytes]:
        """See `TokenCodec`."""
        del place  # what fails is rare, and what it had taken may be wanted for long
        value = token.value
        if isinstance(value, Failure):
            token = Token(self._tell(value), token.activity, token.stamp, token.sequence)
        return super().encode(token)

    def _tell(self, failure: Failure) -> _Told:
        failed = as_failed(failure.error)
        assert failed is not None
        taken: dict[str, tuple[bytes, bytes]] = {}
        left_out: dict[str, str] = {}
        for name, value in failure.taken.items():
            try:
                taken[name] = self._codec(name).encode(Token(value))
            except HfgError as error:
                left_out[name] = str(error)
        return _Told(failed, taken, left_out)

    def decode(self, metadata: Any, value: Any, *, view: View | None = None) -> Token[Any]:
        """See `TokenCodec`."""
        token = super().decode(metadata, value, view=view)
        told = token.value
        if not isinstance(told, _Told):
            return token
        error = as_error(told.failed, "another process")
        for name, why in told.left_out.items():
            error.add_note(f'"{name}" is not among what it had taken: {why}')
        taken = {name: self._codec(name).decode(*parcel).value for name, parcel in told.taken.items()}
        return Token(Failure(error, taken), token.activity, token.stamp, token.sequence)  # type: ignore[arg-type]

    def _codec(self, name: str) -> TokenCodec[Any]:
        found = self._codecs.get(name)
        if found is None:
            port = self._inputs.get(name)
            what = f'the value of "{self._path}.{name}"'
            if port is None:
                raise EncodingError(f"{what} cannot cross to another process: the type of it is not known")
            found = self._codecs[name] = TokenCodec(port.type, what=what)
        return found
