"""The client's half of a run's telemetry: batches until they are durable, decisions heard once, and breaks of the connection.

A connection that breaks is taken up again: batches that are not durable are sent again, and decisions that were made meanwhile are read from
the log. What comes a second time is dropped by its number.
"""

from __future__ import annotations

import abc
import dataclasses
import threading
from collections import deque
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from google.protobuf.message import Message

from ._flow import Flow, Open, Read, Retries, Stream, call, retried
from ._names import value_name, whole
from ._options import Said, message_of
from .errors import Cancelled, ContractError, FailedPrecondition, ServiceError, SourceError
from .events import Acknowledged, Decision, Ended, Event
from .v1 import decisions_pb2, telemetry_pb2

# Batches that may wait to become durable; more are sent only when there is space again.
MAX_WAITING = 1_000
# Time for which it is tried to take a run up again, s.
RECONNECT_FOR_S = 60.0

Samples = npt.ArrayLike


class Link(abc.ABC):
    """A run on the client's side, without any input or output. What differs between a live run and telemetry alone is in its subclasses."""

    METHOD: ClassVar[str]
    RESPONSE: ClassVar[type[Message]]

    def __init__(
        self, retries: Retries, job: str | None, run: str | None, decided: int, reconnect_for_s: float, sensor_time_ns: int | None
    ) -> None:
        """A run to begin (`job`) or to take up (`run`), of which `decided` decisions are known already."""
        self._retries = retries
        self._reconnects = dataclasses.replace(retries, give_up_after_s=reconnect_for_s)
        self._job, self.name = job, run or ""
        self._sensor_time_ns = None if sensor_time_ns is None else whole("sensor_time_ns", sensor_time_ns)
        self._has_begun = False
        # Number of the next decision, and the place of the last one in the log of all runs.
        self.decided, self._log = whole("decided", decided), 0
        self.state = "UNSPECIFIED"
        self.feed_held = False
        self.feed, self.spindle = 1.0, 1.0
        self.ended: Ended | None = None
        self._closed = False
        self._events: deque[Event] = deque()
        # Telemetry comes from other threads: guards what follows, and the order of messages on the stream.
        self._guard = threading.Lock()
        self._stream: Stream | None = None
        self._waiting: deque[telemetry_pb2.TelemetryBatch] = deque()
        self._next_batch = 0

    # What differs.

    @abc.abstractmethod
    def _start(self) -> Message:
        """The first message of a connection."""

    @abc.abstractmethod
    def _wrapped(self, batch: telemetry_pb2.TelemetryBatch) -> Message:
        """A batch as it is sent."""

    @abc.abstractmethod
    def _begin(self, started: Any) -> None:
        """Takes in what else the service says of a run that has begun or was taken up."""

    @abc.abstractmethod
    def _say_again(self) -> None:
        """Says on a new connection what does not wait for anybody; with the guard held."""

    @abc.abstractmethod
    def _hear_more(self, kind: str | None, message: Any) -> None:
        """Acts on a message that is neither decision nor acknowledgement."""

    @abc.abstractmethod
    def _ends_here(self) -> bool:
        """Whether the end of the stream is that of the run."""

    @property
    def setpoint_count(self) -> int:
        """Setpoints received."""
        return 0

    # What the caller does.

    def send(self, batch: telemetry_pb2.TelemetryBatch) -> bool:
        """Sends a batch under the next number, unless too many wait; whether it was taken."""
        with self._guard:
            if len(self._waiting) >= MAX_WAITING:
                return False
            batch.sequence = self._next_batch
            self._next_batch += 1
            self._waiting.append(batch)
            self._say(self._wrapped(batch))
            return True

    @property
    def waits(self) -> int:
        """Batches that are not known to be durable."""
        with self._guard:
            return len(self._waiting)

    def next_event(self) -> Event | None:
        """The next event that is here."""
        return self._events.popleft() if self._events else None

    @property
    def has_events(self) -> bool:
        """Whether an event is here."""
        return bool(self._events)

    def close(self) -> None:
        """Ends the connection for good; the run stays open."""
        self._closed = True
        self.broken()

    # What the connection needs.

    def step(self) -> Flow[None]:
        """Acts on the next message of the service; connects where there is no connection.

        Raises:
            Cancelled: once it was closed, by another thread perhaps.
        """
        if self._closed:
            raise Cancelled("the run was closed on this side", self.METHOD)
        if self._stream is None:
            try:
                yield from retried(self._reconnects if self._has_begun else self._retries, self._connect)
            except FailedPrecondition as error:
                if not self.name or not (yield from self._has_ended()):
                    raise error
            return
        try:
            message = yield Read(self._stream)
        except ServiceError as error:
            self.broken()
            if not error.is_passing or self._closed:
                raise
        except BaseException:
            self.broken()
            raise
        else:
            if message is not None:
                self._hear(message)
                return
            self.broken()
            if self._ends_here():
                self._end(Ended("FINISHED", "", self.setpoint_count, ""))

    def broken(self) -> None:
        """Ends the connection."""
        with self._guard:
            if self._stream is not None:
                self._stream.cancel()
            self._stream = None

    def _connect(self) -> Flow[None]:
        stream: Stream = yield Open(self.METHOD, None, self.RESPONSE.FromString)
        try:
            stream.put(self._start())
            message = yield Read(stream)
            if message is None or message.WhichOneof("message") != "started":
                raise ContractError("a run did not begin with its start")
            is_new, started = not self.name, message.started
            self._take_up(started)
            if not is_new:
                # What was decided unheard is in the log.
                yield from self._read_log()
            self._begin(started)
        except BaseException:
            stream.cancel()
            raise
        with self._guard:
            self._stream = stream
            if self._closed:
                stream.cancel()
            for batch in self._waiting:
                self._say(self._wrapped(batch))
            self._say_again()

    def _take_up(self, started: Any) -> None:
        self.name = started.run
        self.state = value_name(telemetry_pb2.MonitorState, started.state)
        self.feed_held = started.feed_held
        self.feed, self.spindle = started.overrides.feed, started.overrides.spindle
        with self._guard:
            if started.HasField("durable_batch"):
                self._settle(started.durable_batch)
                if not self._has_begun:
                    self._next_batch = started.durable_batch + 1
        self._has_begun = True

    def _has_ended(self) -> Flow[bool]:
        """Whether the run has ended, which was not heard because the connection broke."""
        request = telemetry_pb2.GetRunRequest(name=self.name)
        answer = yield from call(self._retries, "Telemetry/GetRun", request, telemetry_pb2.GetRunResponse)
        if answer.run.state == telemetry_pb2.RUN_STATE_OPEN:
            return False
        yield from self._read_log()
        state = value_name(telemetry_pb2.RunState, answer.run.state)
        self._end(Ended(state, answer.run.state_message, self.setpoint_count, ""))
        return True

    def _end(self, ended: Ended) -> None:
        self.ended = ended
        self._events.append(ended)

    def _read_log(self) -> Flow[None]:
        while True:
            request = telemetry_pb2.ListDecisionsRequest(run=self.name, after=self._log, page_size=500)
            page = yield from call(self._retries, "Telemetry/ListDecisions", request, telemetry_pb2.ListDecisionsResponse)
            for decision in page.decisions:
                self._decide(decision)
            if not page.decisions:
                return

    def _hear(self, message: Any) -> None:
        kind = message.WhichOneof("message")
        if kind == "decision":
            # What holds now; the log tells of earlier times.
            outcome = message.decision.outcome
            self.feed, self.spindle = outcome.after.feed, outcome.after.spindle
            self.feed_held |= outcome.action == decisions_pb2.DECISION_ACTION_HOLD_FEED
            self._decide(message.decision)
        elif kind == "ack":
            with self._guard:
                self._settle(message.ack.durable_batch)
            event = Acknowledged.of(message.ack)
            self.state = event.state
            self._events.append(event)
        elif kind == "started":
            raise ContractError("a run began twice")
        else:
            # A message that a later contract has is nobody's.
            self._hear_more(kind, message)

    def _decide(self, decision: Any) -> None:
        self._log = max(self._log, decision.sequence)
        if decision.number >= self.decided:
            self.decided = decision.number + 1
            self._events.append(Decision.of(decision))

    # With the guard held.

    def _settle(self, durable: int) -> None:
        while self._waiting and self._waiting[0].sequence <= durable:
            self._waiting.popleft()

    def _say(self, message: Message) -> None:
        # Without a connection it is said when there is one.
        if self._stream is not None:
            self._stream.put(message)


def batch_of(
    time_ns: Samples,
    tool: tuple[Samples, Samples] | None,
    work: tuple[Samples, Samples] | None,
    commanded: tuple[Samples, Samples] | None,
    spindle_angle_deg: Samples | None,
    spindle_rev_per_min: Samples | None,
    contact: Samples | None,
    velocity: tuple[Samples, Samples] | None,
    line: Samples | None,
    events: Iterable[Said[telemetry_pb2.MachineEvent]],
) -> telemetry_pb2.TelemetryBatch:
    """Telemetry as a message.

    Raises:
        SourceError: for columns of different lengths.
    """
    times = np.asarray(time_ns, dtype=np.uint64)
    happened = [message_of(telemetry_pb2.MachineEvent, event) for event in events]
    batch = telemetry_pb2.TelemetryBatch(time_ns=times.tolist(), events=happened)

    def column(name: str, values: Samples, kind: type[np.generic] = np.float64) -> list[Any]:
        array = np.asarray(values, dtype=kind)
        if array.shape != times.shape:
            raise SourceError(f"{name} has the shape {array.shape}, and the time stamps have {times.shape}")
        found: list[Any] = array.tolist()
        return found

    for name, pair in (("tool", tool), ("work", work), ("commanded", commanded), ("velocity", velocity)):
        if pair is not None:
            target = getattr(batch, name)
            target.x.extend(column(f"{name} x", pair[0]))
            target.y.extend(column(f"{name} y", pair[1]))
    if spindle_angle_deg is not None:
        batch.spindle_angle_deg.extend(column("spindle_angle_deg", spindle_angle_deg))
    if spindle_rev_per_min is not None:
        batch.spindle_rev_per_min.extend(column("spindle_rev_per_min", spindle_rev_per_min))
    if line is not None:
        batch.line.extend(column("line", line, np.uint32))
    if contact is not None:
        # One value stands for all samples.
        batch.contact.extend(column("contact", np.broadcast_to(np.asarray(contact), times.shape), np.bool_))
    return batch


class TelemetryInfo:
    """What both clients know of a run, and what needs no waiting."""

    def __init__(self, link: Link) -> None:
        """Of this run."""
        self._link = link

    @property
    def name(self) -> str:
        """The run, `runs/…`."""
        return self._link.name

    @property
    def state(self) -> str:
        """State of the monitoring, as in `BASELINE` or `MEASURING`."""
        return self._link.state

    @property
    def feed(self) -> float:
        """Feed override decided last, as a ratio (1 = programmed)."""
        return self._link.feed

    @property
    def spindle(self) -> float:
        """Spindle override decided last, as a ratio (1 = programmed): the speed is the caller's to set."""
        return self._link.spindle

    @property
    def feed_held(self) -> bool:
        """Whether an escalation holds the feed: acknowledge its condition, then resume."""
        return self._link.feed_held

    @property
    def decided(self) -> int:
        """Decisions heard."""
        return self._link.decided

    @property
    def ended(self) -> Ended | None:
        """The end, once it was heard."""
        return self._link.ended

    def heard(self) -> list[Event]:
        """The events that are here already, without waiting: after `flush` for one."""
        events = []
        while (event := self._link.next_event()) is not None:
            events.append(event)
        return events

    def close(self) -> None:
        """Ends the connection, from any thread. A run that has not ended stays open, to be taken up; who iterates gets `Cancelled`."""
        self._link.close()
