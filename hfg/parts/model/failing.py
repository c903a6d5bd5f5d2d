"""Errors that are told from one part to another: what is left of them is a class of hfg's and sentences (rules L4, X1).

What the firing had taken that failed goes with the event `failed` by the declared types of the inputs, and a value that
cannot go is left out and named, for an error on the way of an error helps nobody.
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

__all__ = ["as_error", "as_failed", "codec_of"]


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
    """Make an error of what was told.

    Args:
      failed: as it came.
      where: in which process, for a note at the error.
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
    """Give what encodes the values that leave by a port, failures among them.

    Args:
      port: by which they leave.
      hint: their type.
      what: what messages call a value.

    Raises:
      EncodingError: values of this type cannot cross.
    """
    return _FailureCodec(port, what) if hint is Failure else TokenCodec(hint, what=what)


class _Told(msgspec.Struct, frozen=True):
    """A `Failure` on its way.

    Attributes:
      failed: the error.
      taken: metadata and value of what the firing had taken, by name of the input.
      left_out: why a value is not among these, by name of the input.
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
