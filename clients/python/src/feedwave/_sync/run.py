"""A live run for programs without an event loop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
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
        # Whether a thread reads, and where the others wait.
        self._is_read, self._turn = False, threading.Condition()
        transport.run(link.step())

    def send(
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
            self._step_while(lambda: self._link.waits >= waiting)

    def flush(self) -> None:
        """Waits until all telemetry is durable. What comes meanwhile is kept for the iteration."""
        self._step_while(lambda: self._link.waits > 0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def __iter__(self) -> Iterator[Event]:
        return self

    def __next__(self) -> Event:
        while True:
            event = self._link.next_event()
            if event is not None:
                return event
            if self._link.ended is not None:
                raise StopIteration
            self._step_while(lambda: not self._link.has_events)

    def _step_while(self, is_needed: Callable[[], bool]) -> None:
        """Acts on messages of the service as long as that is needed, and lets one thread read for all."""
        while True:
            with self._turn:
                # What this thread waits for may come to the one that reads.
                self._turn.wait_for(lambda: not (self._is_read and is_needed() and self._link.ended is None))
                if not is_needed() or self._link.ended is not None:
                    return
                self._is_read = True
            try:
                self._transport.run(self._link.step())
            finally:
                with self._turn:
                    self._is_read = False
                    self._turn.notify_all()


class Run(_Connected, RunInfo):
    """A live run: a context manager, and an iterator over its events up to the last one, `Ended`.

    Credits, receipts and reconnects happen inside: whoever asks for the next event has taken the setpoints of the one before. Telemetry may
    be sent from another thread. Leaving the block before the end leaves the run open, to be taken up.
    """

    def __init__(self, transport: Transport, live: LiveRun) -> None:
        """A run over this connection; use `Client.run`."""
        self._live = live
        super().__init__(transport, live)


class Telemetry(_Connected):
    """Telemetry of a machine that has its setpoints from elsewhere: a context manager, and an iterator over what is decided.

    Reconnects happen inside, and every decision is heard once. `finish` ends the run; leaving the block before leaves it open, to be taken up.
    """

    def __init__(self, transport: Transport, link: Ingest) -> None:
        """Telemetry over this connection; use `Client.ingest`."""
        self._ingest = link
        super().__init__(transport, link)

    def finish(self) -> None:
        """Says that no telemetry follows: the run ends once all of it is durable. Iterate to its end, `Ended`."""
        self._ingest.finish()
