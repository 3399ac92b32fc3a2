"""What a job is, for both clients."""

from __future__ import annotations

import datetime

from ._requests import state_name
from .v1 import jobs_pb2, report_pb2


class JobInfo:
    """A job as the service last described it."""

    def __init__(self, proto: jobs_pb2.Job) -> None:
        """A job of this message."""
        self.proto = proto

    @property
    def name(self) -> str:
        """Resource name, `jobs/…`."""
        return self.proto.name

    @property
    def state(self) -> str:
        """`PENDING`, `VALIDATING`, `READY`, `REJECTED`, `CANCELLED` or `FAILED`."""
        return state_name(self.proto)

    @property
    def state_message(self) -> str:
        """Why it is in this state, where there is more to say."""
        return self.proto.state_message

    @property
    def is_ready(self) -> bool:
        """Whether setpoints can be streamed."""
        return self.proto.state == jobs_pb2.JOB_STATE_READY

    @property
    def display_name(self) -> str:
        """Name for people."""
        return self.proto.display_name

    @property
    def machine(self) -> str:
        """Its machine, `machines/…`."""
        return self.proto.machine

    @property
    def summary(self) -> report_pb2.ProgramSummary:
        """Counts, times (s), lengths (mm), extents and peaks of its plan; empty until it is validated."""
        return self.proto.summary

    @property
    def created(self) -> datetime.datetime:
        """When it was created (UTC)."""
        return self.proto.create_time.ToDatetime(datetime.timezone.utc)

    def __repr__(self) -> str:
        return f"<Job {self.name} {self.state}{f' {self.display_name!r}' if self.display_name else ''}>"


def name_of(resource: str | JobInfo) -> str:
    """The name of a job, or a name as it is."""
    return resource if isinstance(resource, str) else resource.name
