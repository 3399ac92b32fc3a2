"""Names: of resources, and of the values of enumerations without the prefix that the contract gives them."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Iterable
from typing import Any, TypeVar

from .errors import SourceError


def resource(collection: str, name: str) -> str:
    """`jobs/x` of `x` or of `jobs/x`."""
    if not name:
        raise SourceError(f"a name of {collection} is missing")
    return name if "/" in name else f"{collection}/{name}"


def _prefix(enumeration: Any) -> str:
    words: list[str] = re.findall(r"[A-Z][a-z0-9]*", enumeration.DESCRIPTOR.name)
    return "_".join(word.upper() for word in words) + "_"


def value_name(enumeration: Any, value: int) -> str:
    """The name of a value without its prefix, as in `READY`; the number of one that this version does not know."""
    known = enumeration.DESCRIPTOR.values_by_number.get(value)
    return known.name.removeprefix(_prefix(enumeration)) if known else str(value)


def value_of(enumeration: Any, name: str | None) -> Any:
    """The value of a name with or without its prefix, in whatever case; 0 (unspecified) of none.

    Raises:
        SourceError: for a name that the enumeration does not have.
    """
    if name is None:
        return 0
    if not isinstance(name, str):
        raise TypeError(f"the name of a {enumeration.DESCRIPTOR.name} is wanted, a str, not {name!r}")
    prefix = _prefix(enumeration)
    wanted = prefix + name.upper().removeprefix(prefix)
    known = enumeration.DESCRIPTOR.values_by_name.get(wanted)
    if known is None:
        names = [one.name.removeprefix(prefix) for one in enumeration.DESCRIPTOR.values if one.number != 0]
        raise SourceError(f"{name!r} is none of {', '.join(names)}")
    return known.number


T = TypeVar("T")


def listed(argument: str, values: Iterable[T]) -> list[T]:
    """The values of an argument that takes several.

    Raises:
        TypeError: for one value in place of several; a text would be taken letter by letter.
    """
    if isinstance(values, (str, bytes)) or not isinstance(values, Iterable):
        raise TypeError(f"{argument}: several are wanted, as in a list, not {values!r}")
    return list(values)


def whole(argument: str, value: int, most: int = 2**63 - 1) -> int:
    """The value of an argument that counts.

    Raises:
        SourceError: for one below 0 or above `most`.
        TypeError: for one that is no whole number.
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{argument}: a whole number is wanted, not {value!r}") from None
    if not 0 <= number <= most:
        raise SourceError(f"{argument} is {number}, and must be from 0 to {most}")
    return number


def seconds(argument: str, value: float) -> float:
    """The value of an argument that is a time, s.

    Raises:
        SourceError: for one that is negative or not finite.
        TypeError: for one that is no number.
    """
    try:
        number = float(value) if not isinstance(value, str) else None
    except (TypeError, ValueError):
        number = None
    if number is None:
        raise TypeError(f"{argument}: a number is wanted, not {value!r}")
    if not (math.isfinite(number) and number >= 0.0):
        raise SourceError(f"{argument} is {number}, and must be a finite number, not negative")
    return number
