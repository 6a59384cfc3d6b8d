"""`tumble units explain`: what a number of a data sheet says about noise."""

from __future__ import annotations

from math import isfinite
from typing import Annotated

import typer

from tumble.cli.options import Json
from tumble.errors import UsageError


def units_command(
    action: Annotated[str, typer.Argument(metavar="explain", help="The word explain.")],
    number: Annotated[
        list[str],
        typer.Argument(
            metavar="VALUE UNIT",
            help="The number, and its unit, as 0.3 deg/√h or '60 ug/sqrt(Hz)', or a file's key, as imu_utils:gyr_n.",
        ),
    ],
    rate: Annotated[float | None, typer.Option(help="Sampling rate in Hz, for numbers per sample.")] = None,
    as_json: Json = False,
) -> None:
    """Say what a noise figure is, and what it is in other units and files."""
    if action != "explain":
        raise UsageError(f"tumble units {action}: it is `tumble units explain VALUE UNIT`.")
    from tumble.workflows.unit_words import explain_unit

    answer = explain_unit(*_value_and_unit(number), rate)
    if as_json:
        import json
        from dataclasses import asdict

        content = asdict(answer)
        content["si"] = answer.si if isfinite(answer.si) else None
        typer.echo(json.dumps(content, indent=2, ensure_ascii=False))
        return
    typer.echo(answer.meaning)
    if answer.equals:
        typer.echo("")
    names = max((len(line.name) for line in answer.equals), default=0)
    for line in answer.equals:
        note = f"   if {line.assumption}" if line.assumption else ""
        typer.echo(f"  {line.name:<{names}}  {line.value:<12.6g} {line.unit}{note}")
    if answer.not_convertible:
        typer.echo("")
    for sentence in answer.not_convertible:
        typer.echo(sentence)


def _value_and_unit(words: list[str]) -> tuple[float, str]:
    """The number and the unit of words, in one argument or several.

    Raises
    ------
    UsageError
        If there is no number, no unit, or an option that the command has not.
    """
    first, *rest = " ".join(words).split()
    try:
        value = float(first)
    except ValueError:
        what = "No such option" if first.startswith("-") else "No number"
        raise UsageError(
            f"{what}: {first}. It is `tumble units explain VALUE UNIT`, as 0.3 deg/√h."
        ) from None
    unknown = [word for word in rest if word.startswith("-")]
    if unknown:
        raise UsageError(f"No such option: {unknown[0]}: see `tumble units --help`.")
    if not rest:
        raise UsageError(f"{first} has no unit: it is `tumble units explain VALUE UNIT`, as 0.3 deg/√h.")
    return value, "".join(rest)


__all__ = ["units_command"]
