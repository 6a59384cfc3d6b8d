"""`tumble units`: what a number of a data sheet says about noise."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from tumble.cli.groups import FIRST, option
from tumble.cli.options import Json
from tumble.cli.terminal import say, say_json
from tumble.errors import UsageError


def units_command(
    number: Annotated[
        list[str],
        typer.Argument(
            metavar="VALUE UNIT",
            help="The number, and its unit, as 0.3 deg/√h or '60 ug/sqrt(Hz)', or a file's key, as imu_utils:gyr_n.",
        ),
    ],
    sample_rate: Annotated[
        float | None, option(FIRST, "HZ", "Sampling rate, for numbers per sample.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Say what a noise figure is, and what it is in other units and files.

    tumble units 0.15 deg/√h --sample-rate 100
    """
    from tumble.workflows.given.data_sheet import explain_unit

    answer = explain_unit(*_value_and_unit(number), sample_rate)
    if as_json:
        say_json(asdict(answer), indent=2)
        return
    say(answer.meaning)
    if answer.equals:
        say("")
    names = max((len(line.name) for line in answer.equals), default=0)
    for line in answer.equals:
        note = f"   if {line.assumption}" if line.assumption else ""
        say(f"  {line.name:<{names}}  {line.value:<12.6g} {line.unit}{note}")
    if answer.not_convertible:
        say("")
    for sentence in answer.not_convertible:
        say(sentence)


def _value_and_unit(words: list[str]) -> tuple[float, str]:
    """The number and the unit of words, in one argument or several.

    Raises
    ------
    UsageError
        If there is no number, no unit, or an option that the command has not.
    """
    first, *rest = " ".join(words[words[0] == "explain" :]).split() or [""]
    try:
        value = float(first)
    except ValueError:
        what = "No such option" if first.startswith("-") else "No number"
        raise UsageError(f"{what}: {first}. It is `tumble units VALUE UNIT`, as 0.3 deg/√h.") from None
    unknown = [word for word in rest if word.startswith("-")]
    if unknown:
        raise UsageError(f"No such option: {unknown[0]}: see `tumble units --help`.")
    if not rest:
        raise UsageError(f"{first} has no unit: it is `tumble units VALUE UNIT`, as 0.3 deg/√h.")
    return value, "".join(rest)
