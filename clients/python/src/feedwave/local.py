"""The core of feedwave in this process, without a service: the same reports and the same setpoints, to the last bit.

    import feedwave.local

    plan = feedwave.local.plan("part.nc", machine="lathe")
    print(plan.report)
    setpoints = plan.setpoints()

Programs are read in pieces and setpoints come in batches, so memory is bounded however long a program is; other threads go on
meanwhile. Nothing is stored: jobs, runs and machines by name need a service (`feedwave.connect`).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any, BinaryIO, TypeAlias

from typing_extensions import Unpack

from . import _requests
from ._names import listed, value_of
from ._options import Said, Settings, StreamOptions, files_of, message_of, settings_of
from .errors import Details, SourceError, Violation, of_code
from .improvement import Improvement, check_improved, goals_of
from .program import PIECE_BYTES, Program, ProgramSource
from .report import Report
from .setpoints import Layout, Override, Setpoints, of_raw, overrides_of
from .v1 import improvement_pb2, jobs_pb2, lobes_pb2, machines_pb2, programs_pb2, report_pb2, setpoints_pb2, tools_pb2

try:
    from . import _native
except ImportError as error:
    raise ImportError(
        "feedwave.local needs the package with its native part, which this installation does not have: install a wheel that was "
        f"built with it (clients/python/README.md, \"Build\"), or use a service with feedwave.connect() [{error}]"
    ) from error

Machine: TypeAlias = "str | machines_pb2.MachineProfile | Mapping[str, Any]"
"""The generic `lathe` or `mill`, or a profile (`feedwave.load_profile`)."""

__all__ = ["Machine", "Plan", "improve", "interpret", "plan", "profile", "validate"]


def profile(kind: str) -> machines_pb2.MachineProfile:
    """The profile of the generic `lathe` or `mill`: to be changed, and planned with.

    Raises:
        InvalidArgument: for another kind.
    """
    with _refusals():
        return machines_pb2.MachineProfile.FromString(_native.generic_profile(kind))


def validate(
    program: ProgramSource,
    *,
    machine: Machine,
    tools: Iterable[Said[tools_pb2.Tool]] = (),
    files: Mapping[str, ProgramSource] | Iterable[ProgramSource] = (),
    settings: Settings = Settings(),
    overrides: Iterable[Override | tuple[float, float]] = (),
) -> Report:
    """Validates a program.

    Args:
        program: a path, or a text of more than one line.
        machine: `lathe` or `mill`, the generic ones, or a profile (`feedwave.load_profile`).
        tools: the tools that the program may use, with their data; any without them.
        files: further program files, in which calls look for subprograms; with their names, or as paths.
        settings: how it is planned.
        overrides: changes of the feed override; a pair is a time in s and a ratio (1 = programmed).

    Returns:
        What was found. A program full of errors is a report, too: `report.ok` says whether it can be run.

    Raises:
        InvalidArgument: for a machine, tools or settings that cannot be; `violations` names the fields.
        OSError: where a file cannot be read.
    """
    return _Job(program, machine, tools, files, settings).validate(overrides)


def plan(
    program: ProgramSource,
    *,
    machine: Machine,
    tools: Iterable[Said[tools_pb2.Tool]] = (),
    files: Mapping[str, ProgramSource] | Iterable[ProgramSource] = (),
    settings: Settings = Settings(),
) -> Plan:
    """Plans a program: validates it, and has its setpoints where it is valid. Arguments and errors as in `validate`."""
    job = _Job(program, machine, tools, files, settings)
    return Plan(job, job.validate(()))


def interpret(
    program: ProgramSource,
    *,
    machine: Machine,
    tools: Iterable[Said[tools_pb2.Tool]] = (),
    files: Mapping[str, ProgramSource] | Iterable[ProgramSource] = (),
    settings: Settings = Settings(),
) -> Iterator[programs_pb2.InterpretResponse]:
    """What a program does, action by action, before anything is planned: messages with actions in their order, the last one
    (`complete`) with the findings. Arguments and errors as in `validate`; of the settings only offsets matter."""
    return _Job(program, machine, tools, files, settings).interpret()


def improve(
    program: ProgramSource,
    *,
    machine: Machine,
    tools: Iterable[Said[tools_pb2.Tool]] = (),
    files: Mapping[str, ProgramSource] | Iterable[ProgramSource] = (),
    settings: Settings = Settings(),
    goals: Said[improvement_pb2.ImprovementGoals] = {},
    lobes: Said[lobes_pb2.StabilityLobes] | None = None,
    depth_mm: float | None = None,
    depth_tolerance: float | None = None,
) -> Improvement:
    """Improves a program: words that make chips break, feeds and tolerances that save time, each with its reason and gain.

    Args:
        program: at most 64 MiB; it is held in memory.
        machine, tools, files: as in `validate`.
        settings: of these offsets matter.
        goals: what is wanted (`feedwave.v1.improvement_pb2.ImprovementGoals`, or a mapping with its fields), such as
            `{"margin": 1.2, "max_feed_per_rev_mm": 0.25}`; defaults without it.
        lobes, depth_mm, depth_tolerance: as in `Client.improve`.

    Returns:
        What came of it: the program, its changes, and reports before and after.

    Raises:
        SourceError: for a program that is larger. Others as in `validate`.
    """
    said = goals_of(goals, lobes, depth_mm, depth_tolerance)
    return _Job(program, machine, tools, files, Settings(offsets=settings_of(settings).offsets)).improve(said)


class Plan:
    """A program that was validated, and its setpoints. Made by `feedwave.local.plan`."""

    def __init__(self, job: _Job, report: Report) -> None:
        """A plan of this report; use `feedwave.local.plan`."""
        self._job = job
        self.report = report
        """What validation found."""

    @property
    def ok(self) -> bool:
        """Whether there are setpoints."""
        return self.report.ok

    def setpoints(self, **options: Unpack[StreamOptions]) -> Setpoints:
        """The setpoints as columns of NumPy, such as `X_mm`, `feed_mm_per_min` and `time_s`, which are read-only.

        Args:
            options: which setpoints, columns, overrides: `feedwave.StreamOptions`. Values are always exact.

        Raises:
            FailedPrecondition: for a program that is refused, or refused with these overrides.
            OutOfRange: for a start behind the end.
        """
        return _requests.joined(list(self._job.setpoints(self.report, options)))

    def batches(self, **options: Unpack[StreamOptions]) -> Iterator[Setpoints]:
        """The same in batches, in bounded memory however long the program is. A start in the middle is computed up to from the program's
        start."""
        return (item for item in self._job.setpoints(self.report, options) if isinstance(item, Setpoints))


class _Job:
    """A program with all that it is run with."""

    def __init__(
        self,
        program: ProgramSource,
        machine: Machine,
        tools: Iterable[Said[tools_pb2.Tool]],
        files: Mapping[str, ProgramSource] | Iterable[ProgramSource],
        settings: Settings,
    ) -> None:
        self.program, self.files = Program.of(program), files_of(files)
        self.seen: dict[int, tuple[int, ...]] = {}
        settings = settings_of(settings)
        said = jobs_pb2.JobSettings(
            interpolation_period_us=settings.interpolation_period_us,
            generation_mode=value_of(machines_pb2.GenerationMode, settings.generation_mode),
            vibration_envelope=value_of(machines_pb2.VibrationEnvelope, settings.vibration_envelope),
            oscillation=settings.oscillation,
            offsets=settings.offsets,
            tools=[message_of(tools_pb2.Tool, tool) for tool in listed("tools", tools)],
            programs=[jobs_pb2.ProgramFile(name=file.name) for file in self.files],
        )
        said_profile = profile(machine) if isinstance(machine, str) else message_of(machines_pb2.MachineProfile, machine)
        with _refusals():
            self.native = _native.Job(said_profile.SerializeToString(), said.SerializeToString())

    def validate(self, overrides: Iterable[Override | tuple[float, float]]) -> Report:
        request = setpoints_pb2.StreamSetpointsRequest(overrides=overrides_of(overrides))
        with _Reader(self) as reader, _refusals():
            report = self.native.validate(request.SerializeToString(), reader.read)
        return Report(report_pb2.ValidationReport.FromString(report), self.program, self.files)

    def improve(self, goals: improvement_pb2.ImprovementGoals) -> Improvement:
        check_improved(self.program)
        with _Reader(self) as reader, _refusals():
            message, improved = self.native.improve(goals.SerializeToString(), self.program.read(), reader.read)
        found = improvement_pb2.Improvement.FromString(message)
        return Improvement(found, self.program, Program(improved, self.program.name), self.files)

    def setpoints(self, report: Report, options: StreamOptions) -> Iterator[Any]:
        """The layout with the index of the first setpoint, then batches."""
        request, count = stream_request(options)
        if not report.ok:
            message = f"{self.program.name or 'the program'} is refused, and has no setpoints: {report.errors[0]}"
            raise of_code("FAILED_PRECONDITION", message, _METHOD, Details(reason="PROGRAM_REFUSED", domain=_DOMAIN))
        return self.generate(request, report.summary.setpoint_count, count)

    def generate(self, request: setpoints_pb2.StreamSetpointsRequest, setpoint_count: int, left: int | None) -> Iterator[Any]:
        with _Reader(self) as reader, _refusals():
            native = self.native.setpoints(request.SerializeToString(), reader.read, setpoint_count)
            header = setpoints_pb2.StreamHeader.FromString(native.header())
            layout, end = Layout.of(header), header.first_index
            yield layout, end
            if left == 0:
                return
            for first_index, columns, lines in native:
                batch = of_raw(layout, first_index, columns, lines).rows(0, left)
                end = batch.end_index
                yield batch
                if left is not None:
                    left -= batch.count
                    if left == 0:
                        return
            if layout.setpoint_count not in (None, end):
                raise SourceError(f"{self.program.name}: the program changed after it was validated")

    def interpret(self) -> Iterator[programs_pb2.InterpretResponse]:
        with _Reader(self) as reader, _refusals():
            for message in self.native.actions(reader.read):
                yield programs_pb2.InterpretResponse.FromString(message)


class _Reader:
    """The files of a job while they are read: each is opened when it is needed."""

    def __init__(self, job: _Job) -> None:
        self.programs = [job.program, *job.files]
        self.seen = job.seen
        self.opened: dict[int, BinaryIO] = {}
        self.stack = ExitStack()

    def __enter__(self) -> _Reader:
        return self

    def __exit__(self, *_: object) -> None:
        self.stack.close()

    def read(self, place: int, offset: int) -> bytes:
        """Bytes of a file from an offset on; none at its end.

        Raises:
            SourceError: for a file that is another one than when it was read first: its findings would not be those of its setpoints.
        """
        file = self.opened.get(place)
        if file is None:
            program = self.programs[place]
            file = self.opened[place] = self.stack.enter_context(program.opened())
        piece = file.read(PIECE_BYTES) if file.tell() == offset or file.seek(offset) == offset else b""
        self.check(place, file)
        return piece

    def check(self, place: int, file: BinaryIO) -> None:
        if self.programs[place].path is None:
            return
        found = os.fstat(file.fileno())
        state = (found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns)
        if self.seen.setdefault(place, state) != state:
            raise SourceError(f"{self.programs[place].name}: the file changed after it was read first; plan it again")


def stream_request(options: StreamOptions) -> tuple[setpoints_pb2.StreamSetpointsRequest, int | None]:
    """What is asked of a stream, and most setpoints.

    Raises:
        SourceError: for an encoding that rounds: nothing is sent here. Others, and TypeError, as for a stream of a service.
    """
    request, count = _requests.stream_request(options)
    if request.encoding == setpoints_pb2.ENCODING_FIXED_POINT_DELTA:
        raise SourceError("FIXED_POINT_DELTA rounds what is sent, and nothing is sent here: leave the encoding away")
    return request, count


_METHOD, _DOMAIN = "feedwave.local", "feedwave"


@contextmanager
def _refusals() -> Iterator[None]:
    """Refusals of the core as the errors that a service answers."""
    try:
        yield
    except _native.Refused as refusal:
        code, reason, message, violations, not_listed = refusal.args
        details = Details(
            reason=reason,
            domain=_DOMAIN,
            metadata={"violations_not_listed": str(not_listed)} if not_listed else {},
            violations=tuple(Violation(field, description) for field, description in violations),
        )
        raise of_code(code, message, _METHOD, details) from None
