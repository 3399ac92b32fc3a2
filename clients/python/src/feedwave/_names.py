"""Names: of resources, and of the values of enumerations without the prefix that the contract gives them."""

from __future__ import annotations

import re
from typing import Any

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
    prefix = _prefix(enumeration)
    wanted = prefix + name.upper().removeprefix(prefix)
    known = enumeration.DESCRIPTOR.values_by_name.get(wanted)
    if known is None:
        names = [one.name.removeprefix(prefix) for one in enumeration.DESCRIPTOR.values if one.number != 0]
        raise SourceError(f"{name!r} is none of {', '.join(names)}")
    return known.number
