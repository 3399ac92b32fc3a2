"""Carries out what flows need in the thread that asks."""

from __future__ import annotations

import queue
import time
from collections.abc import Generator
from typing import Any, TypeVar

import grpc
from google.protobuf.message import Message

from .._flow import PACKAGE, Call, Emit, Flow, Open, Operation, Read, Work, encode, method_of
from ..errors import ClosedError, from_rpc

T = TypeVar("T")


class Stream:
    """An open stream."""

    def __init__(self, call: Any, method: str, outgoing: queue.SimpleQueue[Message | None] | None) -> None:
        self._call, self.method, self._outgoing = call, method, outgoing

    def put(self, message: Message) -> None:
        assert self._outgoing is not None, "messages are put into streams of both directions"
        self._outgoing.put(message)

    def cancel(self) -> None:
        self._call.cancel()
        if self._outgoing is not None:
            # Ends the thread that sends.
            self._outgoing.put(None)

    def read(self) -> Any:
        return next(self._call, None)


class Transport:
    """Carries out the operations of flows in the thread that asks."""

    def __init__(self, channel: grpc.Channel, metadata: tuple[tuple[str, str | bytes], ...], timeout_s: float) -> None:
        self.channel, self._metadata, self._timeout_s = channel, metadata, timeout_s
        # Set where the client closes the channel.
        self.is_closed = False

    def run(self, flow: Flow[T]) -> T:
        """The result of a flow that emits nothing."""
        items = self.iterate(flow)
        while True:
            try:
                next(items)
            except StopIteration as end:
                result: T = end.value
                return result

    def iterate(self, flow: Flow[T]) -> Generator[Any, None, T]:
        """What a flow emits."""
        try:
            operation = next(flow)
            while True:
                if isinstance(operation, Emit):
                    yield operation.value
                    operation = flow.send(None)
                    continue
                try:
                    answer = self._perform(operation)
                except BaseException as error:
                    operation = flow.throw(error)
                else:
                    operation = flow.send(answer)
        except StopIteration as end:
            result: T = end.value
            return result
        finally:
            flow.close()

    def _perform(self, operation: Operation) -> Any:
        if self.is_closed and isinstance(operation, (Call, Open)):
            raise ClosedError(f"the client is closed: {operation.method} was not called")
        try:
            if isinstance(operation, Call):
                return self._call(operation)
            if isinstance(operation, Open):
                return self._open(operation)
            if isinstance(operation, Read):
                stream: Any = operation.stream
                return stream.read()
        except grpc.RpcError as error:
            raise from_rpc(error, method_of(operation)) from None
        if isinstance(operation, Work):
            return operation.function()
        assert not isinstance(operation, Emit), "what is emitted is for the caller"
        time.sleep(operation.seconds)
        return None

    def _call(self, operation: Call) -> Any:
        path, request = PACKAGE + operation.method, operation.request
        if isinstance(request, Message):
            one = self.channel.unary_unary(path, encode, operation.decode)
            return one(request, timeout=self._timeout_s, metadata=self._metadata)
        # An upload takes as long as it takes; the service ends one that stalls.
        many = self.channel.stream_unary(path, encode, operation.decode)
        return many(request, metadata=self._metadata)

    def _open(self, operation: Open) -> Stream:
        path = PACKAGE + operation.method
        if operation.request is not None:
            once = self.channel.unary_stream(path, encode, operation.decode)
            return Stream(once(operation.request, timeout=operation.timeout_s, metadata=self._metadata), operation.method, None)
        both = self.channel.stream_stream(path, encode, operation.decode)
        outgoing: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        running = both(iter(outgoing.get, None), timeout=operation.timeout_s, metadata=self._metadata)
        return Stream(running, operation.method, outgoing)
