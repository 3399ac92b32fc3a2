"""The client's half of a live run: credits, receipts, telemetry until it is durable, decisions heard once, and breaks of the connection.

A connection that breaks is taken up at the first setpoint that was not taken. What comes a second time is dropped: setpoints by their index,
decisions by their number; decisions that were made meanwhile are read from the log.
"""

from __future__ import annotations

import dataclasses
import math
import threading
from collections import deque
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from ._flow import Flow, Open, Read, Retries, Stream, call, retried
from ._names import resource, value_name, value_of
from ._options import RunOptions
from ._requests import column_kinds
from .errors import Cancelled, ContractError, FailedPrecondition, ServiceError, SourceError
from .events import Acknowledged, Decision, Ended, Event, FeedChange, Refused
from .setpoints import Decoder, Layout, Setpoints
from .v1 import machines_pb2, runs_pb2, setpoints_pb2, telemetry_pb2

# Batches that may wait to become durable; more are sent only when there is space again.
MAX_WAITING = 1_000
# Time of the setpoints that may come ahead of those that were taken, s.
AHEAD_S = 0.1
# Time for which it is tried to take a run up again, s.
RECONNECT_FOR_S = 60.0

Samples = npt.ArrayLike


class LiveRun:
    """State of a run on the client's side, without any input or output."""

    def __init__(self, retries: Retries, job: str | None, run: str | None, start: int, decided: int, options: RunOptions) -> None:
        """A run to begin (`job`) or to take up (`run`), of which `start` setpoints and `decided` decisions are known already."""
        self._retries = retries
        self._reconnects = dataclasses.replace(retries, give_up_after_s=options.get("reconnect_for_s", RECONNECT_FOR_S))
        self._job, self.name = job, run or ""
        self._options = options
        self._ahead_s = options.get("ahead_s", AHEAD_S)
        self._first_index = start
        # Setpoints taken, given to the caller, and permitted.
        self.taken, self._given, self._credit = start, start, 0
        # Index of the next setpoint of this connection.
        self._next_index = start
        self._in_hand = start
        # Number of the next decision, and the place of the last one in the log of all runs.
        self.decided, self._log = decided, 0
        self._changes = 0
        self._decoder: Decoder | None = None
        self.state = "UNSPECIFIED"
        self.held, self.feed_held = False, False
        self.feed, self.spindle = 1.0, 1.0
        self.ended: Ended | None = None
        self._closed = False
        self._events: deque[Event] = deque()
        # A command that stops, until it is known to act; and whether a resume is under way.
        self._stopping: runs_pb2.RunCommandKind | None = None
        self._resuming = False
        # Telemetry comes from other threads: guards what follows, and the order of messages on the stream.
        self._guard = threading.Lock()
        self._stream: Stream | None = None
        self._waiting: deque[telemetry_pb2.TelemetryBatch] = deque()
        self._next_batch = 0

    @property
    def layout(self) -> Layout:
        """What the setpoints are made of."""
        assert self._decoder is not None, "a run has begun when the caller has it"
        return self._decoder.layout

    # What the caller does.

    def send(self, batch: telemetry_pb2.TelemetryBatch) -> bool:
        """Sends a batch under the next number, unless too many wait; whether it was taken."""
        with self._guard:
            if len(self._waiting) >= MAX_WAITING:
                return False
            batch.sequence = self._next_batch
            self._next_batch += 1
            self._waiting.append(batch)
            self._say(runs_pb2.RunRequest(batch=batch))
            return True

    @property
    def waits(self) -> int:
        """Batches that are not known to be durable."""
        with self._guard:
            return len(self._waiting)

    def command(self, name: str) -> None:
        """Sends a command of the operator."""
        kind = value_of(runs_pb2.RunCommandKind, name)
        with self._guard:
            if kind == runs_pb2.RUN_COMMAND_KIND_RESUME:
                withdrawn = self._stopping == runs_pb2.RUN_COMMAND_KIND_HOLD
                if withdrawn:
                    self._stopping = None
                self._resuming = self.held or self.feed_held or withdrawn
            elif self._stopping != runs_pb2.RUN_COMMAND_KIND_ABORT:
                self._stopping = kind
            self._say(_command(kind))

    @property
    def ahead_s(self) -> float:
        """Time of the setpoints that may come before those before them were taken, s."""
        return self._ahead_s

    @ahead_s.setter
    def ahead_s(self, ahead_s: float) -> None:
        with self._guard:
            self._ahead_s = ahead_s
            self._permit()

    def next_event(self) -> Event | None:
        """The next event that is here. Whoever asks for another one has taken the setpoints before."""
        with self._guard:
            if self._in_hand > self.taken:
                self.taken = self._in_hand
                self._say(runs_pb2.RunRequest(receipt=runs_pb2.RunReceipt(received=self.taken)))
                self._permit()
        if not self._events:
            return None
        event = self._events.popleft()
        if isinstance(event, Setpoints):
            self._in_hand = event.end_index
        return event

    @property
    def has_events(self) -> bool:
        """Whether an event is here."""
        return bool(self._events)

    # What the connection needs.

    def step(self) -> Flow[None]:
        """Acts on the next message of the service; connects where there is no connection.

        Raises:
            Cancelled: once it was closed, by another thread perhaps.
        """
        if self._closed:
            raise Cancelled("the run was closed on this side", "Runs/Run")
        if self._stream is None:
            try:
                yield from retried(self._retries if self._decoder is None else self._reconnects, self._connect)
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
            if message is None:
                # The end of a run is said; this is none.
                self.broken()
            else:
                self._hear(message)

    def close(self) -> None:
        """Ends the connection for good; the run stays open."""
        self._closed = True
        self.broken()

    def broken(self) -> None:
        """Ends the connection."""
        with self._guard:
            if self._stream is not None:
                self._stream.cancel()
            self._stream = None

    def _connect(self) -> Flow[None]:
        stream: Stream = yield Open("Runs/Run", None, runs_pb2.RunResponse.FromString)
        try:
            stream.put(runs_pb2.RunRequest(start=self._start()))
            message = yield Read(stream)
            if message is None or message.WhichOneof("message") != "started":
                raise ContractError("a run did not begin with its start")
            is_new = not self.name
            self._begin(message.started)
            if not is_new:
                # What was decided unheard is in the log.
                yield from self._read_log()
        except BaseException:
            stream.cancel()
            raise
        with self._guard:
            self._stream = stream
            if self._closed:
                stream.cancel()
            for batch in self._waiting:
                self._say(runs_pb2.RunRequest(batch=batch))
            if self._stopping is not None:
                self._say(_command(self._stopping))
            if self._resuming:
                self._resuming = False
                why = "the connection broke before the run resumed; resume again where that is still wanted"
                self._events.append(Refused("RESUME", "CONNECTION_LOST", why))
            self._credit = 0
            self._permit()

    def _has_ended(self) -> Flow[bool]:
        """Whether the run has ended, which was not heard because the connection broke."""
        request = telemetry_pb2.GetRunRequest(name=self.name)
        answer = yield from call(self._retries, "Telemetry/GetRun", request, telemetry_pb2.GetRunResponse)
        if answer.run.state == telemetry_pb2.RUN_STATE_OPEN:
            return False
        yield from self._read_log()
        state = value_name(telemetry_pb2.RunState, answer.run.state)
        self.ended = Ended(state, answer.run.state_message, self._given, "")
        self._events.append(self.ended)
        return True

    def _start(self) -> runs_pb2.RunStart:
        options = self._options
        start = runs_pb2.RunStart(
            encoding=setpoints_pb2.ENCODING_PACKED_DOUBLE,
            columns=column_kinds(options.get("columns", ())),
        )
        if "sensor_time_ns" in options and self._decoder is None:
            start.sensor_time_ns = options["sensor_time_ns"]
        if self.name:
            start.run = self.name
            start.start_index = self.taken
            return start
        assert self._job is not None, "a run without a name has a job"
        start.job = resource("jobs", self._job)
        start.settings.interpolation_period_us = options.get("interpolation_period_us", 0)
        start.settings.generation_mode = value_of(machines_pb2.GenerationMode, options.get("generation_mode"))
        start.settings.frame = value_of(setpoints_pb2.Frame, options.get("frame"))
        return start

    def _begin(self, started: runs_pb2.RunStarted) -> None:
        first = self._decoder is None
        self.name = started.run
        self._decoder = Decoder(started.header)
        self._next_index = self.taken
        self.state = value_name(telemetry_pb2.MonitorState, started.state)
        self.held, self.feed_held = started.held, started.feed_held
        self.feed, self.spindle = started.overrides.feed, started.overrides.spindle
        for change in started.feed_changes[self._changes :]:
            self._change(change)
        with self._guard:
            if started.HasField("durable_batch"):
                self._settle(started.durable_batch)
                if first:
                    self._next_batch = started.durable_batch + 1
            if self._stopping == runs_pb2.RUN_COMMAND_KIND_HOLD and started.held:
                self._stopping = None

    def _read_log(self) -> Flow[None]:
        while True:
            request = telemetry_pb2.ListDecisionsRequest(run=self.name, after=self._log, page_size=500)
            page = yield from call(self._retries, "Telemetry/ListDecisions", request, telemetry_pb2.ListDecisionsResponse)
            for decision in page.decisions:
                self._decide(decision)
            if not page.decisions:
                return

    def _hear(self, message: runs_pb2.RunResponse) -> None:
        kind = message.WhichOneof("message")
        if kind == "chunk":
            self._take_in(message.chunk)
        elif kind == "decision":
            self._decide(message.decision)
        elif kind == "ack":
            with self._guard:
                self._settle(message.ack.durable_batch)
            event = Acknowledged.of(message.ack)
            self.state = event.state
            self._events.append(event)
        elif kind == "feed_change":
            self._change(message.feed_change)
        elif kind == "ended":
            self.ended = Ended.of(message.ended)
            self._events.append(self.ended)
            self.broken()
        elif kind == "command_refused":
            refused = message.command_refused
            self._resuming = False
            name = value_name(runs_pb2.RunCommandKind, refused.kind)
            self._events.append(Refused(name, refused.reason, refused.message))
        elif kind == "started":
            raise ContractError("a run began twice")
        # A message that a later contract has is none of ours.

    def _take_in(self, chunk: setpoints_pb2.SetpointChunk) -> None:
        assert self._decoder is not None, "a stream has begun with its header"
        block = self._decoder.block(chunk)
        if block.first_index != self._next_index:
            raise ContractError("setpoints are missing between two chunks")
        self._next_index = block.end_index
        # After a break those come again that were given but not taken.
        fresh = block.rows(max(self._given - block.first_index, 0))
        if fresh.count:
            self._given = fresh.end_index
            self._events.append(fresh)

    def _decide(self, decision: Any) -> None:
        self._log = max(self._log, decision.sequence)
        if decision.number < self.decided:
            return
        self.decided = decision.number + 1
        event = Decision.of(decision)
        self.feed, self.spindle = event.feed, event.spindle
        self.feed_held |= event.action == "HOLD_FEED"
        self._events.append(event)

    def _change(self, change: runs_pb2.RunFeedChange) -> None:
        event = FeedChange.of(change)
        self._changes += 1
        with self._guard:
            if event.cause == "HOLD":
                self.held, self._stopping = True, None
            elif event.cause == "RESUME":
                self.held, self.feed_held, self._resuming = False, False, False
            elif event.cause == "ABORT":
                self._stopping = None
        self._events.append(event)

    # With the guard held.

    def _settle(self, durable: int) -> None:
        while self._waiting and self._waiting[0].sequence <= durable:
            self._waiting.popleft()

    def _permit(self) -> None:
        if self._decoder is None or self._stream is None:
            return
        ahead = math.ceil(self._ahead_s * 1e6 / self._decoder.layout.period_us)
        credit = self.taken + ahead if ahead else 0
        if credit > self._credit:
            self._credit = credit
            self._say(runs_pb2.RunRequest(credit=runs_pb2.RunCredit(end_index=credit)))

    def _say(self, message: runs_pb2.RunRequest) -> None:
        # Without a connection it is said when there is one.
        if self._stream is not None:
            self._stream.put(message)


def _command(kind: runs_pb2.RunCommandKind) -> runs_pb2.RunRequest:
    return runs_pb2.RunRequest(command=runs_pb2.RunCommand(kind=kind))


def batch_of(
    time_ns: Samples,
    tool: tuple[Samples, Samples] | None,
    work: tuple[Samples, Samples] | None,
    commanded: tuple[Samples, Samples] | None,
    spindle_angle_deg: Samples | None,
    spindle_rev_per_min: Samples | None,
    contact: Samples | None,
    events: Iterable[telemetry_pb2.MachineEvent],
) -> telemetry_pb2.TelemetryBatch:
    """Telemetry as a message.

    Raises:
        SourceError: for columns of different lengths.
    """
    times = np.asarray(time_ns, dtype=np.uint64)
    batch = telemetry_pb2.TelemetryBatch(time_ns=times.tolist(), events=events)

    def column(name: str, values: Samples, kind: type[np.generic] = np.float64) -> list[Any]:
        array = np.asarray(values, dtype=kind)
        if array.shape != times.shape:
            raise SourceError(f"{name} has the shape {array.shape}, and the time stamps have {times.shape}")
        found: list[Any] = array.tolist()
        return found

    for name, pair in (("tool", tool), ("work", work), ("commanded", commanded)):
        if pair is not None:
            target = getattr(batch, name)
            target.x.extend(column(f"{name} x", pair[0]))
            target.y.extend(column(f"{name} y", pair[1]))
    if spindle_angle_deg is not None:
        batch.spindle_angle_deg.extend(column("spindle_angle_deg", spindle_angle_deg))
    if spindle_rev_per_min is not None:
        batch.spindle_rev_per_min.extend(column("spindle_rev_per_min", spindle_rev_per_min))
    if contact is not None:
        # One value stands for all samples.
        batch.contact.extend(column("contact", np.broadcast_to(np.asarray(contact), times.shape), np.bool_))
    return batch


class RunInfo:
    """What both clients know of a live run, and what needs no waiting."""

    def __init__(self, live: LiveRun) -> None:
        """Of this run."""
        self._live = live

    @property
    def name(self) -> str:
        """The run, `runs/…`."""
        return self._live.name

    @property
    def state(self) -> str:
        """State of the monitoring, as in `BASELINE` or `MEASURING`."""
        return self._live.state

    @property
    def held(self) -> bool:
        """Whether the operator holds the feed."""
        return self._live.held

    @property
    def feed_held(self) -> bool:
        """Whether an escalation holds the feed: acknowledge its condition, then resume."""
        return self._live.feed_held

    @property
    def spindle(self) -> float:
        """Spindle override decided last, as a ratio (1 = programmed): the speed is the caller's to set."""
        return self._live.spindle

    @property
    def taken(self) -> int:
        """Setpoints taken, counted from the first: where to take the run up."""
        return self._live.taken

    @property
    def decided(self) -> int:
        """Decisions heard."""
        return self._live.decided

    @property
    def period_us(self) -> float:
        """Time from one setpoint to the next, µs."""
        return self._live.layout.period_us

    @property
    def ended(self) -> Ended | None:
        """The end, once it was heard."""
        return self._live.ended

    @property
    def ahead_s(self) -> float:
        """Time of the setpoints that may come before those before them were taken, s. Can be set at any time; 0 hands out no more."""
        return self._live.ahead_s

    @ahead_s.setter
    def ahead_s(self, ahead_s: float) -> None:
        self._live.ahead_s = ahead_s

    def hold(self) -> None:
        """Holds the feed: the path comes to rest as soon as it can. Said again after a break."""
        self._live.command("HOLD")

    def resume(self) -> None:
        """Ends a hold. Not said again after a break: then there is an event `Refused` with the reason `CONNECTION_LOST`."""
        self._live.command("RESUME")

    def abort(self) -> None:
        """Ends the run once the path has come to rest, for which it needs to be iterated on. Said again after a break."""
        self._live.command("ABORT")

    def close(self) -> None:
        """Ends the connection, from any thread. A run that has not ended stays open, to be taken up; who iterates gets `Cancelled`."""
        self._live.close()
