"""`tumble registry`: units and their calibrations over the years."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from tumble.cli.groups import FIRST, Group, command_class, grouped, option
from tumble.cli.options import PrintOptions, RegistryName, output_option
from tumble.cli.terminal import console, results_stand, say, say_json, say_written, table

app = typer.Typer(
    name="registry",
    cls=Group,
    help="Keep calibrations of many units over years, and ask how they change, when they are due, how "
    "they differ.\n\nA registry is a SQLite file or a PostgreSQL database: `--registry` FILE "
    "or URL. Without it the environment variable TUMBLE_REGISTRY counts, and then "
    "tumble-registry.sqlite in this folder.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)

Operator: TypeAlias = Annotated[str, option(FIRST, "NAME", "Who measured, for `study`.", "--operator")]
UnitArgument: TypeAlias = Annotated[str, typer.Argument(metavar="UNIT", help="Name of a unit.")]


def add_command(
    calibrations: Annotated[
        list[Path],
        typer.Argument(metavar="CALIBRATION...", help="calibration.json, or folders that hold one."),
    ],
    printed: PrintOptions,
    registry: RegistryName = None,
    unit: Annotated[
        str | None, option(FIRST, "NAME", "Which unit it is of (default: the serial number in the document).")
    ] = None,
    operator: Operator = "",
    remark: Annotated[str, option(FIRST, "TEXT", "What else there is to say.")] = "",
) -> None:
    """Add calibrations; one that is there already is left as it is.

    tumble registry add lot-17/units/* --registry units.sqlite
    """
    from tumble.workflows.registry import add_files

    made = add_files(registry, calibrations, unit=unit, operator=operator, remark=remark)
    results_stand()
    if printed.as_json:
        say_json([{**asdict(entry), "new": new} for entry, new in made], indent=1)
    elif not printed.quiet:
        say(*(f"{entry.unit}: {entry.identity} {'added' if new else 'was there'}" for entry, new in made))


def list_command(
    printed: PrintOptions,
    registry: RegistryName = None,
    unit: Annotated[str | None, option(FIRST, "NAME", "Its calibrations only.")] = None,
    most: Annotated[int, option(FIRST, "N", "As many at most, the newest first.", show_default=True)] = 50,
) -> None:
    """List calibrations, the newest first."""
    from tumble.errors import UsageError
    from tumble.registry.store import counted, entries
    from tumble.workflows.registry import date_words, registry_at

    if most < 1:
        raise UsageError(f"--most {most}: give one or more.")
    with registry_at(registry) as opened:
        found, (units, total) = entries(opened, unit, most=most), counted(opened)
    if printed.as_json:
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


def show_command(
    which: Annotated[
        str,
        typer.Argument(
            metavar="WHICH", help="A unit (its newest), or digits of an identity or of a SHA-256."
        ),
    ],
    printed: PrintOptions,
    registry: RegistryName = None,
    output: Annotated[Path | None, output_option("Write its document there.", "FILE")] = None,
) -> None:
    """Show a calibration, whole."""
    from tumble.registry.store import find
    from tumble.workflows.registry import date_words, registry_at

    with registry_at(registry) as opened:
        entry, document = find(opened, which)
    if output is not None:
        document.write(output)
        results_stand()
    if printed.as_json:
        say_json({**asdict(entry), "document": document.model_dump(mode="json")}, indent=1)
        return
    from tumble.report.summary import print_calibration

    say(
        f"Unit {entry.unit}, made {date_words(entry.created)}, added {date_words(entry.added)}"
        + (f" by {entry.added_by}" if entry.added_by else "")
        + (f", measured by {entry.operator}" if entry.operator else ""),
        *([entry.remark] if entry.remark else []),
    )
    print_calibration(document, console())
    say_written([output] if output else [])


def history_command(
    unit: UnitArgument,
    printed: PrintOptions,
    registry: RegistryName = None,
    output: Annotated[Path | None, output_option("Also draw it: an HTML page.", "FILE")] = None,
) -> None:
    """Show how a unit changes: each parameter's change and rate, with uncertainties from all its calibrations."""
    from tumble.files import write_text
    from tumble.report.history import history_page
    from tumble.workflows.registry import SHORTEST_HISTORY, date_words, history, history_rows

    found = history(registry, unit)
    rows, days = history_rows(found), [date_words(float(x)) for x in found.parameters.created]
    if output is not None:
        from tumble.report.html import render_page

        one = found.parameters
        write_text(
            output,
            render_page(history_page(unit, days, one.names, one.units, (one.values, one.sigmas), rows)),
        )
        results_stand()
    if printed.as_json:
        say_json({"unit": unit, "dates": days, "parameters": rows}, indent=1)
        return
    say(f"{unit}: {', '.join(days)}")
    console().print(
        table(("parameter", "newest", "change", "a year"), [_history_row(row) for row in rows], fold=True)
    )
    if all(row["rate_a_year"] is None for row in rows):
        say(f"A rate takes calibrations that are {SHORTEST_HISTORY} days apart or more.")
    say_written([output] if output else [])


def due_command(
    tolerances: Annotated[
        Path,
        typer.Argument(
            metavar="TOLERANCES", help="A file as for --limits: `within` is the change that is allowed."
        ),
    ],
    printed: PrintOptions,
    registry: RegistryName = None,
    before: Annotated[
        str | None,
        option(
            FIRST,
            "YYYY-MM-DD",
            "Only units that are due before that day, or of which nobody knows; exit status 1 if there is one.",
        ),
    ] = None,
) -> None:
    """Say when each unit is due: when its drift since then, with twice its uncertainty, meets a tolerance."""
    from datetime import UTC, datetime

    from tumble.errors import UsageError
    from tumble.fleet.drift import FEWEST_RATES
    from tumble.workflows.registry import date_words, due

    found = due(registry, tolerances)
    if before is not None:
        try:
            day = datetime.fromisoformat(before).replace(tzinfo=UTC).timestamp()
        except ValueError:
            raise UsageError(f"--before {before}: give a day as 2027-03-31.") from None
        found = [one for one in found if not one.due >= day]
    if printed.as_json:
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
        unknown = sum(math.isnan(one.due) for one in found)
        if unknown:
            say(
                f"Of {unknown} of them nothing is known of the drift: calibrate a unit twice, some weeks apart, "
                f"or {FEWEST_RATES} units of its kind."
            )
    raise typer.Exit(1 if before is not None and found else 0)


def fleet_command(
    printed: PrintOptions,
    registry: RegistryName = None,
    output: Annotated[
        Path | None,
        output_option("Write the mean unit with the spread as a calibration.json for --prior.", "FILE"),
    ] = None,
) -> None:
    """Say how units differ: mean and spread between units, without what the calibrations' own errors add.

    tumble registry fleet -o fleet.json, then tumble calibrate next.csv --prior fleet.json
    """
    from tumble.workflows.registry import fleet

    document, between = fleet(registry, output)
    if output is not None:
        results_stand()
    if printed.as_json:
        say_json({"units": between.count, "document": document.model_dump(mode="json")}, indent=1)
        return
    from tumble.report.parameters import parameter_rows

    measures = [
        (row.name, row.other if row.family == "bias" and row.other is not None else row.shown)
        for row in parameter_rows(document)
    ]
    rows = [
        [name, f"{one.value:.4g}", f"{one.sigma:.2g}", one.unit] for name, one in measures if one.sigma > 0.0
    ]
    title = f"{between.count} units: the mean, and the standard deviation of a next unit"
    console().print(table(("parameter", "mean", "spread", "unit"), rows, right=(1, 2), title=title))
    if any("misalignment" in name for name, _ in measures):
        console().print(
            "Misalignments are against the accelerometers' axes: theirs are their non-orthogonalities, the "
            "gyros' hold the rotation between the triads, too."
        )
    say_written([output] if output else [])


def chart_command(
    unit: UnitArgument,
    printed: PrintOptions,
    registry: RegistryName = None,
    baseline: Annotated[
        int, option(FIRST, "N", "Calibrations whose mean is the reference.", show_default=True)
    ] = 5,
) -> None:
    """Watch the measurement itself by a check unit: an EWMA chart of its calibrations. Exit status 1: a signal."""
    from tumble.workflows.registry import chart, date_words

    group, found = chart(registry, unit, baseline)
    own = group.unit == group.unit_names.index(unit)
    days = [date_words(float(x)) for x in group.created[own]]
    signals = [
        {
            "date": days[i],
            "parameter": group.names[k],
            "ewma": float(found.ewma[i, k]),
            "limit": float(found.limit[i]),
        }
        for i in range(len(days))
        for k in range(len(group.names))
        if found.signals[i, k]
    ]
    if printed.as_json:
        say_json({"unit": unit, "dates": days, "parameters": list(group.names), "signals": signals}, indent=1)
    elif signals:
        rows = [
            [str(s["date"]), str(s["parameter"]), f"{s['ewma']:+.2f}", f"{s['limit']:.2f}"] for s in signals
        ]
        console().print(table(("date", "parameter", "EWMA", "limit ±"), rows, right=(2, 3)))
        say("The measurement, or the check unit, has changed.")
    else:
        say(
            f"No signal in {len(days)} calibrations of {unit}, against the mean of the first {found.baseline}."
        )
    raise typer.Exit(1 if signals else 0)


def study_command(printed: PrintOptions, registry: RegistryName = None) -> None:
    """Say how repeatable calibrations are (gauge R&R): parts of units, operators and repetitions, by parameter."""
    from tumble.workflows.registry import study

    found = study(registry)
    if printed.as_json:
        say_json({name: asdict(one) for name, one in found.items()}, indent=1)
        return
    heads = ("parameter", "unit", "operator", "unit x operator", "repetition", "stated", "R&R")
    rows = [
        [name, *map(_number, (*one.parts.values(), one.stated)), f"{100 * one.share:.1f} %"]
        for name, one in found.items()
    ]
    console().print(table(heads, rows, right=range(1, 7), title="Standard deviations"))


def export_command(
    output: Annotated[Path, typer.Argument(metavar="FILE", help="Lines of JSON, a calibration each.")],
    registry: RegistryName = None,
) -> None:
    """Write a registry as lines of JSON."""
    from tumble.files import check_target
    from tumble.registry.exchange import export
    from tumble.workflows.registry import registry_at

    check_target(output)
    with registry_at(registry) as opened:
        count = export(opened, output)
    results_stand()
    say(f"{count} calibrations")
    say_written([output])


def import_command(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="What `tumble registry export` wrote.")],
    registry: RegistryName = None,
) -> None:
    """Add the calibrations of an export; those that are there already stay as they are."""
    from tumble.registry.exchange import import_lines
    from tumble.workflows.registry import registry_at

    with registry_at(registry, make=True) as opened:
        new, known = import_lines(opened, source)
    results_stand()
    say(f"{new} calibrations added, {known} were there.")


def _history_row(row: dict[str, Any]) -> list[str]:
    from tumble.report.rounding import with_uncertainty

    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    rate, sigma = row["rate_a_year"], row["rate_standard_uncertainty"]
    return [
        row["name"],
        with_uncertainty(row["last"], row["standard_uncertainty"]) + unit,
        with_uncertainty(row["change"], row["change_standard_uncertainty"]) + unit,
        "–" if rate is None or not sigma else with_uncertainty(rate, sigma) + unit,
    ]


def _number(value: Any) -> str:
    return "–" if value is None or value != value else f"{value:.4g}"


COMMANDS = {
    "add": add_command,
    "list": list_command,
    "show": show_command,
    "history": history_command,
    "due": due_command,
    "fleet": fleet_command,
    "chart": chart_command,
    "study": study_command,
    "export": export_command,
    "import": import_command,
}
for _name, _command in COMMANDS.items():
    app.command(_name, cls=command_class({}))(grouped(_command))
