"""The client's half of telemetry alone: of a machine that has its setpoints from elsewhere."""

from __future__ import annotations

from typing import Any

from google.protobuf.message import Message

from ._names import resource
from ._telemetry import Link
from .v1 import telemetry_pb2


class Ingest(Link):
    """A run without setpoints on the client's side."""

    METHOD = "Telemetry/Ingest"
    RESPONSE = telemetry_pb2.IngestResponse

    _finishing = False

    def finish(self) -> None:
        """Ends the run once everything is durable."""
        with self._guard:
            self._finishing = True
            self._say(telemetry_pb2.IngestRequest(end=telemetry_pb2.IngestEnd()))

    def _start(self) -> Message:
        start = telemetry_pb2.IngestStart()
        if self._sensor_time_ns is not None and not self._has_begun:
            start.sensor_time_ns = self._sensor_time_ns
        if self.name:
            start.run = self.name
        else:
            assert self._job is not None, "a run without a name has a job"
            start.job = resource("jobs", self._job)
        return telemetry_pb2.IngestRequest(start=start)

    def _wrapped(self, batch: telemetry_pb2.TelemetryBatch) -> Message:
        return telemetry_pb2.IngestRequest(batch=batch)

    def _begin(self, started: Any) -> None:
        pass

    def _say_again(self) -> None:
        if self._finishing:
            self._say(telemetry_pb2.IngestRequest(end=telemetry_pb2.IngestEnd()))

    def _hear_more(self, kind: str | None, message: Any) -> None:
        pass

    def _ends_here(self) -> bool:
        return self._finishing and not self.waits
