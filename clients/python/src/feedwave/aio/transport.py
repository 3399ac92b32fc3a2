"""Carries out what flows need in an event loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator
from typing import Any, TypeVar

import grpc
import grpc.aio
from google.protobuf.message import Message

from .._flow import PACKAGE, Call, Emit, Flow, Open, Operation, Read, Work, encode, method_of
from ..errors import ClosedError, from_rpc

T = TypeVar("T")


class Stream:
    """An open stream."""

    def __init__(self, call: Any, method: str, outgoing: asyncio.Queue[Message | None] | None) -> None:
        self._call, self.method, self._outgoing = call, method, outgoing
        self._loop = asyncio.get_running_loop()

    def put(self, message: Message) -> None:
        assert self._outgoing is not None, "messages are put into streams of both directions"
        # Telemetry may come from another thread than the loop's.
        self._loop.call_soon_threadsafe(self._outgoing.put_nowait, message)

    def cancel(self) -> None:
        self._call.cancel()
        if self._outgoing is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._outgoing.put_nowait, None)

    async def read(self) -> Any:
        message = await self._call.read()
        return None if message is grpc.aio.EOF else message


class Transport:
    """Carries out the operations of flows."""

    def __init__(self, channel: grpc.aio.Channel, metadata: tuple[tuple[str, str | bytes], ...], timeout_s: float) -> None:
        self.channel, self._metadata, self._timeout_s = channel, metadata, timeout_s
        # Set where the client closes the channel.
        self.is_closed = False

    async def run(self, flow: Flow[T]) -> T:
        """The result of a flow that emits nothing."""
        result: list[T] = []
        async for _ in self.iterate(flow, result):
            pass
        return result[0]

    async def iterate(self, flow: Flow[T], result: list[T] | None = None) -> AsyncGenerator[Any, None]:
        """What a flow emits; its result goes into a list."""
        try:
            operation = next(flow)
            while True:
                if isinstance(operation, Emit):
                    yield operation.value
                    operation = flow.send(None)
                    continue
                try:
                    answer = await self._perform(operation)
                except BaseException as error:
                    operation = flow.throw(error)
                else:
                    operation = flow.send(answer)
        except StopIteration as end:
            if result is not None:
                result.append(end.value)
        finally:
            flow.close()

    async def _perform(self, operation: Operation) -> Any:
        if self.is_closed and isinstance(operation, (Call, Open)):
            raise ClosedError(f"the client is closed: {operation.method} was not called")
        try:
            if isinstance(operation, Call):
                return await self._call(operation)
            if isinstance(operation, Open):
                return self._open(operation)
            if isinstance(operation, Read):
                stream: Any = operation.stream
                return await stream.read()
        except grpc.RpcError as error:
            raise from_rpc(error, method_of(operation)) from None
        if isinstance(operation, Work):
            return await asyncio.to_thread(operation.function)
        assert not isinstance(operation, Emit), "what is emitted is for the caller"
        await asyncio.sleep(operation.seconds)
        return None

    async def _call(self, operation: Call) -> Any:
        path, request = PACKAGE + operation.method, operation.request
        if isinstance(request, Message):
            one = self.channel.unary_unary(path, encode, operation.decode)
            return await one(request, timeout=self._timeout_s, metadata=self._metadata)
        # An upload takes as long as it takes; the service ends one that stalls.
        many = self.channel.stream_unary(path, encode, operation.decode)
        return await many(request, metadata=self._metadata)

    def _open(self, operation: Open) -> Stream:
        path = PACKAGE + operation.method
        if operation.request is not None:
            once = self.channel.unary_stream(path, encode, operation.decode)
            return Stream(once(operation.request, timeout=operation.timeout_s, metadata=self._metadata), operation.method, None)
        both = self.channel.stream_stream(path, encode, operation.decode)
        outgoing: asyncio.Queue[Message | None] = asyncio.Queue()
        running = both(_messages(outgoing), timeout=operation.timeout_s, metadata=self._metadata)
        return Stream(running, operation.method, outgoing)


async def _messages(outgoing: asyncio.Queue[Message | None]) -> AsyncIterator[Message]:
    while (message := await outgoing.get()) is not None:
        yield message
