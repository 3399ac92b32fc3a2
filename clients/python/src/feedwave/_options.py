"""Keyword arguments that several methods take, described once."""

from __future__ import annotations

import copy
import difflib
import json
import os
import pathlib
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias, TypedDict, TypeVar

from google.protobuf import json_format
from google.protobuf.message import Message

from ._names import listed, resource, value_name, whole
from .errors import SourceError
from .program import Program, ProgramSource
from .setpoints import Override
from .v1 import jobs_pb2, machines_pb2, oscillation_pb2, recording_pb2

M = TypeVar("M", bound=Message)

# Largest number that a field of 32 bits has, such as a period, µs.
MOST_32_BITS = 2**32 - 1

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Machine: TypeAlias = "str | machines_pb2.MachineProfile | Mapping[str, Any]"
"""A machine of the service, `lathe` or `machines/lathe`, or a profile that is not stored."""


Said: TypeAlias = "M | Mapping[str, Any]"
"""A message, or a mapping with its names and units."""


@dataclass(frozen=True)
class Settings:
    """How a program is planned."""

    interpolation_period_us: int = 0
    """Time from one setpoint to the next, µs, 50 to 20000; 0 means 1000."""
    generation_mode: str | None = None
    """How vibration along the path is generated: `ALONG_PATH`, `TANGENTIAL` or `SERVO_SIDE`; absent: as the machine says."""
    vibration_envelope: str | None = None
    """How it begins and ends: `BLENDED` or `PUBLISHED`; absent: as the machine says."""
    oscillation: oscillation_pb2.OscillationRequest | None = None
    """What is asked of tool oscillations; absent: nothing."""
    offsets: machines_pb2.Offsets | None = None
    """Offsets (mm, degrees) in place of the machine's; absent: as the machine says."""


class StreamOptions(TypedDict, total=False):
    """How setpoints are read."""

    start: int
    """Index of the first setpoint; 0 without it."""
    start_time_s: float
    """Time from the program's start, s, in place of an index: the first setpoint at or after it."""
    count: int
    """Most setpoints; all without it."""
    overrides: Iterable[Override | tuple[float, float]]
    """Changes of the feed override in the order of time; a pair is a time in s and a ratio (1 = programmed)."""
    columns: Iterable[str]
    """Kinds of columns, as in `AXIS_POSITION` or `FEED`; all without it."""
    frame: str
    """Coordinates of the axes: `MACHINE` (without it) or `WORK`."""
    encoding: str
    """`RAW_DOUBLE` (without it) and `PACKED_DOUBLE`: every value to the last bit; `FIXED_POINT_DELTA`: a fraction of the bytes, rounded."""
    interpolation_period_us: int
    """Another period than the job's, µs, 50 to 20000."""
    generation_mode: str
    """Another generation mode than the job's."""
    servo_output: str
    """In servo-side mode: `CONDITIONS` (without it), or `EXPANDED` to what the drive generates."""
    batch: int
    """Most setpoints of a batch, 1 to 131072; the service chooses without it."""


class RunOptions(TypedDict, total=False):
    """How a live run is made."""

    ahead_s: float
    """Time of the setpoints that may come before those before them were taken, s; 0.1 without it. 0: nothing is handed out."""
    frame: str
    """Coordinates of the axes: `MACHINE` (without it) or `WORK`."""
    interpolation_period_us: int
    """Another period than the job's, µs, 50 to 20000."""
    generation_mode: str
    """Another generation mode than the job's."""
    columns: Iterable[str]
    """Kinds of columns, as in `AXIS_POSITION`; all without it."""
    reconnect_for_s: float
    """Time for which it is tried to take the run up again after a break, s; 60 without it."""
    sensor_time_ns: int
    """Time of the sensors' clock now, ns, so that telemetry that waited is known to be stale."""
    recording: Said[recording_pb2.RecordingSettings]
    """Steady cuts of the telemetry are kept to learn from, bounded so: `{}` for the defaults; nothing is without it."""


def given_of(keys: frozenset[str], options: Mapping[str, Any], *besides: str) -> dict[str, Any]:
    """The options that are given: what is None is not.

    Python lets every keyword through that a method takes as one of its options; here unknown ones are refused.

    Args:
        keys: the options that there are, as in `StreamOptions.__optional_keys__`.
        options: the keywords with their values.
        besides: further keywords of the method.

    Raises:
        TypeError: for a keyword that is no option, with the one that is like it.
    """
    for name in options:
        if name not in keys:
            known = sorted([*keys, *besides])
            near = difflib.get_close_matches(name, known, 1)
            meant = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
            raise TypeError(f"unexpected keyword argument {name!r}: {meant}")
    return {name: value for name, value in options.items() if value is not None}


def settings_of(settings: Settings) -> Settings:
    """The settings, which can be meant.

    Raises:
        TypeError: for something else.
        SourceError: for a period that cannot be.
    """
    if not isinstance(settings, Settings):
        raise TypeError(f"settings: feedwave.Settings(…) is wanted, not {type(settings).__name__}")
    whole("settings.interpolation_period_us", settings.interpolation_period_us, MOST_32_BITS)
    return settings


def tools_of(tools: Iterable[str]) -> list[str]:
    """Names of tools."""
    return [resource("tools", tool) for tool in listed("tools", tools)]


def files_of(files: Mapping[str, ProgramSource] | Iterable[ProgramSource]) -> list[Program]:
    """Further program files, each with the name that calls find it by.

    Raises:
        SourceError: for one without a name.
    """
    if isinstance(files, Mapping):
        # Copies: the name is that of this call.
        found = [copy.copy(Program.of(source)) for source in files.values()]
        for name, program in zip(files, found, strict=True):
            program.name = name
    else:
        found = [Program.of(source) for source in listed("files", files)]
    if any(not program.name for program in found):
        raise SourceError("a further program file needs the name that calls find it by: give files as {name: source}")
    return found


def inline_files(files: list[Program]) -> list[jobs_pb2.ProgramFile]:
    """The same as messages."""
    return [jobs_pb2.ProgramFile(name=file.name, inline_program=file.read()) for file in files]


def message_of(kind: type[M], given: M | Mapping[str, Any]) -> M:
    """A message, or what a mapping with the names and units of the contract says: `{"sample_rate_hz": 1000.0, ...}`.

    Raises:
        SourceError: for a mapping that is no such message, with the field.
    """
    if isinstance(given, kind):
        return given
    if not isinstance(given, Mapping):
        raise TypeError(f"{kind.DESCRIPTOR.name}: the message or a mapping with its fields is wanted, not {type(given).__name__}")
    try:
        return json_format.ParseDict(dict(given), kind())
    except json_format.ParseError as error:
        raise SourceError(f"{kind.DESCRIPTOR.name}: {error}") from error


def load_profile(path: str | os.PathLike[str], *, generic: machines_pb2.MachineProfile | None = None) -> machines_pb2.MachineProfile:
    """The machine profile of a TOML or JSON file, with the names and units of the contract.

    Args:
        path: the file: a profile, or a machine as `feedwave machine get` writes it, of which the profile is taken.
        generic: a machine from which what the file leaves out of kind, axes and spindle speed is taken, as the commands do it: that of
            `client.profile("mill")` or `feedwave.local.profile("mill")`. Without it the file has to state them.

    Raises:
        SourceError: for a file that is no profile, or of another kind of machine than `generic`, with the place and the reason.
        OSError: where the file cannot be read.
    """
    place = pathlib.Path(path)
    try:
        data = json.loads(place.read_text()) if place.suffix == ".json" else tomllib.loads(place.read_text())
        if not isinstance(data, Mapping):
            raise ValueError(f"the fields of a MachineProfile are wanted, not {data!r:.80}")
        # What `machine get` writes has the profile in it.
        given: Mapping[str, Any] = data.get("profile", data)
        profile = message_of(machines_pb2.MachineProfile, given)
        if generic is not None:
            _complete(profile.machine, given.get("machine", {}), generic.machine)
    except ValueError as error:
        raise SourceError(f"{place}: {error}") from error
    return profile


def _complete(model: machines_pb2.MachineModel, stated: Mapping[str, Any], generic: machines_pb2.MachineModel) -> None:
    """Fills in what a file leaves out of its machine.

    Raises:
        ValueError: where the file is of another kind of machine.
    """
    if "kind" in stated and model.kind != generic.kind:
        kinds = (value_name(machines_pb2.MachineKind, one.kind) for one in (model, generic))
        raise ValueError("machine.kind is {}, and that of the generic machine {}".format(*kinds))
    model.kind = generic.kind
    if "axes" not in stated:
        model.axes.extend(generic.axes)
    if not {"max_spindle_rev_per_min", "maxSpindleRevPerMin"} & stated.keys():
        model.max_spindle_rev_per_min = generic.max_spindle_rev_per_min
