"""Setpoints as columns of NumPy, named with their units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._extras import extra
from ._names import listed, value_name
from .errors import ContractError, SourceError
from .v1 import feed_override_pb2, setpoints_pb2

if TYPE_CHECKING:
    import pandas
    import polars
    import pyarrow

Floats = npt.NDArray[np.float64]

# Columns that every block has besides those of the stream, as in files of setpoints.
INDEX, TIME, LINE = "index", "time_s", "source_line"


@dataclass(frozen=True)
class Override:
    """A change of the feed override, which is part of the plan."""

    ratio: float
    """Ratio of the feed to the programmed one, 0.01 to 2, or 0: feed hold."""
    time_s: float | None = None
    """Time from the program's start from which it acts, s."""
    setpoint_index: int | None = None
    """Setpoint from which it acts, in place of a time."""

    def message(self) -> feed_override_pb2.FeedOverrideChange:
        """As the contract has it.

        Raises:
            SourceError: unless exactly one of time and setpoint is given.
        """
        if (self.time_s is None) == (self.setpoint_index is None):
            raise SourceError("a change of the override acts either from a time or from a setpoint on")
        if self.time_s is not None:
            return feed_override_pb2.FeedOverrideChange(ratio=self.ratio, time_s=self.time_s)
        return feed_override_pb2.FeedOverrideChange(ratio=self.ratio, setpoint_index=self.setpoint_index)


def overrides_of(changes: Iterable[Override | tuple[float, float]]) -> list[feed_override_pb2.FeedOverrideChange]:
    """Changes of the feed override as messages; a pair is a time in s and a ratio."""
    found = []
    for change in listed("overrides", changes):
        try:
            if not isinstance(change, Override):
                time_s, ratio = change
                change = Override(ratio, time_s=time_s)
            found.append(change.message())
        except SourceError:
            raise
        except (TypeError, ValueError) as error:
            raise SourceError(f"overrides: {change!r} is neither an Override nor a pair of a time in s and a ratio") from error
    return found


@dataclass(frozen=True)
class Layout:
    """What a stream of setpoints is made of."""

    names: tuple[str, ...]
    """Columns in order, each named with its unit, as in `X_mm` or `spindle_angle_deg`."""
    units: Mapping[str, str]
    """Unit of each column, as in `mm/min`."""
    axes: tuple[str, ...]
    """Columns of axis positions."""
    period_us: float
    """Time from one setpoint to the next, µs."""
    setpoint_count: int | None
    """Setpoints from the program's start to its end; absent where the plan was not validated like this."""
    frame: str
    """Coordinates of the axes, `MACHINE` or `WORK`."""

    @classmethod
    def of(cls, header: setpoints_pb2.StreamHeader) -> Layout:
        """From the header of a stream."""
        position = setpoints_pb2.COLUMN_KIND_AXIS_POSITION
        return cls(
            names=tuple(column.name for column in header.columns),
            units={column.name: column.unit for column in header.columns},
            axes=tuple(column.name for column in header.columns if column.kind == position),
            period_us=header.period_us,
            setpoint_count=header.setpoint_count if header.HasField("setpoint_count") else None,
            frame=value_name(setpoints_pb2.Frame, header.frame),
        )


class Setpoints(Mapping[str, npt.NDArray[Any]]):
    """Consecutive setpoints: a mapping from the names of columns to arrays, `index`, `time_s` and `source_line` among them.

    Setpoint `i` belongs to the time `i` times the period, from the program's start.
    """

    def __init__(self, layout: Layout, first_index: int, columns: Mapping[str, Floats], line: npt.NDArray[np.uint32]) -> None:
        """Setpoints from `first_index` on."""
        self.layout = layout
        self.first_index = first_index
        self.line = line
        """Line of the program that each setpoint belongs to, from 1; 0 before the first block."""
        self._columns = dict(columns)

    @property
    def count(self) -> int:
        """Number of setpoints."""
        return len(self.line)

    @property
    def end_index(self) -> int:
        """Index of the setpoint behind the last one."""
        return self.first_index + self.count

    @property
    def index(self) -> npt.NDArray[np.int64]:
        """Index of each setpoint, from the program's start."""
        return np.arange(self.first_index, self.end_index, dtype=np.int64)

    @property
    def time_s(self) -> Floats:
        """Time of each setpoint from the program's start, s."""
        return np.asarray(self.index * self.layout.period_us / 1e6, dtype=np.float64)

    @property
    def units(self) -> dict[str, str]:
        """Unit of every column; empty for a pure number."""
        return {INDEX: "", TIME: "s", **self.layout.units, LINE: ""}

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        if name in self._columns:
            return self._columns[name]
        extra: dict[str, npt.NDArray[Any]] = {LINE: self.line}
        if name == INDEX:
            return self.index
        if name == TIME:
            return self.time_s
        if name in extra:
            return extra[name]
        raise KeyError(f"{name}: there are {', '.join(self)}")

    def __iter__(self) -> Iterator[str]:
        return iter([INDEX, TIME, *self._columns, LINE])

    def __len__(self) -> int:
        return len(self._columns) + 3

    def __eq__(self, other: object) -> bool:
        """Whether all of it is the same, bit for bit."""
        if not isinstance(other, Setpoints):
            return NotImplemented
        same_place = (self.layout, self.first_index, self.count) == (other.layout, other.first_index, other.count)
        return same_place and all(self[name].tobytes() == other[name].tobytes() for name in self)

    def __repr__(self) -> str:
        return f"<Setpoints {self.first_index} to {self.end_index - 1}: {', '.join(self)}>" if self.count else "<no setpoints>"

    def rows(self, start: int = 0, end: int | None = None) -> Setpoints:
        """A part of the setpoints, by their places in this block; it shares its memory."""
        start, end, _ = slice(start, end).indices(self.count)
        columns = {name: values[start:end] for name, values in self._columns.items()}
        return Setpoints(self.layout, self.first_index + start, columns, self.line[start:end])

    @classmethod
    def joined(cls, layout: Layout, blocks: list[Setpoints], first_index: int = 0) -> Setpoints:
        """Blocks that follow each other as one."""
        if not blocks:
            empty = {name: np.empty(0) for name in layout.names}
            return cls(layout, first_index, empty, np.empty(0, np.uint32))
        columns = {name: np.concatenate([block[name] for block in blocks]) for name in layout.names}
        return cls(layout, blocks[0].first_index, columns, np.concatenate([block.line for block in blocks]))

    def to_pandas(self) -> pandas.DataFrame:
        """As a pandas data frame, with the index of the setpoints as its index.

        Raises:
            ImportError: without pandas (`pip install feedwave[pandas]`).
        """
        frame: pandas.DataFrame = extra("pandas", "pandas", "data frames of pandas").DataFrame(dict(self)).set_index(INDEX)
        frame.attrs["units"] = self.units
        return frame

    def to_polars(self) -> polars.DataFrame:
        """As a polars data frame.

        Raises:
            ImportError: without polars (`pip install feedwave[polars]`).
        """
        frame: polars.DataFrame = extra("polars", "polars", "data frames of polars").DataFrame(dict(self))
        return frame

    def to_arrow(self) -> pyarrow.Table:
        """As an Arrow table, with the unit of each column in the metadata of its field and, as in Parquet files, of the schema.

        Raises:
            ImportError: without pyarrow (`pip install feedwave[arrow]`).
        """
        arrow: Any = extra("pyarrow", "arrow", "Arrow tables")
        units = self.units
        fields = [arrow.field(name, arrow.from_numpy_dtype(self[name].dtype), metadata={"unit": units[name]}) for name in self]
        schema = arrow.schema(fields, metadata={f"unit:{name}": unit for name, unit in units.items() if unit})
        table: pyarrow.Table = arrow.table([arrow.array(self[name]) for name in self], schema=schema)
        return table


# Raw columns, whatever the order of bytes of this machine is.
_DOUBLE, _LINE = np.dtype("<f8"), np.dtype("<u4")


def of_raw(layout: Layout, first_index: int, columns: list[bytes], lines: bytes) -> Setpoints:
    """Setpoints of columns of little-endian doubles and of line numbers of 32 bits. The arrays are those bytes, not copies."""
    arrays = {name: np.frombuffer(column, dtype=_DOUBLE) for name, column in zip(layout.names, columns)}
    return Setpoints(layout, first_index, arrays, np.frombuffer(lines, dtype=_LINE))


class Decoder:
    """Turns the chunks of a stream into setpoints."""

    def __init__(self, header: setpoints_pb2.StreamHeader) -> None:
        """A decoder of the stream with this header."""
        self.layout = Layout.of(header)
        self._encoding = header.encoding
        # 1e-6 is not a double but its reciprocal is: dividing by it gives the double nearest to the decimal value.
        self._steps_per_unit = [round(1.0 / column.resolution) if column.resolution else 1 for column in header.columns]

    def block(self, chunk: setpoints_pb2.SetpointChunk) -> Setpoints:
        """The setpoints of a chunk.

        Raises:
            ContractError: for a chunk that is not made as the header says.
        """
        names = self.layout.names
        if len(chunk.columns) != len(names):
            raise ContractError(f"a chunk has {len(chunk.columns)} columns instead of {len(names)}")
        columns = {}
        for place, (name, column) in enumerate(zip(names, chunk.columns)):
            if self._encoding == setpoints_pb2.ENCODING_RAW_DOUBLE:
                if len(column.raw) != _DOUBLE.itemsize * chunk.count:
                    raise ContractError(f"column {name} has {len(column.raw)} bytes instead of {_DOUBLE.itemsize} for each setpoint")
                # The array is the message's bytes, not a copy, and so it is read-only.
                values = np.frombuffer(column.raw, dtype=_DOUBLE)
            elif self._encoding == setpoints_pb2.ENCODING_FIXED_POINT_DELTA:
                values = _restored(np.array(column.deltas, dtype=np.int64), self._steps_per_unit[place])
            else:
                values = np.array(column.values, dtype=np.float64)
            if len(values) != chunk.count:
                raise ContractError(f"column {name} has {len(values)} values instead of {chunk.count}")
            columns[name] = values
        runs = chunk.line_runs
        line = np.repeat(
            np.array([run.line for run in runs], dtype=np.uint32), np.array([run.count for run in runs], dtype=np.int64)
        )
        if len(line) != chunk.count:
            raise ContractError(f"a chunk states the lines of {len(line)} setpoints instead of {chunk.count}")
        return Setpoints(self.layout, chunk.first_index, columns, line)


def _restored(deltas: npt.NDArray[np.int64], steps_per_unit: int) -> Floats:
    """Values of fixed-point deltas, which are modulo 2^64; the extreme numbers of steps are the infinities."""
    steps = np.cumsum(deltas, dtype=np.int64)
    values: Floats = steps / float(steps_per_unit)
    values[steps == np.iinfo(np.int64).min] = -np.inf
    values[steps == np.iinfo(np.int64).max] = np.inf
    return values
