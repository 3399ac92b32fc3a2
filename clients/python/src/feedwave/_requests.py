"""Flows of the methods of a client that are no live run."""

from __future__ import annotations

import dataclasses
import time
import uuid
from collections.abc import Iterator
from typing import Any, TypeVar

from ._connection import MAX_MESSAGE_BYTES
from ._flow import Call, Emit, Flow, Open, Read, Retries, Stream, Work, call, cancelling, pages, retried
from ._names import listed, resource, seconds, value_name, value_of, whole
from ._options import (
    MOST_32_BITS,
    Machine,
    Settings,
    StreamOptions,
    given_of,
    inline_files,
    message_of,
    settings_of,
)
from .errors import ContractError, DeadlineExceeded, InvalidArgument, NotFound, ResourceExhausted, ServiceError, SourceError, Violation
from .program import Program
from .report import Report
from .setpoints import Decoder, Setpoints, overrides_of
from .v1 import jobs_pb2, machines_pb2, programs_pb2, setpoints_pb2

# Programs up to this size travel with the request, larger ones are uploaded, and these as well where a service permits less.
INLINE_BYTES = 512 * 1024
# What takes programs that are too large to be validated with a request.
_UPLOADED = "client.submit(…).wait().report() uploads it, up to the service's limit for uploads"
# Programs up to this size are read back to show findings of a job under their lines.
SHOWN_BYTES = 16 << 20

T = TypeVar("T")

_UNDER_WAY = (jobs_pb2.JOB_STATE_PENDING, jobs_pb2.JOB_STATE_VALIDATING)


def _machine(machine: str) -> str:
    return resource("machines", machine)


def validate(
    retries: Retries, program: Program, machine: Machine, tools: list[str], files: list[Program], settings: Settings, overrides: Any
) -> Flow[Report]:
    """Validates a program without storing anything."""
    settings = settings_of(settings)
    check_size([program, *files], _UPLOADED)
    request = jobs_pb2.ValidateProgramRequest(
        inline_program=program.read(),
        tools=tools,
        programs=inline_files(files),
        overrides=overrides_of(overrides),
        interpolation_period_us=settings.interpolation_period_us,
        generation_mode=value_of(machines_pb2.GenerationMode, settings.generation_mode),
        vibration_envelope=value_of(machines_pb2.VibrationEnvelope, settings.vibration_envelope),
        oscillation=settings.oscillation,
        offsets=settings.offsets,
    )
    if isinstance(machine, str):
        request.machine = _machine(machine)
    else:
        request.profile.CopyFrom(message_of(machines_pb2.MachineProfile, machine))
    response = yield from advised(call(retries, "Jobs/ValidateProgram", request, jobs_pb2.ValidateProgramResponse), _UPLOADED)
    return Report(response.report, program, files)


def check_size(programs: list[Program], instead: str) -> None:
    """Refuses programs that no service takes in one request, before they are read. Most services take less, and say so.

    Raises:
        SourceError: for these, with what to do instead.
    """
    size = sum(program.size for program in programs)
    if size > MAX_MESSAGE_BYTES:
        name = programs[0].name or "the program"
        raise SourceError(f"{name}: {size} bytes, more than the {MAX_MESSAGE_BYTES} that a request can have: {instead}")


def advised(flow: Flow[T], instead: str) -> Flow[T]:
    """A call that carries programs: where the service says that they are too large, the error says what to do instead."""
    try:
        return (yield from flow)
    except (InvalidArgument, ResourceExhausted) as error:
        if any(map(_is_of_size, error.violations)) or error.reason == "MESSAGE_TOO_LARGE":
            raise type(error)(f"{error.message}: {instead}", error.method, error.details) from None
        raise


def _is_of_size(violation: Violation) -> bool:
    """Whether it is that programs are larger than the service takes with a request."""
    return violation.field in ("inline_program", "programs") and " bytes" in violation.description


def submit(
    retries: Retries,
    program: Program,
    machine: str,
    tools: list[str],
    files: list[Program],
    settings: Settings,
    display_name: str | None,
    request_id: str | None,
) -> Flow[jobs_pb2.Job]:
    """Stores a job; what is large is uploaded before."""
    settings = settings_of(settings)
    request = jobs_pb2.CreateJobRequest(
        # With an id of its own a request can be sent again without making another job.
        request_id=request_id or str(uuid.uuid4()),
        machine=_machine(machine),
        display_name=program.name if display_name is None else display_name,
        file_name=program.name,
        tools=tools,
        interpolation_period_us=settings.interpolation_period_us,
        generation_mode=value_of(machines_pb2.GenerationMode, settings.generation_mode),
        vibration_envelope=value_of(machines_pb2.VibrationEnvelope, settings.vibration_envelope),
        oscillation=settings.oscillation,
        offsets=settings.offsets,
    )
    left = INLINE_BYTES
    if program.size <= left:
        request.inline_program = program.read()
        left -= program.size
    else:
        request.program = yield from upload(retries, program)
    for file in files:
        if file.size <= left:
            left -= file.size
            request.programs.add(name=file.name, inline_program=file.read())
        else:
            stored = yield from upload(retries, file)
            request.programs.add(name=file.name, program=stored)
    try:
        response = yield from call(retries, "Jobs/CreateJob", request, jobs_pb2.CreateJobResponse)
    except InvalidArgument as error:
        if not (error.violations and all(map(_is_of_size, error.violations))):
            raise
        # This service takes less with a request than others.
        if request.HasField("inline_program"):
            request.program = yield from upload(retries, program)
        for sent, file in zip(request.programs, files, strict=True):
            if sent.HasField("inline_program"):
                sent.program = yield from upload(retries, file)
        response = yield from call(retries, "Jobs/CreateJob", request, jobs_pb2.CreateJobResponse)
    return response.job


def upload(retries: Retries, program: Program) -> Flow[str]:
    """Uploads a program, from where a broken upload ended; its name, `programs/{sha256}`."""
    digest = yield Work(program.sha256)
    size = program.size
    name = f"programs/{digest}"

    def attempt() -> Flow[str]:
        known = yield Call("Jobs/GetUpload", jobs_pb2.GetUploadRequest(program=name), jobs_pb2.GetUploadResponse.FromString)
        if known.complete:
            return name
        header = jobs_pb2.UploadHeader(
            sha256=digest, program_bytes=size, offset=known.received_bytes, file_name=program.name
        )
        response = yield Call("Jobs/UploadProgram", _upload_messages(program, header), jobs_pb2.UploadProgramResponse.FromString)
        if not response.program:
            raise SourceError(f"{program.name}: the file changed while it was uploaded")
        return str(response.program)

    return (yield from retried(retries, attempt))


def _upload_messages(program: Program, header: jobs_pb2.UploadHeader) -> Iterator[jobs_pb2.UploadProgramRequest]:
    yield jobs_pb2.UploadProgramRequest(header=header)
    offset = header.offset
    for piece in program.pieces(offset):
        yield jobs_pb2.UploadProgramRequest(chunk=jobs_pb2.UploadChunk(offset=offset, data=piece))
        offset += len(piece)


def get_job(retries: Retries, name: str) -> Flow[jobs_pb2.Job]:
    """Reads a job."""
    request = jobs_pb2.GetJobRequest(name=resource("jobs", name))
    response = yield from call(retries, "Jobs/GetJob", request, jobs_pb2.GetJobResponse)
    return response.job


def list_jobs(retries: Retries, states: list[str], machine: str | None) -> Flow[None]:
    """Emits jobs, newest first."""
    request = jobs_pb2.ListJobsRequest(
        page_size=500,
        states=[value_of(jobs_pb2.JobState, state) for state in states],
        machine=_machine(machine) if machine else "",
    )
    return pages(retries, "Jobs/ListJobs", request, jobs_pb2.ListJobsResponse, lambda page: page.jobs)


def wait(retries: Retries, job: str, timeout_s: float | None) -> Flow[jobs_pb2.Job]:
    """Waits until validation has ended; the job after it."""
    request = jobs_pb2.WatchJobsRequest(after=0, job=resource("jobs", job))
    if timeout_s is not None:
        retries = dataclasses.replace(retries, give_up_after_s=min(retries.give_up_after_s, seconds("timeout_s", timeout_s)))
    deadline_s = None if timeout_s is None else time.monotonic() + timeout_s
    # Also without time to wait, a job that has come to its end has ended.
    seen = yield from get_job(retries, job)
    if seen.state not in _UNDER_WAY:
        return seen

    def watch() -> Flow[bool]:
        left_s = None if deadline_s is None else deadline_s - time.monotonic()
        if left_s is not None and left_s <= 0.0:
            raise late()
        stream: Stream = yield Open("Jobs/WatchJobs", request, jobs_pb2.WatchJobsResponse.FromString, left_s)
        began = False
        with cancelling(stream):
            try:
                while message := (yield Read(stream)):
                    began, request.after = True, message.event.sequence
                    if message.event.state not in _UNDER_WAY:
                        return True
            except DeadlineExceeded:
                raise late() from None
            except ServiceError as error:
                # What brought something counts as a success of its own: the attempts begin anew.
                if not (began and error.is_passing):
                    raise
        return False

    def late() -> DeadlineExceeded:
        return DeadlineExceeded(f"validation of {request.job} has not ended after {timeout_s:g} s", "Jobs/WatchJobs")

    while not (yield from retried(retries, watch)):
        pass
    return (yield from get_job(retries, job))


def report(retries: Retries, job: str) -> Flow[Report]:
    """The report of a job, with its program where that is of a size to be shown."""
    name = resource("jobs", job)
    response = yield from call(retries, "Jobs/GetReport", jobs_pb2.GetReportRequest(job=name), jobs_pb2.GetReportResponse)
    found = response.report
    if not found.findings:
        return Report(found)
    stored = yield from get_job(retries, name)
    program = yield from _stored_program(retries, stored.program, stored.program_bytes, stored.display_name)
    files: list[Program] = []
    wanted = {finding.file for finding in found.findings} - {""}
    for file in stored.settings.programs:
        if file.name in wanted:
            further = yield from _stored_program(retries, file.program, 0, file.name)
            files += [further] if further else []
    return Report(found, program, files)


def _stored_program(retries: Retries, name: str, size: int, shown_name: str) -> Flow[Program | None]:
    if size > SHOWN_BYTES:
        return None
    request = programs_pb2.ReadProgramRequest(name=name, length=SHOWN_BYTES)

    def read() -> Flow[bytes]:
        stream: Stream = yield Open("Programs/ReadProgram", request, programs_pb2.ReadProgramResponse.FromString)
        data = bytearray()
        with cancelling(stream):
            while piece := (yield Read(stream)):
                data += piece.data
        return bytes(data)

    try:
        text = yield from retried(retries, read)
    except NotFound:
        return None
    return Program(text, shown_name)


def stream_setpoints(retries: Retries, job: str, options: StreamOptions) -> Flow[None]:
    """Emits the layout of a stream, then its setpoints in batches, without gaps however often the connection breaks.

    Raises:
        TypeError, SourceError: as `stream_request`, before anything is emitted or sent.
    """
    request, count = stream_request(options)
    request.job = resource("jobs", job)
    return _emit_setpoints(retries, request, _Place(left=count))


def _emit_setpoints(retries: Retries, request: setpoints_pb2.StreamSetpointsRequest, place: _Place) -> Flow[None]:
    while not (yield from retried(retries, lambda: _read_setpoints(request, place))):
        request.start_index = place.next_index
    return None


class _Place:
    """How far a stream has come."""

    def __init__(self, left: int | None) -> None:
        self.left = left
        self.began = False
        self.next_index = 0


def _read_setpoints(request: setpoints_pb2.StreamSetpointsRequest, place: _Place) -> Flow[bool]:
    """One connection; whether the stream came to its end."""
    stream: Stream = yield Open("Setpoints/StreamSetpoints", request, setpoints_pb2.StreamSetpointsResponse.FromString)
    brought = False
    with cancelling(stream):
        try:
            first = yield Read(stream)
            if first is None or first.WhichOneof("message") != "header":
                raise ContractError("a stream of setpoints did not begin with its header")
            decoder = Decoder(first.header)
            if not place.began:
                place.began, place.next_index = True, first.header.first_index
                yield Emit((decoder.layout, first.header.first_index))
            while place.left is None or place.left > 0:
                message = yield Read(stream)
                if message is None:
                    return True
                block = decoder.block(message.chunk)
                if block.first_index != place.next_index:
                    raise ContractError("setpoints are missing between two chunks")
                if place.left is not None:
                    block = block.rows(0, place.left)
                    place.left -= block.count
                place.next_index, brought = block.end_index, True
                yield Emit(block)
        except ServiceError as error:
            if not (brought and error.is_passing):
                raise
            return False
    return True


def stream_request(options: StreamOptions) -> tuple[setpoints_pb2.StreamSetpointsRequest, int | None]:
    """What is asked of a stream, but for the job, and most setpoints.

    Raises:
        TypeError: for an option that does not exist, or a value of another kind.
        SourceError: for a value that cannot be meant.
    """
    given = given_of(StreamOptions.__optional_keys__, options)
    request = setpoints_pb2.StreamSetpointsRequest(
        encoding=value_of(setpoints_pb2.Encoding, given.get("encoding", "RAW_DOUBLE")),
        frame=value_of(setpoints_pb2.Frame, given.get("frame")),
        chunk_size=whole("batch", given.get("batch", 0), MOST_32_BITS),
        interpolation_period_us=whole("interpolation_period_us", given.get("interpolation_period_us", 0), MOST_32_BITS),
        generation_mode=value_of(machines_pb2.GenerationMode, given.get("generation_mode")),
        servo_output=value_of(setpoints_pb2.ServoOutput, given.get("servo_output")),
        columns=column_kinds(given.get("columns", ())),
        overrides=overrides_of(given.get("overrides", ())),
    )
    if "start" in given and "start_time_s" in given:
        raise SourceError("a stream starts either at a setpoint or at a time")
    if "start_time_s" in given:
        request.start_time_s = seconds("start_time_s", given["start_time_s"])
    else:
        request.start_index = whole("start", given.get("start", 0))
    return request, whole("count", given["count"]) if "count" in given else None


def column_kinds(names: Any) -> list[Any]:
    """Kinds of columns by their names."""
    return [value_of(setpoints_pb2.ColumnKind, name) for name in listed("columns", names)]


def joined(batches: list[Any]) -> Setpoints:
    """All that `stream_setpoints` emits as one block."""
    layout, first_index = batches[0]
    return Setpoints.joined(layout, batches[1:], first_index)


def state_name(job: jobs_pb2.Job) -> str:
    """The state of a job, as in `READY`."""
    return value_name(jobs_pb2.JobState, job.state)
