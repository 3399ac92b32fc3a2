"""A live run in an event loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from types import TracebackType

from typing_extensions import Self

from .._ingest import Ingest
from .._live import LiveRun, RunInfo
from .._options import Said
from .._telemetry import Link, Samples, TelemetryInfo, batch_of
from ..events import Event
from ..v1 import telemetry_pb2
from .transport import Transport


class _Connected(TelemetryInfo):
    """What live runs and telemetry alone have in common."""

    def __init__(self, transport: Transport, link: Link) -> None:
        super().__init__(link)
        self._transport = transport
        # What reads, for all tasks.
        self._reading: asyncio.Task[object] | None = None

    async def send(
        self,
        time_ns: Samples,
        *,
        tool: tuple[Samples, Samples] | None = None,
        work: tuple[Samples, Samples] | None = None,
        commanded: tuple[Samples, Samples] | None = None,
        spindle_angle_deg: Samples | None = None,
        spindle_rev_per_min: Samples | None = None,
        contact: Samples | None = None,
        velocity: tuple[Samples, Samples] | None = None,
        line: Samples | None = None,
        events: Iterable[Said[telemetry_pb2.MachineEvent]] = (),
    ) -> None:
        """Sends consecutive samples; they are kept, and sent again after a break, until they are durable.

        Args:
            time_ns: time stamps on the sensors' clock, ns, rising.
            tool, work: X and Y of the sensors at tool and workpiece: mm, strain or mm/s², as the monitoring says.
            commanded: acceleration of the commanded motion, mm/s², for acceleration sensors.
            spindle_angle_deg: spindle angle, degrees.
            spindle_rev_per_min: measured spindle speed, rev/min.
            contact: whether tool and work touch; one value stands for all samples.
            velocity: velocity of the commanded motion, mm/s, where cuts are recorded.
            line: source line that is being cut, where cuts are recorded.
            events: what happened on the machine ahead of these samples, as in `{"programmed_rev_per_min": 3000.0}`.
        """
        batch = batch_of(time_ns, tool, work, commanded, spindle_angle_deg, spindle_rev_per_min, contact, velocity, line, events)
        while not self._link.send(batch):
            waiting = self._link.waits
            await self._step_while(lambda: self._link.waits >= waiting)

    async def flush(self) -> None:
        """Waits until all telemetry is durable. What comes meanwhile is kept for the iteration."""
        await self._step_while(lambda: self._link.waits > 0)

    async def __aenter__(self) -> Self:
        await self._transport.run(self._link.step())
        return self

    async def __aexit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        reading, self._reading = self._reading, None
        if reading is not None:
            reading.cancel()
            await asyncio.gather(reading, return_exceptions=True)
        self.close()

    def __aiter__(self) -> AsyncIterator[Event]:
        return self

    async def __anext__(self) -> Event:
        while True:
            event = self._link.next_event()
            if event is not None:
                return event
            if self._link.ended is not None:
                raise StopAsyncIteration
            await self._step_while(lambda: not self._link.has_events)

    async def _step_while(self, is_needed: Callable[[], bool]) -> None:
        """Acts on messages of the service as long as that is needed. One task reads for all, and goes on where one that waits is cancelled."""
        while is_needed() and self._link.ended is None:
            if self._reading is None:
                self._reading = asyncio.create_task(self._transport.run(self._link.step()))
            reading = self._reading
            await asyncio.wait([reading])
            if reading is self._reading:
                self._reading = None
                reading.result()


class Run(_Connected, RunInfo):
    """A live run: an asynchronous context manager, and an asynchronous iterator over its events up to the last one, `Ended`.

    Credits, receipts and reconnects happen inside: whoever asks for the next event has taken the setpoints of the one before. Telemetry may
    be sent from another task. Leaving the block before the end leaves the run open, to be taken up.
    """

    def __init__(self, transport: Transport, live: LiveRun) -> None:
        """A run over this connection; use `Client.run`."""
        self._live = live
        super().__init__(transport, live)


class Telemetry(_Connected):
    """Telemetry of a machine that has its setpoints from elsewhere: an asynchronous context manager, and an asynchronous iterator over what is
    decided.

    Reconnects happen inside, and every decision is heard once. `finish` ends the run; leaving the block before leaves it open, to be taken up.
    """

    def __init__(self, transport: Transport, link: Ingest) -> None:
        """Telemetry over this connection; use `Client.ingest`."""
        self._ingest = link
        super().__init__(transport, link)

    def finish(self) -> None:
        """Says that no telemetry follows: the run ends once all of it is durable. Iterate to its end, `Ended`."""
        self._ingest.finish()
