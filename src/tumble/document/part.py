"""What every part of a document is: a record that JSON is made of and read into.

Vectors and matrices of three are tuples of numbers in it. What a file has beside its keys is passed over.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, dataclass_transform, get_args

import msgspec
import numpy as np
from msgspec import structs
from numpy.typing import ArrayLike

from tumble.files import shown


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(msgspec.field,))
class _Frozen(msgspec.StructMeta):
    """Records that do not change, made by the names of their fields."""

    def __new__(mcs, name: str, bases: tuple[type, ...], own: dict[str, Any], **said: Any) -> Any:
        settings: dict[str, Any] = {"frozen": True, "kw_only": True, **said}
        return super().__new__(mcs, name, bases, own, **settings)


class DocumentPart(msgspec.Struct, metaclass=_Frozen):
    """A part of a document; its kinds of values are checked where it is read and where it is written."""


Part = TypeVar("Part", bound=DocumentPart)


# How a document writes out what records call their numbers.
_SPELLED = {
    "sigma": "standard_uncertainty",
    "sigmas": "standard_uncertainties",
    "degrees": "degrees_of_freedom",
}


def spelled(**names: str) -> Callable[[str], str]:
    """Return what a part that mirrors a record calls its fields in JSON, some by other names than the usual."""

    def spell(field: str) -> str:
        begin, mark, end = field.rpartition("_")
        return names.get(field, f"{begin}{mark}{_SPELLED.get(end, end)}")

    return spell


def part_of(kind: type[Part], record: object, **others: Any) -> Part:
    """Return the part of a record: what is not given beside it are the record's own fields, if it has them.

    Arrays become lists, records in lists their parts; a number that is not finite becomes null.
    """
    same = [one for one in structs.fields(kind) if one.name not in others and hasattr(record, one.name)]
    return kind(**{one.name: _told(getattr(record, one.name), one.type) for one in same}, **others)


def _told(value: Any, kind: Any) -> Any:
    if isinstance(value, np.ndarray):
        return [finite(number) for number in value.tolist()]
    if isinstance(value, float):
        return finite(value)
    inner: Any = next(iter(get_args(kind)), None)
    mirrors = value and hasattr(inner, "__struct_fields__")
    return [part_of(inner, one) for one in value] if mirrors else value


def plain(part: DocumentPart) -> dict[str, Any]:
    """Return a part as JSON has it: dictionaries, lists, texts and numbers.

    Raises
    ------
    msgspec.ValidationError
        If a value is not of its kind.
    """
    return msgspec.to_builtins(
        read_part(type(part), msgspec.to_builtins(part, enc_hook=lambda number: number.item()))
    )


def read_part(kind: type[Part], values: Any) -> Part:
    """Return a part made of what JSON has.

    Raises
    ------
    msgspec.ValidationError
        If a value is missing or not of its kind; `refusal` says which.
    """
    return msgspec.convert(values, kind)


def refusal(error: msgspec.ValidationError) -> str:
    """Return where a document is damaged and how, as ``site.gravity: expected float, got str``."""
    what, _, where = str(error).replace("`", "").partition(" - at $")
    missing = what.removeprefix("Object missing required field ")
    if missing != what:
        what, where = "It is missing", f"{where}.{missing}"
    return f"{shown(where.strip('.')) or 'the document'}: {what[0].lower()}{what[1:]}"


def schema_of(kind: type[DocumentPart]) -> dict[str, Any]:
    """Return the JSON schema of a document."""
    _, parts = msgspec.json.schema_components([kind], ref_template="#/$defs/{name}")
    return {**parts.pop(kind.__name__), "$defs": parts}


Row = tuple[float, float, float]
Rows = tuple[Row, Row, Row]


def finite(value: float) -> float | None:
    """Return a number as a document has it: null where there is none."""
    return float(value) if np.isfinite(value) else None


def row_of(vector: ArrayLike) -> Row:
    """Return three numbers as a document has them."""
    x, y, z = np.asarray(vector, dtype=float).tolist()
    return x, y, z


def rows_of(matrix: ArrayLike) -> Rows:
    """Return a (3, 3) matrix as a document has it."""
    a, b, c = np.asarray(matrix, dtype=float)
    return row_of(a), row_of(b), row_of(c)
