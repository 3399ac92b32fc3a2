"""A live run for programs without an event loop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType

from typing_extensions import Self

from .._live import LiveRun, RunInfo, Samples, batch_of
from ..events import Event
from ..v1 import telemetry_pb2
from .transport import Transport


class Run(RunInfo):
    """A live run: a context manager, and an iterator over its events up to the last one, `Ended`.

    Credits, receipts and reconnects happen inside: whoever asks for the next event has taken the setpoints of the one before. Telemetry may
    be sent from another thread. Leaving the block before the end leaves the run open, to be taken up.
    """

    def __init__(self, transport: Transport, live: LiveRun) -> None:
        """A run over this connection; use `Client.run`."""
        super().__init__(live)
        self._transport = transport
        # One thread reads at a time.
        self._reading = threading.Lock()
        transport.run(live.step())

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
        events: Iterable[telemetry_pb2.MachineEvent] = (),
    ) -> None:
        """Sends consecutive samples; they are kept, and sent again after a break, until they are durable.

        Args:
            time_ns: time stamps on the sensors' clock, ns, rising.
            tool, work: X and Y of the sensors at tool and workpiece: mm, strain or mm/s², as the monitoring says.
            commanded: acceleration of the commanded motion, mm/s², for acceleration sensors.
            spindle_angle_deg: spindle angle, degrees.
            spindle_rev_per_min: measured spindle speed, rev/min.
            contact: whether tool and work touch; one value stands for all samples.
            events: what happened on the machine ahead of these samples.
        """
        batch = batch_of(time_ns, tool, work, commanded, spindle_angle_deg, spindle_rev_per_min, contact, events)
        while not self._live.send(batch):
            waiting = self._live.waits
            self._step_while(lambda: self._live.waits >= waiting)

    def flush(self) -> None:
        """Waits until all telemetry is durable. What comes meanwhile is kept for the iteration."""
        self._step_while(lambda: self._live.waits > 0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def __iter__(self) -> Iterator[Event]:
        return self

    def __next__(self) -> Event:
        while True:
            event = self._live.next_event()
            if event is not None:
                return event
            if self._live.ended is not None:
                raise StopIteration
            self._step_while(lambda: not self._live.has_events)

    def _step_while(self, is_needed: Callable[[], bool]) -> None:
        """Acts on messages of the service as long as that is needed, in turns with other threads."""
        while is_needed() and self._live.ended is None:
            with self._reading:
                # Another thread may have read what was waited for.
                if is_needed() and self._live.ended is None:
                    self._transport.run(self._live.step())
