"""What clients do, without doing it: a flow is a generator that says what it needs, one operation at a time.

`feedwave.Client` carries the operations out in the thread that asks, `feedwave.aio.Client` in an event loop. Everything else is written
once: what is sent, how often it is tried again, how a broken stream goes on.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, TypeVar

import tenacity
from google.protobuf.message import Message

from .errors import ServiceError

T = TypeVar("T")
M = TypeVar("M", bound=Message)

# Prefix of the paths of methods.
PACKAGE = "/feedwave.v1."


def encode(message: Message) -> bytes:
    """A message as it is sent."""
    return message.SerializeToString()


@dataclass(frozen=True)
class Call:
    """One request, one response; answered with the response."""

    method: str
    request: Message | Iterator[Message]
    decode: Callable[[bytes], Any]


@dataclass(frozen=True)
class Open:
    """Opens a stream of responses; answered with a `Stream`."""

    method: str
    # Absent: messages are put into the stream.
    request: Message | None
    decode: Callable[[bytes], Any]
    # Time for the whole stream, s.
    timeout_s: float | None = None


@dataclass(frozen=True)
class Read:
    """Waits for the next message of a stream; answered with it, or with None at the stream's end."""

    stream: Stream


@dataclass(frozen=True)
class Sleep:
    """Waits, s."""

    seconds: float


@dataclass(frozen=True)
class Work:
    """Does what takes a while without a connection; answered with its result."""

    function: Callable[[], Any]


@dataclass(frozen=True)
class Emit:
    """Gives the caller a value."""

    value: Any


class Stream(Protocol):
    """An open stream."""

    method: str

    def put(self, message: Message) -> None:
        """Sends a message, from any thread, without waiting. On a stream that has ended it is lost."""

    def cancel(self) -> None:
        """Ends the stream, without waiting."""


@contextmanager
def cancelling(stream: Stream) -> Iterator[None]:
    """Ends a stream when its block is left, however that happens."""
    try:
        yield
    finally:
        stream.cancel()


Operation: TypeAlias = "Call | Open | Read | Sleep | Work | Emit"
Flow: TypeAlias = "Generator[Operation, Any, T]"


def method_of(operation: Operation) -> str:
    """The method that an operation is about; empty for none."""
    if isinstance(operation, (Call, Open)):
        return operation.method
    return operation.stream.method if isinstance(operation, Read) else ""


@dataclass(frozen=True)
class Retries:
    """How often a call is tried again that did not come through: with growing, random pauses, or after the time that the service names."""

    give_up_after_s: float = 10.0
    """Time after which no further attempt is made, s."""
    first_pause_s: float = 0.1
    """Longest first pause, s; it doubles from attempt to attempt."""
    longest_pause_s: float = 5.0
    """Longest pause, s."""

    def controller(self) -> tenacity.Retrying:
        """What decides about further attempts."""
        jitter = tenacity.wait_random_exponential(multiplier=self.first_pause_s, max=self.longest_pause_s)

        def pause(state: tenacity.RetryCallState) -> float:
            error = state.outcome.exception() if state.outcome else None
            told_s = error.retry_after_s if isinstance(error, ServiceError) else None
            # Never earlier than told, and not all clients at once.
            return (told_s or 0.0) + jitter(state)

        return tenacity.Retrying(
            retry=tenacity.retry_if_exception(lambda error: isinstance(error, ServiceError) and error.is_passing),
            wait=pause,
            stop=tenacity.stop_before_delay(self.give_up_after_s),
            reraise=True,
        )


def retried(retries: Retries, attempt: Callable[[], Flow[T]]) -> Flow[T]:
    """Attempts until one succeeds, or fails in a way that does not pass, or the time is over."""
    controller = retries.controller()
    controller.begin()
    state = tenacity.RetryCallState(controller, fn=None, args=(), kwargs={})
    while True:
        todo = controller.iter(state)
        if isinstance(todo, tenacity.DoAttempt):
            try:
                result = yield from attempt()
            except ServiceError:
                state.set_exception(sys.exc_info())  # type: ignore[arg-type]
            else:
                return result
        else:
            state.prepare_for_next_attempt()
            yield Sleep(float(todo))


def pages(
    retries: Retries, method: str, request: Any, response: type[Message], items: Callable[[Any], Iterable[Any]]
) -> Flow[None]:
    """Emits the items of a list, page by page, and warns of those that are damaged in the store."""
    while True:
        page: Any = yield from call(retries, method, request, response)
        # Logs have none: their records are passed over.
        for name in getattr(page, "unreachable", ()):
            warnings.warn(f"{name} is damaged in the store of the service, and left out of the list", stacklevel=2)
        for item in items(page):
            yield Emit(item)
        if not page.next_page_token:
            return
        request.page_token = page.next_page_token


def call(retries: Retries, method: str, request: Message, response: type[M]) -> Flow[M]:
    """One request and its response; tried again while that can help."""

    def attempt() -> Flow[M]:
        answer: M = yield Call(method, request, response.FromString)
        return answer

    return retried(retries, attempt)
