"""Keep calibrations of many units over years, and ask how they change, when they are due, how they differ.

A registry is a SQLite file or a PostgreSQL database: `--registry` FILE or URL. Without it the environment variable
TUMBLE_REGISTRY counts, and then tumble-registry.sqlite in this folder.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from tumble.cli.groups import Command, Group, flowing, grouped
from tumble.cli.options import Json, PrintOptions, RegistryName
from tumble.cli.terminal import console, results_stand, say, say_json, say_written, table
from tumble.errors import UsageError
from tumble.workflows import FIRST, argument, option

if TYPE_CHECKING:
    from tumble.workflows import History

app = typer.Typer(
    name="registry",
    cls=Group,
    help=flowing(__doc__ or ""),
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)


def add_command(
    *,
    calibrations: list[Path] = argument("CALIBRATION..."),
    printed: PrintOptions,
    registry: RegistryName = None,
    unit: str | None = option(FIRST, "NAME"),
) -> None:
    """Add calibrations; one that is there already is left as it is.

    tumble registry add lot-17/units/* --registry units.sqlite

    Parameters
    ----------
    calibrations : calibration.json, or folders that hold one.
    unit : Which unit it is of (default: the serial number in the document).
    """
    from tumble.workflows import add_files

    made = add_files(registry, calibrations, unit=unit)
    results_stand()
    if printed.as_json:
        say_json([{**asdict(entry), "new": new} for entry, new in made], indent=1)
    elif not printed.quiet:
        say(*(f"{entry.unit}: {entry.identity} {'added' if new else 'was there'}" for entry, new in made))


def list_command(
    registry: RegistryName = None,
    unit: str | None = option(FIRST, "NAME"),
    most: int = option(FIRST, "N", default=50, show_default=True),
    due: Path | None = option(FIRST, "TOLERANCES.YAML"),
    before: str | None = option(FIRST, "YYYY-MM-DD"),
    as_json: Json = False,
) -> None:
    """List calibrations, the newest first, or with --due the units, the next one first.

    Parameters
    ----------
    unit : Its calibrations only.
    most : As many at most, the newest first.
    due : Instead when each unit is due: when its drift, with twice its uncertainty, meets a tolerance. A file as for
        --limits: `within` is the change that is allowed.
    before : Of --due only units before that day, or of which nobody knows; exit status 1 if there is one.
    """
    if most < 1:
        raise UsageError(f"--most {most}: give one or more.")
    if due is not None:
        if unit is not None or most != 50:
            raise UsageError("--due lists every unit: leave --unit and --most out.")
        _list_due(registry, due, before, as_json=as_json)
    if before is not None:
        raise UsageError("--before goes with --due TOLERANCES.YAML: it says by which change a unit is due.")
    from tumble.registry import counted, entries
    from tumble.workflows import date_words, registry_at

    with registry_at(registry) as opened:
        found, (units, total) = entries(opened, unit, most=most), counted(opened)
    if as_json:
        say_json([asdict(entry) for entry in found], indent=1)
        return
    if unit is not None and not found:
        say(f"The registry has no calibration of unit {unit}; it has {total} calibrations of {units} units.")
        return
    words = {True: "fit", False: "not fit"}
    rows = [
        [e.unit, date_words(e.created), e.identity, e.procedure, words[e.fit], e.limits or "–", e.remark]
        for e in found
    ]
    console().print(table(("unit", "made", "identity", "procedure", "verdict", "limits", "remark"), rows))
    say(f"{len(found)} of {total} calibrations of {units} units.")


def _list_due(registry: str | None, tolerances: Path, before: str | None, *, as_json: bool) -> NoReturn:
    """Print when each unit is due."""
    from tumble.fleet import FEWEST_RATES
    from tumble.workflows import date_words, due_units

    found = due_units(registry, tolerances, before)
    if as_json:
        say_json(
            [{**asdict(one), "due": date_words(one.due), "last": date_words(one.last)} for one in found],
            indent=1,
        )
    else:
        rows = [
            [one.unit, date_words(one.last), date_words(one.due), one.parameter, str(one.calibrations)]
            for one in found
        ]
        console().print(table(("unit", "calibrated", "due", "because of", "calibrations"), rows))
        if unknown := sum(math.isnan(one.due) for one in found):
            say(
                f"Of {unknown} of them nothing is known of the drift: calibrate a unit twice, some weeks apart, "
                f"or {FEWEST_RATES} units of its kind."
            )
    raise typer.Exit(1 if before is not None and found else 0)


def show_command(
    which: str = argument("WHICH"),
    registry: RegistryName = None,
    output: Path | None = option(FIRST, "FILE", "--output", "-o"),
    as_json: Json = False,
) -> None:
    """Show a calibration, whole.

    Parameters
    ----------
    which : A unit (its newest), or digits of an identity or of a SHA-256.
    output : Write its document there.
    """
    from tumble.registry import find
    from tumble.workflows import date_words, registry_at

    with registry_at(registry) as opened:
        entry, document = find(opened, which)
    if output is not None:
        document.write(output)
        results_stand()
    if as_json:
        say_json({**asdict(entry), "document": document}, indent=1)
        return
    from tumble.report import print_calibration

    say(
        f"Unit {entry.unit}, made {date_words(entry.created)}, added {date_words(entry.added)}"
        + (f" by {entry.added_by}" if entry.added_by else "")
        + (f", measured by {entry.operator}" if entry.operator else ""),
        *([entry.remark] if entry.remark else []),
    )
    print_calibration(document, console())
    say_written([output] if output else [])


def history_command(
    unit: str = argument("UNIT"),
    registry: RegistryName = None,
    output: Path | None = option(FIRST, "FILE", "--output", "-o"),
    as_json: Json = False,
) -> None:
    """Show how a unit changes: each parameter's change and rate, with uncertainties from all its calibrations.

    An EWMA chart against the first five says whether something has changed: of a check unit, the measurement.

    Parameters
    ----------
    unit : Name of a unit.
    output : Also draw it: an HTML page.
    """
    from tumble.workflows import date_words, history, history_rows

    found = history(registry, unit)
    rows, days = history_rows(found), [date_words(float(x)) for x in found.parameters.created]
    if output is not None:
        _draw_history(found, days, rows, output)
    if as_json:
        signals = found.signals and [
            {"date": date_words(one.time), "parameter": one.parameter, "ewma": one.ewma, "limit": one.limit}
            for one in found.signals
        ]
        say_json({"unit": unit, "dates": days, "parameters": rows, "signals": signals}, indent=1)
        return
    say(f"{unit}: {', '.join(days)}")
    from tumble.report import history_table, print_blocks

    print_blocks([history_table(rows)], console())
    _say_signals(found, rows)
    say_written([output] if output else [])


def _draw_history(found: History, days: list[str], rows: list[dict[str, Any]], output: Path) -> None:
    from tumble.files import write_text
    from tumble.report import history_page, render_page

    one = found.parameters
    page = history_page(found.unit, days, one.names, one.units, (one.values, one.sigmas), rows)
    write_text(output, render_page(page))
    results_stand()


def _say_signals(found: History, rows: list[dict[str, Any]]) -> None:
    """Say what there is no rate for, and where the chart signals."""
    from tumble.workflows import BASELINE, SHORTEST_HISTORY, date_words

    if all(row["rate_a_year"] is None for row in rows):
        say(f"A rate takes calibrations that are {SHORTEST_HISTORY} days apart or more.")
    if found.signals is None:
        return
    if not found.signals:
        say(f"An EWMA chart has no signal against the mean of the first {BASELINE}.")
        return
    shown = [
        [date_words(one.time), one.parameter, f"{one.ewma:+.2f}", f"{one.limit:.2f}"] for one in found.signals
    ]
    console().print(table(("date", "parameter", "EWMA", "limit ±"), shown, right=(2, 3)))
    say(f"The unit, or the measurement, has changed since the first {BASELINE}.")


def fleet_command(
    registry: RegistryName = None,
    output: Path | None = option(FIRST, "FILE", "--output", "-o"),
    as_json: Json = False,
) -> None:
    """Say how units differ: mean and spread between units, without what the calibrations' own errors add.

    tumble registry fleet -o fleet.json, then tumble calibrate next.csv --prior fleet.json

    Parameters
    ----------
    output : Write the mean unit with the spread as a calibration.json for --prior.
    """
    from tumble.workflows import fleet

    document, between = fleet(registry, output)
    if output is not None:
        results_stand()
    if as_json:
        say_json({"units": between.count, "document": document}, indent=1)
        return
    from tumble.report import headed_table, parameter_rows, print_blocks

    shown = [row for row in parameter_rows(document) if row.said.sigma > 0.0]
    say(f"{between.count} units: the mean, and the standard deviation of a next unit")
    lines = [(row.name, (row.said.number, row.said.unit)) for row in shown]
    print_blocks([headed_table(("parameter", "mean ± spread", "unit"), lines)], console())
    if any(row.kind == "misalignment" for row in shown):
        console().print(
            "Misalignments are against the accelerometers' axes: theirs are their non-orthogonalities, the "
            "gyros' hold the rotation between the triads, too."
        )
    say_written([output] if output else [])


COMMANDS = {
    "add": add_command,
    "list": list_command,
    "show": show_command,
    "history": history_command,
    "fleet": fleet_command,
}
for _name, _command in COMMANDS.items():
    app.command(_name, cls=Command)(grouped(_command))
