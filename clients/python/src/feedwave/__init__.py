"""Client of feedwave: validate machining programs, plan setpoints, run live.

    import feedwave

    with feedwave.connect() as client:
        print(client.validate("part.nc", machine="lathe"))

`feedwave.aio` is the same for asyncio, `feedwave.plot` draws pictures, `feedwave.v1` has the messages of the contract.
"""

from ._flow import Retries
from ._options import RunOptions, Settings, StreamOptions, load_profile
from ._sync.client import Client, Job, connect
from ._sync.run import Run, Telemetry
from .errors import (
    Aborted,
    AlreadyExists,
    Cancelled,
    ClosedError,
    ContractError,
    DataLoss,
    DeadlineExceeded,
    Details,
    Error,
    FailedPrecondition,
    Internal,
    InvalidArgument,
    NotFound,
    OutOfRange,
    PermissionDenied,
    ResourceExhausted,
    ServiceError,
    SourceError,
    Unauthenticated,
    Unavailable,
    Unimplemented,
    Unknown,
    Violation,
)
from .events import Acknowledged, Decision, Ended, Event, FeedChange, Refused, SpindleRequest
from .improvement import Improvement
from .program import Program
from .report import Cure, Finding, Place, Report, Severity, Value
from .setpoints import Override, Setpoints

__version__ = "0.1.0"

__all__ = [
    "Aborted",
    "Acknowledged",
    "AlreadyExists",
    "Cancelled",
    "Client",
    "ClosedError",
    "ContractError",
    "Cure",
    "DataLoss",
    "DeadlineExceeded",
    "Decision",
    "Details",
    "Ended",
    "Error",
    "Event",
    "FailedPrecondition",
    "FeedChange",
    "Finding",
    "Improvement",
    "Internal",
    "InvalidArgument",
    "Job",
    "NotFound",
    "OutOfRange",
    "Override",
    "PermissionDenied",
    "Place",
    "Program",
    "Refused",
    "Report",
    "ResourceExhausted",
    "Retries",
    "Run",
    "RunOptions",
    "ServiceError",
    "Setpoints",
    "Settings",
    "Severity",
    "SourceError",
    "SpindleRequest",
    "StreamOptions",
    "Telemetry",
    "Unauthenticated",
    "Unavailable",
    "Unimplemented",
    "Unknown",
    "Value",
    "Violation",
    "connect",
    "load_profile",
]
