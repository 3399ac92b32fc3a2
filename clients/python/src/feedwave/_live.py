"""The client's half of a live run: credits, receipts and commands, besides telemetry and decisions.

A connection that breaks is taken up at the first setpoint that was not taken; setpoints that come a second time are dropped by their index.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from google.protobuf.message import Message

from ._flow import Retries
from ._names import resource, seconds, value_name, value_of, whole
from ._options import MOST_32_BITS, RunOptions, given_of, message_of
from ._requests import column_kinds
from ._telemetry import RECONNECT_FOR_S, Link, TelemetryInfo
from .errors import ContractError
from .events import Ended, Event, FeedChange, Refused, SpindleRequest
from .setpoints import Decoder, Layout, Setpoints
from .v1 import decisions_pb2, machines_pb2, recording_pb2, runs_pb2, setpoints_pb2, telemetry_pb2

# Time of the setpoints that may come ahead of those that were taken, s.
AHEAD_S = 0.1


class LiveRun(Link):
    """A live run on the client's side."""

    METHOD = "Runs/Run"
    RESPONSE = runs_pb2.RunResponse

    def __init__(self, retries: Retries, job: str | None, run: str | None, start: int, decided: int, options: RunOptions) -> None:
        """A run to begin (`job`) or to take up (`run`), of which `start` setpoints and `decided` decisions are known already."""
        given = given_of(RunOptions.__optional_keys__, options, *(("start", "decided") if run else ()))
        super().__init__(retries, job, run, decided, given.get("reconnect_for_s", RECONNECT_FOR_S), given.get("sensor_time_ns"))
        self._settings, self._columns = _settings(given), column_kinds(given.get("columns", ()))
        self._ahead_s = seconds("ahead_s", given.get("ahead_s", AHEAD_S))
        start = whole("start", start)
        # Setpoints taken, given to the caller, in the caller's hand, and permitted.
        self.taken, self._given, self._in_hand, self._credit = start, start, start, 0
        # Index of the next setpoint of this connection.
        self._next_index = start
        self._changes = 0
        self._decoder: Decoder | None = None
        self.held = False
        # A command that stops, until it is known to act; and whether a resume is under way.
        self._stopping: runs_pb2.RunCommandKind | None = None
        self._resuming = False

    @property
    def layout(self) -> Layout:
        """What the setpoints are made of."""
        assert self._decoder is not None, "a run has begun when the caller has it"
        return self._decoder.layout

    @property
    def setpoint_count(self) -> int:
        """Setpoints received."""
        return self._given

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
            self._ahead_s = seconds("ahead_s", ahead_s)
            self._permit()

    def next_event(self) -> Event | None:
        """The next event that is here. Whoever asks for another one has taken the setpoints before."""
        with self._guard:
            if self._in_hand > self.taken:
                self.taken = self._in_hand
                self._say(runs_pb2.RunRequest(receipt=runs_pb2.RunReceipt(received=self.taken)))
                self._permit()
        event = super().next_event()
        if isinstance(event, Setpoints):
            self._in_hand = event.end_index
        return event

    def _start(self) -> Message:
        start = runs_pb2.RunStart(encoding=setpoints_pb2.ENCODING_RAW_DOUBLE, columns=self._columns)
        if self._sensor_time_ns is not None and not self._has_begun:
            start.sensor_time_ns = self._sensor_time_ns
        if self.name:
            start.run = self.name
            start.start_index = self.taken
            return runs_pb2.RunRequest(start=start)
        assert self._job is not None, "a run without a name has a job"
        start.job = resource("jobs", self._job)
        start.settings.CopyFrom(self._settings)
        return runs_pb2.RunRequest(start=start)

    def _wrapped(self, batch: telemetry_pb2.TelemetryBatch) -> Message:
        return runs_pb2.RunRequest(batch=batch)

    def _begin(self, started: runs_pb2.RunStarted) -> None:
        self._decoder = Decoder(started.header)
        self._next_index = self.taken
        self.held = started.held
        for change in started.feed_changes[self._changes :]:
            self._changes += 1
            event = FeedChange.of(change)
            self._events.append(event)
            # What acted unheard needs no further word.
            if event.cause == "RESUME":
                self._resuming = False
            elif event.cause == "ABORT":
                self._stopping = None

    def _say_again(self) -> None:
        if self._stopping == runs_pb2.RUN_COMMAND_KIND_HOLD and self.held:
            self._stopping = None
        if self._stopping is not None:
            self._say(_command(self._stopping))
        if self._resuming:
            self._resuming = False
            why = "the connection broke before the run resumed; resume again where that is still wanted"
            self._events.append(Refused("RESUME", "CONNECTION_LOST", why))
        self._credit = 0
        self._permit()

    def _ends_here(self) -> bool:
        # The end of a live run is said; the end of its stream is a break.
        return False

    def _hear_more(self, kind: str | None, message: runs_pb2.RunResponse) -> None:
        if kind == "chunk":
            self._take_in(message.chunk)
        elif kind == "feed_change":
            self._change(message.feed_change)
        elif kind == "ended":
            self._end(Ended.of(message.ended))
            self.broken()
        elif kind == "spindle_request":
            self._events.append(SpindleRequest.of(message.spindle_request))
        elif kind == "command_refused":
            refused = message.command_refused
            self._resuming = False
            name = value_name(runs_pb2.RunCommandKind, refused.kind)
            self._events.append(Refused(name, refused.reason, refused.message))

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

    def _permit(self) -> None:
        if self._decoder is None or self._stream is None:
            return
        ahead = math.ceil(self._ahead_s * 1e6 / self._decoder.layout.period_us)
        credit = self.taken + ahead if ahead else 0
        if credit > self._credit:
            self._credit = credit
            self._say(runs_pb2.RunRequest(credit=runs_pb2.RunCredit(end_index=credit)))


def _settings(given: Mapping[str, Any]) -> runs_pb2.RunSettings:
    settings = runs_pb2.RunSettings(
        interpolation_period_us=whole("interpolation_period_us", given.get("interpolation_period_us", 0), MOST_32_BITS),
        generation_mode=value_of(machines_pb2.GenerationMode, given.get("generation_mode")),
        frame=value_of(setpoints_pb2.Frame, given.get("frame")),
    )
    if "recording" in given:
        settings.recording.CopyFrom(message_of(recording_pb2.RecordingSettings, given["recording"]))
    return settings


def _command(kind: runs_pb2.RunCommandKind) -> runs_pb2.RunRequest:
    return runs_pb2.RunRequest(command=runs_pb2.RunCommand(kind=kind))


class RunInfo(TelemetryInfo):
    """What both clients know of a live run, and what needs no waiting."""

    def __init__(self, live: LiveRun) -> None:
        """Of this run."""
        super().__init__(live)
        self._live = live

    @property
    def held(self) -> bool:
        """Whether the operator holds the feed."""
        return self._live.held

    @property
    def taken(self) -> int:
        """Setpoints taken, counted from the first: where to take the run up."""
        return self._live.taken

    @property
    def period_us(self) -> float:
        """Time from one setpoint to the next, µs."""
        return self._live.layout.period_us

    @property
    def ahead_s(self) -> float:
        """Time of the setpoints that may come before those before them were taken, s. Can be set at any time; 0 hands out no more."""
        return self._live.ahead_s

    @ahead_s.setter
    def ahead_s(self, ahead_s: float) -> None:
        self._live.ahead_s = ahead_s

    def answer_spindle(
        self, decision_number: int, answer: str, *, reached_ns: int | None = None, rev_per_min: float | None = None, note: str = ""
    ) -> bool:
        """Answers a decision on the spindle speed: `ACCEPTED`, `REACHED` (with time on the sensors' clock and measured speed) or `REFUSED`.

        The answer is a batch of telemetry of its own: it is sent again after a break until it is durable. `False` while too many batches wait.
        """
        said = telemetry_pb2.SpindleAnswer(decision_number=decision_number, kind=value_of(decisions_pb2.SpindleAnswerKind, answer), note=note)
        if reached_ns is not None:
            said.reached_ns = reached_ns
        if rev_per_min is not None:
            said.rev_per_min = rev_per_min
        return self._live.send(telemetry_pb2.TelemetryBatch(events=[telemetry_pb2.MachineEvent(spindle_answer=said)]))

    def hold(self) -> None:
        """Holds the feed: the path comes to rest as soon as it can. Said again after a break."""
        self._live.command("HOLD")

    def resume(self) -> None:
        """Ends a hold. Not said again after a break: then there is an event `Refused` with the reason `CONNECTION_LOST`."""
        self._live.command("RESUME")

    def abort(self) -> None:
        """Ends the run once the path has come to rest, for which it needs to be iterated on. Said again after a break."""
        self._live.command("ABORT")
