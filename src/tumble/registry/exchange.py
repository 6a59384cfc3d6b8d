"""A registry as a file of lines, one calibration a line as JSON: for copies, and from one database to another."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError

from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.files import opened, write_text
from tumble.registry import schema
from tumble.registry.opening import Registry
from tumble.registry.store import add

FORMAT, VERSION = "tumble registry", 1
_ABOUT = ("added", "added_by", "operator", "remark")


def export(registry: Registry, path: Path) -> int:
    """Write every calibration; return how many.

    Parameters
    ----------
    registry, path : from where, and to where.

    Raises
    ------
    OutputError
        If the file cannot be written; an earlier one is then intact.
    RegistryError
        If the database fails.
    """
    lines = [json.dumps({"format": FORMAT, "version": VERSION})]
    lines += [json.dumps(line, ensure_ascii=False) for line in _lines(registry)]
    write_text(path, "\n".join(lines) + "\n")
    return len(lines) - 1


def _lines(registry: Registry) -> Iterator[dict[str, Any]]:
    from sqlalchemy import select

    table = schema.calibrations
    columns = (schema.units.c.name, *(table.c[key] for key in _ABOUT), schema.documents.c.document)
    query = select(*columns).select_from(table).join(schema.units).join(schema.documents).order_by(table.c.id)
    with registry.reading() as connection:
        for row in connection.execute(query):
            told: list[Any] = list(row)
            about = dict(zip(_ABOUT, told[1:-1], strict=True))
            yield {"unit": told[0], **about, "document": json.loads(told[-1])}


def import_lines(registry: Registry, path: Path) -> tuple[int, int]:
    """Add every calibration of a file; return how many are new, and how many were there already.

    Parameters
    ----------
    registry, path : to where, and from where.

    Raises
    ------
    UsageError
        If the file is no export, or a line of it is damaged; the lines before it are then in the registry.
    RegistryError
        If the database fails.
    """
    new = known = 0
    try:
        with opened(path) as file:
            for number, line in enumerate(file, 1):
                told: Any = json.loads(line)
                if number == 1:
                    _check_head(told, path)
                    continue
                calibration = Calibration.model_validate(told["document"])
                about = {key: told[key] for key in _ABOUT}
                _, is_new = add(registry, calibration, unit=str(told["unit"]), **about)
                new, known = new + is_new, known + (not is_new)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}.") from error
    except (ValueError, KeyError, TypeError, ValidationError):
        raise UsageError(
            f"{path} is damaged in line {new + known + 2}, or no export of a registry; {new + known} calibrations "
            "before it are in the registry."
        ) from None
    return new, known


def _check_head(told: Any, path: Path) -> None:
    head = cast("dict[str, Any]", told) if isinstance(told, dict) else {}
    if head.get("format") != FORMAT:
        raise UsageError(f"{path} is no export of a registry (`tumble registry export`).")
    if head.get("version") != VERSION:
        raise UsageError(f"{path} is an export of version {head.get('version')!r:.20}: update tumble.")
