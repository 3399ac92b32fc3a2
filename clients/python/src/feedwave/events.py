"""What a live run tells: setpoints (`feedwave.Setpoints`) and the events of this module."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from ._names import value_name
from .setpoints import Setpoints
from .v1 import decisions_pb2, runs_pb2, telemetry_pb2


@dataclass(frozen=True)
class Decision:
    """What the telemetry of a window led to. It is durable, and heard once."""

    number: int
    """Counts up from 0 in a run."""
    run: str
    job: str
    action: str
    """What is to be done: `KEEP`, `CHANGE`, `HOLD`, `STOP` or `HOLD_FEED`."""
    reason: str
    """Which rule decided, as in `FEED_ABOVE_LIMIT`."""
    feed: float
    """Feed override after it, as a ratio (1 = programmed)."""
    spindle: float
    """Spindle override after it, as a ratio; the speed is the client's to set."""
    time_s: float
    """When it was made, on the sensors' clock, s."""
    deviation: float | None
    """Largest deviation of the tool in the window, unit of the monitoring; absent where no window was judged."""
    hold_reason: str
    """Why nothing is judged or everything is held, as in `TOO_FEW_SAMPLES`; empty where that is not so."""
    samples: int
    """Samples of the window."""
    valid_samples: int
    """Those of them that could be used; `proto.span.removed` says why others could not."""
    proto: decisions_pb2.Decision
    """The decision as the contract has it, with everything that it depends on."""

    @classmethod
    def of(cls, proto: decisions_pb2.Decision) -> Decision:
        """From the contract's message."""
        outcome, inputs = proto.outcome, proto.inputs
        return cls(
            number=proto.number,
            run=proto.run,
            job=proto.job,
            action=value_name(decisions_pb2.DecisionAction, outcome.action),
            reason=value_name(decisions_pb2.DecisionReason, outcome.reason),
            feed=outcome.after.feed,
            spindle=outcome.after.spindle,
            time_s=proto.sensor_time_ns * 1e-9,
            deviation=inputs.process.max_deviation if inputs.WhichOneof("evidence") == "process" else None,
            hold_reason=value_name(decisions_pb2.HoldReason, outcome.hold_reason) if outcome.hold_reason else "",
            samples=proto.span.samples,
            valid_samples=proto.span.valid,
            proto=proto,
        )

    def _removed(self) -> str:
        removed = [f"{count} {field.name}" for field, count in self.proto.span.removed.ListFields()]
        return f", {self.valid_samples} of {self.samples} samples valid: {', '.join(removed)}" if removed else ""

    def __str__(self) -> str:
        deviation = "" if self.deviation is None else f", deviation {self.deviation:.6g}"
        why = f" ({self.hold_reason}{self._removed()})" if self.hold_reason else ""
        return f"decision {self.number} at {self.time_s:.3f} s: {self.action}, {self.reason}{why}{deviation}, feed {100 * self.feed:.4g} %"


@dataclass(frozen=True)
class FeedChange:
    """The feed changes from a setpoint on."""

    setpoint_index: int
    """First setpoint under it."""
    ratio: float
    """Ratio of the feed to the programmed one, 0.01 to 2, or 0: feed hold."""
    cause: str
    """`DECISION`, `HOLD`, `RESUME`, `STOP`, `ABORT`, `ESCALATION` or `SPINDLE`."""
    decision_number: int
    """The decision, where one is the cause; 0 otherwise."""

    @classmethod
    def of(cls, proto: runs_pb2.RunFeedChange) -> FeedChange:
        """From the contract's message."""
        cause = value_name(runs_pb2.FeedChangeCause, proto.cause)
        return cls(proto.setpoint_index, proto.ratio, cause, proto.decision_number)


@dataclass(frozen=True)
class Acknowledged:
    """Telemetry that is durable: it survives a kill of the service."""

    durable_batch: int
    """Number of the newest durable batch."""
    state: str
    """State of the monitoring: `BASELINE`, `IDLE_RUN_UP`, `WAITING_FOR_CONTACT`, `SETTLING`, `MEASURING` or `STOPPED`."""

    @classmethod
    def of(cls, proto: telemetry_pb2.TelemetryAck) -> Acknowledged:
        """From the contract's message."""
        return cls(proto.durable_batch, value_name(telemetry_pb2.MonitorState, proto.state))


@dataclass(frozen=True)
class Refused:
    """A command that was not followed: the run goes on as before."""

    command: str
    """`HOLD`, `RESUME` or `ABORT`."""
    reason: str
    """`CONDITION_NOT_ACKNOWLEDGED`, or `CONNECTION_LOST` for a resume of which it is unknown whether it arrived: it is not repeated."""
    message: str


@dataclass(frozen=True)
class SpindleRequest:
    """A planned change of the spindle speed has come to its place: the path rests, and no setpoint follows until `answer_spindle`."""

    decision_number: int
    """The decision, which the answer names."""
    setpoint_index: int
    """First setpoint behind the place."""
    spindle: float
    """Spindle override requested, a ratio to the programmed speed."""
    rev_per_min: float | None
    """Speed requested, rev/min; absent while it depends on the radius."""

    @classmethod
    def of(cls, proto: runs_pb2.RunSpindleRequest) -> SpindleRequest:
        """From the contract's message."""
        rev_per_min = proto.rev_per_min if proto.HasField("rev_per_min") else None
        return cls(proto.decision_number, proto.setpoint_index, proto.spindle, rev_per_min)


@dataclass(frozen=True)
class Ended:
    """The end of a run, and its last event."""

    state: str
    """`FINISHED`, `STOPPED` or `ABORTED`."""
    message: str
    """Why, where there is more to say."""
    setpoint_count: int
    """Setpoints handed out, counted from the first."""
    digest: str
    """SHA-256 of their values, in hexadecimal: what a replay is compared with; empty where the connection broke at the end."""

    @classmethod
    def of(cls, proto: runs_pb2.RunEnded) -> Ended:
        """From the contract's message."""
        return cls(value_name(telemetry_pb2.RunState, proto.state), proto.message, proto.setpoint_count, proto.digest)


Event: TypeAlias = "Setpoints | Decision | FeedChange | Acknowledged | Refused | SpindleRequest | Ended"
"""Any event of a live run."""
