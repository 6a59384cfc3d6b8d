"""What a batch is of: a folder, a pattern, or a manifest, as one task a unit."""

from __future__ import annotations

import csv
import glob
import io
import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import field, fields
from difflib import get_close_matches
from pathlib import Path

from tumble.errors import UsageError
from tumble.files import HIDDEN, number_of, read_text, reading, shown, without_password
from tumble.records import dataclass
from tumble.sample_rates import stated_clock
from tumble.workflows.request import CalibrateRequest, option_of

MANIFEST = "manifest.csv"
"""In a folder it says what the units are."""
BY_UNIT = tuple(one.name for one in fields(CalibrateRequest) if (own := option_of(one)) and own.by_unit)
"""Fields of the request that a manifest may say unit by unit."""
# What a manifest may say of a unit; any other column is kept for the table.
TOLD = (*BY_UNIT, "topic", "site", "gravity", "temperature", "model")
KNOWN = ("unit", "files", *TOLD)
OUTCOME = ("verdict", "limits", "reasons")
_NO_RECORDING = {
    *(".yaml", ".yml", ".json", ".html", ".htm", ".md", ".pdf", ".png", ".svg", ".py", ".xml", ".log.txt"),
    *(".part", ".js", ".css"),
}
_PACKED = {".gz", ".bz2", ".xz", ".zst", ".zip"}
_NAME = re.compile(r"[\\/:*?\"<>|]")
_LONGEST = 120


@dataclass(frozen=True, slots=True)
class UnitTask:
    """What is known of one unit before its calibration.

    Attributes
    ----------
    unit : its name, which is that of its folder.
    files : its recordings; of a pair of files both.
    told : of `TOLD`, what the manifest says.
    more : its other columns.
    missing : files that are not there.
    """

    unit: str
    files: tuple[str, ...]
    told: dict[str, str] = field(default_factory=dict[str, str])
    more: dict[str, str] = field(default_factory=dict[str, str])
    missing: tuple[str, ...] = ()


def read_source(sources: Sequence[str]) -> list[UnitTask]:
    """Return the units of a batch in their order.

    Parameters
    ----------
    sources : one folder, pattern or manifest, or the files that a shell made of a pattern.

    Raises
    ------
    UsageError
        If there is nothing, a manifest is wrong, or two units have one name; the sentence says which.
    """
    if not sources:
        raise UsageError("Name a folder, a pattern or a manifest: see `tumble batch --help`.")
    if len(sources) == 1:
        tasks = _of_one(sources[0])
    else:
        manifests = [one for one in sources if _is_manifest(Path(one))]
        if manifests:
            raise UsageError(
                f"{manifests[0]} is a manifest and was named with others: give one manifest, or recordings."
            )
        tasks = [_of_file(one) for one in sources]
    if not tasks:
        raise UsageError(f"{sources[0]} holds no recordings.")
    _refuse_twice(tasks)
    return tasks


def _of_one(source: str) -> list[UnitTask]:
    path = Path(source)
    if path.is_dir():
        inside = path / MANIFEST
        return _manifest(inside) if inside.is_file() else _folder(path)
    if path.exists():
        if _is_manifest(path):
            return _manifest(path)
        raise UsageError(
            f"{source} is no manifest: its first line names no columns `unit` and `files`. A batch is a folder, a "
            "pattern such as 'units/*.csv', or a manifest; one recording is calibrated by `tumble calibrate`."
        )
    if any(sign in source for sign in "*?["):
        found = sorted(glob.glob(source, recursive=True))
        if not found:
            raise UsageError(f"No file matches the pattern {source}.")
        return [_of_folder(Path(one)) if os.path.isdir(one) else _of_file(one) for one in found]
    if "://" in source:
        raise UsageError(
            f"{without_password(source)}: a batch is of files of this machine: copy them here, or mount their store."
        )
    raise UsageError(f"There is no folder, manifest or pattern {source}.")


def _folder(folder: Path) -> list[UnitTask]:
    tasks: list[UnitTask] = []
    for one in sorted(folder.iterdir()):
        if one.name.startswith((".", "_")):
            continue
        if one.is_dir():
            tasks += [_of_folder(one)] if any(one.iterdir()) else []
        elif _may_be_recording(one):
            tasks.append(_of_file(str(one)))
    return tasks


def _of_folder(folder: Path) -> UnitTask:
    """A folder of one unit: with its protocol, or a bag, or the recordings in it."""
    protocol = folder / "protocol.yaml"
    if protocol.is_file():
        return UnitTask(folder.name, (), {"protocol": str(protocol)})
    if (folder / "metadata.yaml").is_file():
        return UnitTask(folder.name, (str(folder),))
    inside = [one for one in sorted(folder.iterdir()) if one.is_file() and not one.name.startswith(".")]
    files = tuple(str(one) for one in inside if _may_be_recording(one))
    return UnitTask(folder.name, files or (str(folder),))


def _of_file(name: str) -> UnitTask:
    missing = () if Path(name).exists() else (name,)
    return UnitTask(unit_name(name), (name,), missing=missing)


def unit_name(file: str) -> str:
    """Return the name of a unit from its file's: without endings.

    Parameters
    ----------
    file : path of it.

    Examples
    --------
    >>> unit_name("line-3/unit.17.csv.gz")
    'unit.17'
    """
    name = Path(file)
    while name.suffix.lower() in _PACKED:
        name = name.with_suffix("")
    return name.stem


def _may_be_recording(path: Path) -> bool:
    return (
        not path.name.startswith(".") and path.suffix.lower() not in _NO_RECORDING and path.name != MANIFEST
    )


def _is_manifest(path: Path) -> bool:
    if path.suffix.lower() not in (".csv", ".tsv", ".txt") or not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(4096)
    return _names_units(head.decode("utf-8-sig", errors="replace"))


def _names_units(text: str) -> bool:
    heads = [cell.strip().lower() for cell in re.split(r"[,;\t]", text.partition("\n")[0])]
    return "unit" in heads and ("files" in heads or "file" in heads or "protocol" in heads)


def _manifest(path: Path) -> list[UnitTask]:
    with reading(path, "a manifest"):
        text = read_text(path)
    if not _names_units(text):
        raise UsageError(f"The manifest {path} has no columns `unit` and `files` in its first line.")
    return _rows(text, str(path), path.parent)


def _rows(text: str, name: str, base: Path) -> list[UnitTask]:
    first = text.partition("\n")[0]
    separator = max(",;\t", key=first.count)
    rows = [row for row in csv.reader(io.StringIO(text), delimiter=separator) if any(map(str.strip, row))]
    heads = [cell.strip().lower() for cell in rows[0]]
    heads = ["files" if head == "file" else "topic" if head == "topics" else head for head in heads]
    twice = [head for head, count in Counter(heads).items() if count > 1]
    if twice:
        raise UsageError(f"The manifest {name} has the column {twice[0]!r} twice.")
    for head in heads:
        _check_head(head, name)
    tasks = [
        _row(heads, row, f"{name}, line {number}", base, separator) for number, row in enumerate(rows[1:], 2)
    ]
    if not tasks:
        raise UsageError(f"The manifest {name} names no units.")
    return tasks


def _row(heads: list[str], row: list[str], where: str, base: Path, separator: str) -> UnitTask:
    if len(row) > len(heads):
        raise UsageError(
            f"{where}: it has {len(row)} cells and the first line {len(heads)}: put several files of a unit into one "
            "cell, apart by ;, and the cell into quotes."
        )
    cells = {head: cell.strip() for head, cell in zip(heads, row, strict=False)}
    unit = cells.pop("unit", "")
    if not unit:
        raise UsageError(f"{where}: the unit has no name.")
    _check_name(unit, where)
    apart = "|" if separator == ";" else ";"
    files = [one.strip() for one in cells.pop("files", "").split(apart) if one.strip()]
    told = {key: cells.pop(key) for key in TOLD if cells.get(key)}
    for key in ("rate", "gravity", "temperature"):
        _check_number(told, key, where)
    for key in ("protocol", "prior", "noise", "intervals"):
        if key in told and _names_file(told[key], base):
            told[key] = _placed(told[key], base)
    if not files and "protocol" not in told:
        raise UsageError(f"{where}: unit {unit} has no files.")
    placed = tuple(_placed(one, base) for one in files)
    missing = tuple(one for one in placed if not Path(one).exists())
    return UnitTask(unit, placed, told, {k: v for k, v in cells.items() if k and k not in TOLD}, missing)


def _names_file(text: str, base: Path) -> bool:
    return any(sign in text for sign in "./") or Path(base, text).exists()


def _placed(name: str, base: Path) -> str:
    return str(Path(base) / name)


def _check_head(head: str, manifest: str) -> None:
    """Any column is kept for the table but those that the table has itself, and those that were meant to be known."""
    where = f"The manifest {manifest} has the column {shown(head)[:40]!r}"
    if head in OUTCOME:
        hint = "give limits for all units by --limits" if head == "limits" else "rename it"
        raise UsageError(f"{where}, which a batch's table has itself: {hint}.")
    meant = [] if head in KNOWN else get_close_matches(head, KNOWN, 1, 0.85)
    if meant:
        raise UsageError(f"{where}: is {meant[0]!r} meant? Else rename it.")


def _check_number(told: dict[str, str], key: str, where: str) -> None:
    if key in told and not (key == "rate" and stated_clock(told[key])):
        try:
            number_of(told[key] if key == "temperature" else told[key].replace("+-", "±").partition("±")[0])
        except ValueError as error:
            units = {"rate": "Hz", "gravity": "m/s²", "temperature": "°C"}[key]
            raise UsageError(f"{where}: {key}: {error}; give {units} without the unit.") from None


def _check_name(unit: str, where: str) -> None:
    if len(unit.encode()) > _LONGEST:
        raise UsageError(
            f"{where}: the unit's name {unit[:40]}… is longer than {_LONGEST} bytes, the most for a folder."
        )
    if _NAME.search(unit) or HIDDEN.search(unit) or unit[0] == ".":
        raise UsageError(
            f'{where}: {shown(unit)[:60]!r} is no name for a folder: leave out / \\ : * ? " < > | and a dot in front.'
        )


def _refuse_twice(tasks: Iterable[UnitTask]) -> None:
    # Where letters' case does not count, two such folders would be one.
    counted = Counter(task.unit.casefold() for task in tasks)
    twice = [name for name, count in counted.items() if count > 1]
    if twice:
        files = [
            task.files[0] if task.files else task.unit for task in tasks if task.unit.casefold() == twice[0]
        ]
        raise UsageError(
            f"{len(twice)} unit{'s have' if len(twice) > 1 else ' has'} a name that another has: {twice[0]} "
            f"({', '.join(files[:2])}); each unit needs its own, several recordings of one unit stand in one row."
        )
