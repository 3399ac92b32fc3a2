"""Programs as they are given: a file, which is read piece by piece, or a text."""

from __future__ import annotations

import hashlib
import io
import os
import pathlib
from collections.abc import Iterator
from typing import BinaryIO, TypeAlias

from .errors import SourceError

PIECE_BYTES = 256 * 1024
"""Bytes of a program that are read and sent at once."""


class Program:
    """A machining program: `Program(text)` or `Program.file(path)`. Lines and columns count from 1, columns in bytes."""

    def __init__(self, text: str | bytes, name: str = "") -> None:
        """A program of this text; `name` is what findings call it and, of a further file, what calls find it by."""
        self.name = name
        self.path: pathlib.Path | None = None
        self._data: bytes | None = text.encode() if isinstance(text, str) else bytes(text)

    @classmethod
    def file(cls, path: str | os.PathLike[str]) -> Program:
        """The program in a file, which is read when it is needed.

        Raises:
            OSError: when there is no such file.
        """
        place = pathlib.Path(path)
        os.stat(place)
        program = cls(b"", place.name)
        program.path, program._data = place, None
        return program

    @classmethod
    def of(cls, source: ProgramSource) -> Program:
        """What is meant by a source: a path is a file, bytes are a text, and so is a `str` of more than one line; any other `str` is the
        path of a file.

        Raises:
            SourceError: for a `str` of one line that is no file.
        """
        if isinstance(source, Program):
            return source
        if isinstance(source, bytes):
            return cls(source)
        if isinstance(source, str):
            if "\n" in source or "\r" in source:
                return cls(source)
            if not os.path.exists(source):
                raise SourceError(f"there is no file {source!r}; a program of one line ends with a line end, or is a Program({source!r})")
        return cls.file(source)

    @property
    def size(self) -> int:
        """Size, bytes."""
        return len(self._data) if self._data is not None else os.stat(self._opened_path()).st_size

    def read(self) -> bytes:
        """The whole program."""
        return self._data if self._data is not None else self._opened_path().read_bytes()

    @property
    def text(self) -> str:
        """The whole program as text; bytes that are no UTF-8 are kept (`surrogateescape`)."""
        return self.read().decode(errors="surrogateescape")

    def pieces(self, offset: int = 0) -> Iterator[bytes]:
        """The bytes from an offset on, in pieces."""
        with self.opened() as data:
            data.seek(offset)
            while piece := data.read(PIECE_BYTES):
                yield piece

    def sha256(self) -> str:
        """SHA-256 of the bytes, in hexadecimal: the identity of a stored program."""
        digest = hashlib.sha256()
        for piece in self.pieces():
            digest.update(piece)
        return digest.hexdigest()

    def lines(self, wanted: set[int]) -> dict[int, bytes]:
        """Lines by their number, without line ends; what the program does not have is left out. A file is read once, line by line."""
        found: dict[int, bytes] = {}
        if wanted:
            last = max(wanted)
            # Bytes as characters, for the sake of line ends: a carriage return alone is one, too.
            with self.opened() as data, io.TextIOWrapper(data, encoding="latin-1", newline=None) as text:
                for number, line in enumerate(text, 1):
                    if number in wanted:
                        found[number] = line.rstrip("\n").encode("latin-1")
                    if number >= last:
                        break
        return found

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the program into a file."""
        with open(path, "wb") as file:
            for piece in self.pieces():
                file.write(piece)

    def _opened_path(self) -> pathlib.Path:
        assert self.path is not None, "a program without text has a path"
        return self.path

    def opened(self) -> BinaryIO:
        """The bytes as a file that is open for reading."""
        return io.BytesIO(self._data) if self._data is not None else open(self._opened_path(), "rb")

    def __repr__(self) -> str:
        return f"<Program {self.name or 'of text'}, {self.size} bytes>"


ProgramSource: TypeAlias = "Program | str | bytes | os.PathLike[str]"
"""A program, its path, or its text."""
