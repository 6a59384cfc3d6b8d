"""`tumble units explain`: what a number of a data sheet says about noise."""

from __future__ import annotations

from math import isfinite
from typing import Annotated

import typer

from tumble.cli.options import Json
from tumble.errors import UsageError


def units_command(
    action: Annotated[str, typer.Argument(metavar="explain", help="The word explain.")],
    value: Annotated[float, typer.Argument(metavar="VALUE", help="The number.")],
    unit: Annotated[
        str,
        typer.Argument(
            metavar="UNIT",
            help="Its unit, as deg/√h or 'ug/sqrt(Hz)', or the key of a file, as imu_utils:gyr_n.",
        ),
    ],
    rate: Annotated[float | None, typer.Option(help="Sampling rate in Hz, for numbers per sample.")] = None,
    as_json: Json = False,
) -> None:
    """Say what a noise figure is, and what it is in other units and files."""
    if action != "explain":
        raise UsageError(f"tumble units {action}: it is `tumble units explain VALUE UNIT`.")
    from tumble.workflows.unit_words import explain_unit

    answer = explain_unit(value, unit, rate)
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


__all__ = ["units_command"]
