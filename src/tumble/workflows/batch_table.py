"""The table of a batch, a row a unit: for spreadsheets (CSV) and for data frames (Parquet)."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING

from tumble.recording.formats.output import write_table

if TYPE_CHECKING:
    from tumble.fleet.outcome import Batch

Cell = str | float | None
# What a spreadsheet would take for a formula.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def rows_of(batch: Batch) -> tuple[list[str], list[list[Cell]]]:
    """Return heads and rows of the table.

    First unit, files, verdict, limits and reasons; then what the manifest says, the temperature, and each parameter
    with its unit in brackets, followed by its standard uncertainty (``sigma of ...``).

    Parameters
    ----------
    batch : of units.
    """
    more = list(dict.fromkeys(name for unit in batch.units for name in unit.more))
    names = list(dict.fromkeys((p[0], p[3]) for unit in batch.units for p in unit.parameters))
    heads = ["unit", "files", "verdict", "limits", "reasons", *more, "temperature [degC]"]
    for name, unit in names:
        heads += [f"{name} [{unit}]", f"sigma of {name} [{unit}]"]
    rows: list[list[Cell]] = []
    for one in batch.units:
        known = {(p[0], p[3]): (p[1], p[2]) for p in one.parameters}
        row: list[Cell] = [
            one.unit,
            ";".join(one.files),
            one.verdict,
            one.limits,
            " ".join(batch.reasons(one)),
        ]
        row += [one.more.get(name, "") for name in more]
        row.append(one.temperature)
        for name in names:
            row += list(known.get(name, (None, None)))
        rows.append(row)
    return heads, rows


def csv_text(heads: list[str], rows: list[list[Cell]]) -> str:
    """Return the table as CSV; a text that a spreadsheet would run as a formula has an apostrophe in front.

    Parameters
    ----------
    heads, rows : of the table.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([_harmless(head) for head in heads])
    for row in rows:
        writer.writerow(
            ["" if cell is None else _harmless(cell) if isinstance(cell, str) else repr(cell) for cell in row]
        )
    return text.getvalue()


def _harmless(text: str) -> str:
    return f"'{text}" if text.startswith(_FORMULA) else text


def write_parquet(path: Path, heads: list[str], rows: list[list[Cell]]) -> Path:
    """Write the table as Parquet; return its place.

    Parameters
    ----------
    path, heads, rows : where, and what.

    Raises
    ------
    OutputError
        If it cannot be written; an earlier one is then intact.
    """
    text = {"unit", "files", "verdict", "limits", "reasons"}
    columns: dict[str, list[Cell]] = {}
    for place, head in enumerate(heads):
        column = [row[place] for row in rows]
        is_text = head in text or any(isinstance(cell, str) for cell in column)
        columns[head] = [str(cell or "") for cell in column] if is_text else column
    write_table(
        path, columns, numbers={head for head in heads if not any(isinstance(c, str) for c in columns[head])}
    )
    return path
