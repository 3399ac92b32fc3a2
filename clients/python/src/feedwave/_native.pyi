"""The core of feedwave as an extension; `feedwave.local` is what programs use."""

from collections.abc import Callable
from typing import final

__all__ = ["Actions", "Job", "Refused", "Setpoints", "generic_profile"]

class Refused(Exception):
    """A refusal: status code, reason, message, violations as pairs of field and description, how many more there are."""

    args: tuple[str, str, str, list[tuple[str, str]], int]

@final
class Job:
    """A machine and the settings with which programs are run on it."""

    def __new__(cls, profile: bytes, settings: bytes) -> Job: ...
    def validate(self, request: bytes, read: Callable[[int, int], bytes]) -> bytes: ...
    def improve(self, goals: bytes, program: bytes, read: Callable[[int, int], bytes]) -> tuple[bytes, bytes]: ...
    def setpoints(self, request: bytes, read: Callable[[int, int], bytes], setpoint_count: int) -> Setpoints: ...
    def actions(self, read: Callable[[int, int], bytes]) -> Actions: ...

@final
class Setpoints:
    """An iterator over batches of setpoints: index of the first one, little-endian doubles of each column, and
    little-endian numbers of 32 bits of the lines."""

    def header(self) -> bytes: ...
    def __iter__(self) -> Setpoints: ...
    def __next__(self) -> tuple[int, list[bytes], bytes]: ...

@final
class Actions:
    """An iterator over `InterpretResponse` as bytes: actions, in the last one the findings."""

    def __iter__(self) -> Actions: ...
    def __next__(self) -> bytes: ...

def generic_profile(kind: str) -> bytes:
    """The generic machine of a kind, `lathe` or `mill`: a `MachineProfile` as bytes."""
