"""What validation found: findings that print like a compiler's, and the figures of the plan."""

from __future__ import annotations

import enum
import html
from collections.abc import Sequence
from dataclasses import dataclass

from .errors import SourceError
from .program import Program
from .v1 import report_pb2


class Severity(enum.IntEnum):
    """How bad a finding is."""

    INFO = report_pb2.SEVERITY_INFO
    """Worth knowing."""
    WARNING = report_pb2.SEVERITY_WARNING
    """Runs, but probably not as intended."""
    ERROR = report_pb2.SEVERITY_ERROR
    """Refused: the program is rejected before anything moves."""


@dataclass(frozen=True)
class Value:
    """A number with its name and unit."""

    name: str
    value: float
    """The number, in `unit`."""
    unit: str
    """As in `mm`, `Hz` or `mm/min`; empty for a pure number."""

    def __str__(self) -> str:
        return f"{self.name} {self.value:g} {self.unit}".rstrip()


@dataclass(frozen=True)
class Cure:
    """What would cure a finding."""

    message: str
    """What to do."""
    replacement: str | None
    """Text to put in place of the finding's span, where that cures it."""
    value: Value | None
    """The suggested quantity, where there is one."""

    def __str__(self) -> str:
        # What is removed, and what the message says already, is not said again.
        if not self.replacement or self.message == f"write {self.replacement}":
            return self.message
        return f"{self.message}: write `{self.replacement}`"


@dataclass(frozen=True)
class Place:
    """A place in a program."""

    file: str
    """Name of the further program file that it is in; empty for the program itself."""
    line: int
    """Line, from 1."""
    column: int
    """Column in the line, bytes from 1."""
    length: int
    """Length, bytes; 0 is a point between bytes."""


@dataclass(frozen=True)
class Related:
    """Another place that has to do with a finding."""

    message: str
    """What is there."""
    place: Place


@dataclass(frozen=True)
class Finding:
    """One thing found in a program."""

    code: str
    """Stable code, as in `VIB-CHIP-UNBROKEN`; `docs/findings.md` explains all of them."""
    severity: Severity
    place: Place
    message: str
    """What is wrong, in one sentence with the numbers."""
    values: tuple[Value, ...]
    """The numbers."""
    cures: tuple[Cure, ...]
    """Cures, best first."""
    occurrences: int
    """How often it was met; message, numbers and cures are those of the worst occurrence."""
    related: tuple[Related, ...]
    proto: report_pb2.Finding
    """The finding as the contract has it."""

    @property
    def line(self) -> int:
        """Line, from 1."""
        return self.place.line

    def value(self, name: str) -> float:
        """The number of this name, in its unit.

        Raises:
            KeyError: when the finding has none of this name.
        """
        for value in self.values:
            if value.name == name:
                return value.value
        raise KeyError(name)

    @classmethod
    def of(cls, proto: report_pb2.Finding) -> Finding:
        """From the contract's message."""
        return cls(
            code=proto.code,
            # What has no severity counts as the worst.
            severity=Severity(proto.severity) if proto.severity in {int(one) for one in Severity} else Severity.ERROR,
            place=Place(proto.file, proto.line, proto.column, proto.length),
            message=proto.message,
            values=tuple(_value(value) for value in proto.values),
            cures=tuple(
                Cure(
                    cure.message,
                    cure.replacement if cure.HasField("replacement") else None,
                    _value(cure.value) if cure.HasField("value") else None,
                )
                for cure in proto.suggestions
            ),
            occurrences=max(proto.occurrences, 1),
            related=tuple(
                Related(place.message, Place(place.file, place.line, place.column, place.length)) for place in proto.related
            ),
            proto=proto,
        )

    def __str__(self) -> str:
        return f"{self.severity.name.lower()}[{self.code}] line {self.line}: {self.message}"


def _value(proto: report_pb2.NamedValue) -> Value:
    return Value(proto.name, proto.value, proto.unit)


class Report:
    """The result of validating a program: prints its findings under their source lines, in a notebook in colour."""

    def __init__(
        self, proto: report_pb2.ValidationReport, program: Program | None = None, files: Sequence[Program] = ()
    ) -> None:
        """A report on `program` with its further `files`, where they are at hand: without them no source lines are shown."""
        self.proto = proto
        self.program = program
        self.files = {file.name: file for file in files}
        self.findings = tuple(Finding.of(finding) for finding in proto.findings)

    @property
    def ok(self) -> bool:
        """Whether the program can be run: no error was found."""
        return self.proto.summary.errors == 0

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The errors."""
        return self.of_severity(Severity.ERROR)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The warnings."""
        return self.of_severity(Severity.WARNING)

    def of_severity(self, severity: Severity) -> tuple[Finding, ...]:
        """The findings of a severity."""
        return tuple(finding for finding in self.findings if finding.severity is severity)

    @property
    def summary(self) -> report_pb2.ProgramSummary:
        """Counts, times (s), lengths (mm), extents and peaks of the whole program."""
        return self.proto.summary

    @property
    def sections(self) -> Sequence[report_pb2.SectionReport]:
        """One report for each section with vibration along the path."""
        return self.proto.sections

    @property
    def duration_s(self) -> float:
        """Machining time, s."""
        return self.proto.summary.duration_s

    def fixed(self, *codes: str) -> Program:
        """The program with the best replacement of every finding in place, of these codes or of all; without any it is the same text.

        Only findings of the program itself are considered, and of those whose places overlap the first. A cure of one finding can bring
        another to light: validate again.

        Raises:
            SourceError: when the program is not at hand.
        """
        if self.program is None:
            raise SourceError("the program of this report is not at hand: validate its text")
        lines = self.program.read().splitlines(keepends=True)
        taken: set[tuple[int, int]] = set()
        changes: list[tuple[Place, bytes]] = []
        for finding in self.findings:
            replacement = next((cure.replacement for cure in finding.cures if cure.replacement is not None), None)
            place = finding.place
            if replacement is None or place.file or (codes and finding.code not in codes) or place.line > len(lines):
                continue
            # A point takes the byte behind it, so that nothing is put there twice.
            span = {(place.line, place.column + byte) for byte in range(max(place.length, 1))}
            if not span & taken:
                taken |= span
                changes.append((place, replacement.encode()))
        for place, replacement_bytes in sorted(changes, key=lambda change: (change[0].line, change[0].column), reverse=True):
            line, start = lines[place.line - 1], place.column - 1
            lines[place.line - 1] = line[:start] + replacement_bytes + line[start + place.length :]
        return Program(b"".join(lines), self.program.name)

    def __str__(self) -> str:
        blocks = [f"{''.join(text for _, text in block)}\n" for block in self._blocks()]
        return "\n".join([*blocks, self._verdict()])

    def print(self) -> None:
        """Prints the findings."""
        print(self)

    def __repr__(self) -> str:
        return f"<Report {self._verdict()}>"

    def _repr_html_(self) -> str:
        blocks = ["".join(_span(style, text) for style, text in block) for block in self._blocks()]
        verdict = html.escape(self._verdict())
        return f'<pre style="line-height:1.35">{"<br><br>".join([*blocks, verdict])}</pre>'

    def _verdict(self) -> str:
        summary = self.proto.summary
        counts = [(summary.errors, "error"), (summary.warnings, "warning"), (summary.infos, "note")]
        told = ", ".join(f"{count} {what}{'' if count == 1 else 's'}" for count, what in counts if count)
        name = self.program.name if self.program and self.program.name else "program"
        if not self.ok:
            return f"{name}: rejected: {told}"
        moves = f"{summary.setpoint_count} setpoints, {summary.duration_s:.3f} s"
        not_listed = f"; {summary.findings_not_listed} more findings" if summary.findings_not_listed else ""
        return f"{name}: accepted: {told or 'nothing found'}{not_listed}; {moves}"

    def _blocks(self) -> list[list[tuple[str, str]]]:
        """A block of styled pieces of text for each finding."""
        wanted: dict[str, set[int]] = {}
        for finding in self.findings:
            for place in (finding.place, *(related.place for related in finding.related)):
                wanted.setdefault(place.file, set()).add(place.line)
        sources = {file: self._source(file) for file in wanted}
        lines = {file: source.lines(wanted[file]) for file, source in sources.items() if source is not None}
        return [self._block(finding, lines) for finding in self.findings]

    def _source(self, file: str) -> Program | None:
        if not file:
            return self.program
        # The same name in whatever case is the same file.
        return next((one for name, one in self.files.items() if name.lower() == file.lower()), None)

    def _block(self, finding: Finding, lines: dict[str, dict[int, bytes]]) -> list[tuple[str, str]]:
        style = finding.severity.name
        block = [(style, f"{finding.severity.name.lower()}[{finding.code}]"), ("BOLD", f": {finding.message}{_times(finding)}\n")]
        block += self._snippet(finding.place, style, "", lines)
        for cure in finding.cures:
            block.append(("GUTTER", "  = "))
            block.append(("CURE", "cure: "))
            block.append(("", f"{cure}\n"))
        for related in finding.related:
            block.append(("NOTE", f"note: {related.message}\n"))
            block += self._snippet(related.place, "NOTE", "", lines)
        last_style, last = block[-1]
        block[-1] = (last_style, last.removesuffix("\n"))
        return block

    def _snippet(self, place: Place, style: str, label: str, lines: dict[str, dict[int, bytes]]) -> list[tuple[str, str]]:
        number = str(place.line)
        margin = " " * len(number)
        name = place.file or (self.program.name if self.program else "") or "program"
        pieces = [("GUTTER", f"{margin}--> "), ("", f"{name}:{place.line}:{place.column}\n")]
        line = lines.get(place.file, {}).get(place.line)
        if line is None:
            return pieces
        before, marked = _columns(line, place)
        pieces += [("GUTTER", f"{margin} |\n{number} | "), ("", f"{_shown(line)}\n"), ("GUTTER", f"{margin} | ")]
        pieces += [(style, f"{' ' * before}{'^' * marked}{label}\n")]
        return pieces


def _times(finding: Finding) -> str:
    if finding.occurrences < 2:
        return ""
    told = [f"{finding.occurrences} times"]
    for what, field in (("first", "first"), ("worst", "worst")):
        if finding.proto.HasField(field):
            occurrence = getattr(finding.proto, field)
            told.append(f"{what} in {occurrence.name} {occurrence.number}")
    return f" ({', '.join(told)})"


def _shown(data: bytes) -> str:
    """A line as it is shown: tabulators as four spaces, what cannot be printed as a dot."""
    text = data.decode(errors="replace").replace("\t", "    ")
    return "".join(mark if mark.isprintable() else "." for mark in text)


def _columns(line: bytes, place: Place) -> tuple[int, int]:
    """Columns before the span of a place, and columns under it, as shown: at least one."""
    start = min(max(place.column - 1, 0), len(line))
    return len(_shown(line[:start])), max(len(_shown(line[start : start + place.length])), 1)


_COLOURS = {
    "ERROR": "#b3003c;font-weight:bold",
    "WARNING": "#b35900;font-weight:bold",
    "INFO": "#0064aa;font-weight:bold",
    "NOTE": "#0064aa",
    "CURE": "#00785a;font-weight:bold",
    "GUTTER": "#4b5563",
    "BOLD": "inherit;font-weight:bold",
}


def _span(style: str, text: str) -> str:
    escaped = html.escape(text)
    return f'<span style="color:{_COLOURS[style]}">{escaped}</span>' if style else escaped
