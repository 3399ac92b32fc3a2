"""What can go wrong: every error of a call with its status code and the details of `google.rpc`."""

from __future__ import annotations

import datetime
import re
from dataclasses import dataclass, field
from typing import Any, ClassVar

import grpc
from google.protobuf.message import DecodeError
from google.rpc import error_details_pb2, status_pb2

# Trailer that carries a google.rpc.Status.
_DETAILS = "grpc-status-details-bin"
# What the library says of a connection that broke under a call, by whichever side; the last where asyncio wrote into the call just then. Everything else without details is an error of this side,
# as of a request that cannot be written, or of something between that is no such service.
_BROKEN = re.compile(r"RST_STREAM|GOAWAY|stream removed|no status received|(socket|endpoint|transport|connection) (closed|reset)|internal error from core", re.IGNORECASE)


class Error(Exception):
    """Any error of this package."""


class ContractError(Error):
    """The service has sent what its contract excludes."""


class ClosedError(Error):
    """A call of a client that was closed."""


class SourceError(Error, ValueError):
    """A program, a file or an argument that cannot be meant; nothing was sent."""


@dataclass(frozen=True)
class Violation:
    """A field of a request that is wrong."""

    field: str
    """Path of the field, as in `interpolation_period_us`."""
    description: str
    """What is wrong with it."""

    def __str__(self) -> str:
        return f"{self.field}: {self.description}"


@dataclass(frozen=True)
class Details:
    """What the service says about an error besides its code and message."""

    reason: str = ""
    """Why, in upper snake case, as in `INVALID_FIELDS`; empty where the error is the transport's own."""
    domain: str = ""
    """Who gives the reason: `feedwave`; empty where the error is the transport's own."""
    metadata: dict[str, str] = field(default_factory=dict)
    """Figures that belong to the reason."""
    violations: tuple[Violation, ...] = ()
    """Fields that are wrong; the first ones, and `violations_not_listed` of the metadata counts the others."""
    retry_after_s: float | None = None
    """After how long to ask again, s; absent where the service does not say."""
    resource: str = ""
    """Name of the resource that is missing or there already; empty where the error is about none."""
    raw: tuple[Any, ...] = ()
    """All details as messages of `google.rpc`."""


class ServiceError(Error):
    """A call that the service, or the connection to it, has ended with an error. There is a class for each status code."""

    status: ClassVar[grpc.StatusCode] = grpc.StatusCode.UNKNOWN

    def __init__(self, message: str, method: str = "", details: Details | None = None) -> None:
        """Makes an error of a call of `method`."""
        self.message = message
        self.method = method
        self.details = details or Details()
        super().__init__(f"{self.code.name}: {message}")

    @property
    def code(self) -> grpc.StatusCode:
        """The status code."""
        return self.status

    @property
    def reason(self) -> str:
        """Why, in upper snake case; empty where the error is the transport's own."""
        return self.details.reason

    @property
    def violations(self) -> tuple[Violation, ...]:
        """Fields of the request that are wrong."""
        return self.details.violations

    @property
    def retry_after_s(self) -> float | None:
        """After how long to ask again, s; absent where the service does not say."""
        return self.details.retry_after_s

    @property
    def is_passing(self) -> bool:
        """Whether trying again can help: the service cannot be reached or says to ask again, or the connection broke."""
        if self.status is grpc.StatusCode.UNAVAILABLE:
            return True
        if self.status is grpc.StatusCode.RESOURCE_EXHAUSTED:
            # Of what is exhausted only that comes back which the service says to ask for again: no message becomes smaller.
            return self.retry_after_s is not None
        # A connection that breaks in the middle: the service itself always says why.
        broken = (grpc.StatusCode.UNKNOWN, grpc.StatusCode.INTERNAL, grpc.StatusCode.CANCELLED)
        return self.status in broken and not self.details.domain and _BROKEN.search(self.message) is not None


class Cancelled(ServiceError):
    """CANCELLED: the call was broken off."""

    status = grpc.StatusCode.CANCELLED


class Unknown(ServiceError):
    """UNKNOWN: no more is known."""


class InvalidArgument(ServiceError):
    """INVALID_ARGUMENT: `violations` names what is wrong with the request."""

    status = grpc.StatusCode.INVALID_ARGUMENT


class DeadlineExceeded(ServiceError, TimeoutError):
    """DEADLINE_EXCEEDED: it took too long."""

    status = grpc.StatusCode.DEADLINE_EXCEEDED


class NotFound(ServiceError):
    """NOT_FOUND: there is no such resource."""

    status = grpc.StatusCode.NOT_FOUND


class AlreadyExists(ServiceError):
    """ALREADY_EXISTS: the name is taken."""

    status = grpc.StatusCode.ALREADY_EXISTS


class PermissionDenied(ServiceError, PermissionError):
    """PERMISSION_DENIED: the client lacks a role."""

    status = grpc.StatusCode.PERMISSION_DENIED


class ResourceExhausted(ServiceError):
    """RESOURCE_EXHAUSTED: a limit was reached."""

    status = grpc.StatusCode.RESOURCE_EXHAUSTED


class FailedPrecondition(ServiceError):
    """FAILED_PRECONDITION: not in this state."""

    status = grpc.StatusCode.FAILED_PRECONDITION


class Aborted(ServiceError):
    """ABORTED: another has changed the same, or has taken up the run."""

    status = grpc.StatusCode.ABORTED


class OutOfRange(ServiceError):
    """OUT_OF_RANGE: a position beyond the end."""

    status = grpc.StatusCode.OUT_OF_RANGE


class Unimplemented(ServiceError):
    """UNIMPLEMENTED: the service does not have the method."""

    status = grpc.StatusCode.UNIMPLEMENTED


class Internal(ServiceError):
    """INTERNAL: a fault of the service."""

    status = grpc.StatusCode.INTERNAL


class Unavailable(ServiceError, ConnectionError):
    """UNAVAILABLE: the service cannot be reached, or cannot answer now."""

    status = grpc.StatusCode.UNAVAILABLE


class DataLoss(ServiceError):
    """DATA_LOSS: stored data is damaged."""

    status = grpc.StatusCode.DATA_LOSS


class Unauthenticated(ServiceError):
    """UNAUTHENTICATED: the service does not know who asks."""

    status = grpc.StatusCode.UNAUTHENTICATED


_CLASSES: dict[grpc.StatusCode, type[ServiceError]] = {kind.status: kind for kind in ServiceError.__subclasses__()}


def from_rpc(error: grpc.RpcError, method: str) -> ServiceError:
    """The error of a call, synchronous or asynchronous, as one of this module."""
    # Both kinds of calls have these three, but no type says so.
    call: Any = error
    kind = _CLASSES.get(call.code(), Unknown)
    trailers = {key: value for key, value in (call.trailing_metadata() or ())}
    return kind(call.details() or "no message", method, _details(trailers.get(_DETAILS)))


def of_code(code: str, message: str, method: str, details: Details) -> ServiceError:
    """The error of a status code by its name, as in `INVALID_ARGUMENT`."""
    return _CLASSES.get(grpc.StatusCode[code], Unknown)(message, method, details)


def _details(data: bytes | str | None) -> Details:
    if not isinstance(data, bytes):
        return Details()
    try:
        status = status_pb2.Status.FromString(data)
    except DecodeError:
        return Details()
    known = {
        kind.DESCRIPTOR.full_name: kind
        for kind in (
            error_details_pb2.BadRequest,
            error_details_pb2.ErrorInfo,
            error_details_pb2.RetryInfo,
            error_details_pb2.ResourceInfo,
            error_details_pb2.PreconditionFailure,
            error_details_pb2.QuotaFailure,
        )
    }
    found: dict[str, Any] = {}
    for detail in status.details:
        kind = known.get(detail.TypeName())
        if kind is not None:
            message = kind()
            if detail.Unpack(message):
                found[kind.DESCRIPTOR.name] = message
    info = found.get("ErrorInfo")
    bad = found.get("BadRequest")
    retry = found.get("RetryInfo")
    resource = found.get("ResourceInfo")
    delay: datetime.timedelta | None = retry.retry_delay.ToTimedelta() if retry is not None else None
    return Details(
        reason=info.reason if info else "",
        domain=info.domain if info else "",
        metadata=dict(info.metadata) if info else {},
        violations=tuple(Violation(one.field, one.description) for one in bad.field_violations) if bad else (),
        retry_after_s=delay.total_seconds() if delay is not None else None,
        resource=resource.resource_name if resource else "",
        raw=tuple(found.values()),
    )
