"""What came of improving a program: changes with their reasons and gains, reports before and after, and the program."""

from __future__ import annotations

import difflib
from collections.abc import Iterator

from ._flow import Flow, Open, Read, Retries, Stream, cancelling, retried
from ._names import resource
from ._options import Machine, Said, Settings, inline_files, message_of, settings_of
from ._requests import advised, check_size
from .errors import ContractError, SourceError
from .program import Program
from .report import Report
from .v1 import improvement_pb2, lobes_pb2, machines_pb2

# Largest program that is improved, bytes, by whatever is asked.
MAX_IMPROVED_BYTES = 64 << 20
# What takes programs that are too large for a request to this service.
_COMMAND = "the command `feedwave improve` needs no service"


class Improvement:
    """What came of improving a program. Made by `Client.improve` and `feedwave.local.improve`."""

    def __init__(self, message: improvement_pb2.Improvement, before: Program, program: Program, files: list[Program]) -> None:
        """An improvement of this message; use `Client.improve`."""
        self.message = message
        """The message of the contract: `steps` with reasons and figures, `changes` word by word, `goals`."""
        self.program = program
        """The program that came out; the given one where nothing changed."""
        self.before = Report(message.before, before, files)
        """The report about the program as it was."""
        self.after = Report(message.after, program, files)
        """The report about the program that came out."""
        self._given = before

    @property
    def holds(self) -> bool:
        """Whether everything that is wanted holds."""
        return self.message.holds

    @property
    def stability_judged(self) -> bool:
        """Whether lobes were given, by which stability is judged."""
        return self.message.goals.HasField("stability")

    @property
    def steps(self) -> list[improvement_pb2.ImprovementStep]:
        """What was done and what was not, with `line`, `subject`, `reason`, `changes` and `figures`."""
        return list(self.message.steps)

    @property
    def changes(self) -> list[improvement_pb2.WordChange]:
        """Each word that changed: `line` and `column` from 1, `old` and `new`."""
        return list(self.message.changes)

    def diff(self) -> str:
        """What changed, as a unified diff; empty where nothing did."""
        name = self._given.name or "program"
        given, improved = (program.text.splitlines(keepends=True) for program in (self._given, self.program))
        return "".join(difflib.unified_diff(given, improved, name, name))

    def _lines(self) -> Iterator[str]:
        for step in self.message.steps:
            if step.outcome != improvement_pb2.IMPROVEMENT_OUTCOME_CHANGED:
                missed = step.outcome == improvement_pb2.IMPROVEMENT_OUTCOME_NOT_POSSIBLE
                yield f"line {step.line}: {step.subject} {'does not hold and stays' if missed else 'stays'}: {step.reason}"
                continue
            words = ", ".join(f"{change.old} becomes {change.new}" for change in step.changes)
            gains = (f"{figure.name} {figure.before:.4g} to {figure.after:.4g} {figure.unit}".rstrip() for figure in step.figures)
            yield f"line {step.line}: {words} ({step.reason}): {', '.join(gains)}"
        vibrations = (improvement_pb2.IMPROVEMENT_KIND_VIBRATION, improvement_pb2.IMPROVEMENT_KIND_SPINDLE_SPEED)
        if not self.stability_judged and any(step.kind in vibrations for step in self.message.steps):
            yield "stability is not judged: no lobes are given"

    def __str__(self) -> str:
        return "\n".join(self._lines()) or "nothing is changed"

    def __repr__(self) -> str:
        return f"<Improvement, {len(self.message.changes)} words changed, {'holds' if self.holds else 'does not hold'}>"


def check_improved(program: Program) -> None:
    """Refuses a program that is too large to be improved, before it is read.

    Raises:
        SourceError: for it.
    """
    if program.size > MAX_IMPROVED_BYTES:
        raise SourceError(f"{program.name or 'the program'}: {program.size} bytes, and at most {MAX_IMPROVED_BYTES} are improved")


def goals_of(
    goals: Said[improvement_pb2.ImprovementGoals],
    lobes: Said[lobes_pb2.StabilityLobes] | None,
    depth_mm: float | None,
    depth_tolerance: float | None,
) -> improvement_pb2.ImprovementGoals:
    """The goals with the depth that has to be stable.

    Raises:
        TypeError: for lobes without a depth, or a depth without lobes.
    """
    wanted = improvement_pb2.ImprovementGoals()
    wanted.CopyFrom(message_of(improvement_pb2.ImprovementGoals, goals))
    if (lobes is None) != (depth_mm is None) or (lobes is None and depth_tolerance is not None):
        raise TypeError("lobes and depth_mm go together, and depth_tolerance with both")
    if lobes is not None and depth_mm is not None:
        chart = message_of(lobes_pb2.StabilityLobes, lobes)
        stability = improvement_pb2.StabilityGoal(lobes=chart, depth_mm=depth_mm, depth_tolerance=depth_tolerance)
        wanted.stability.CopyFrom(stability)
    return wanted


def improve(
    retries: Retries,
    program: Program,
    machine: Machine,
    tools: list[str],
    files: list[Program],
    settings: Settings,
    goals: improvement_pb2.ImprovementGoals,
) -> Flow[Improvement]:
    """Improves a program without storing anything."""
    check_improved(program)
    check_size([program, *files], _COMMAND)
    request = improvement_pb2.ImproveRequest(
        inline_program=program.read(),
        tools=tools,
        programs=inline_files(files),
        offsets=settings_of(settings).offsets,
        goals=goals,
    )
    if isinstance(machine, str):
        request.machine = resource("machines", machine)
    else:
        request.profile.CopyFrom(message_of(machines_pb2.MachineProfile, machine))

    def attempt() -> Flow[Improvement]:
        stream: Stream = yield Open("Programs/Improve", request, improvement_pb2.ImproveResponse.FromString)
        message, pieces = None, []
        with cancelling(stream):
            while (response := (yield Read(stream))) is not None:
                if response.HasField("improvement"):
                    message = response.improvement
                pieces.append(response.data)
        improved = b"".join(pieces)
        if message is None or len(improved) != message.program_bytes:
            raise ContractError(f"an improvement of {len(improved)} bytes came in parts")
        return Improvement(message, program, Program(improved, program.name), files)

    return (yield from advised(retried(retries, attempt), _COMMAND))
