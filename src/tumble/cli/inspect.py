"""`tumble inspect`: what a recording holds and what it is good for."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.options import Columns, Json, Rate, Recordings, Topics, Units

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from tumble.recording import Recording
    from tumble.workflows.inspect import Inspection


def inspect_command(
    recording: Recordings,
    columns: Columns = None,
    units: Units = None,
    rate: Rate = None,
    topic: Topics = None,
    save: Annotated[
        Path | None, typer.Option(help="Convert to this file: .csv or .parquet, raw numbers, time in s.")
    ] = None,
    as_json: Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print warnings only.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print every gap and every channel.")
    ] = False,
) -> None:
    """Say what a recording holds: streams, units, rate, gaps, rest and motion, and what it is good for."""
    from tumble.workflows.inspect import inspect

    inspection = inspect(recording, columns=columns, units=units, rate=rate, topics=topic, save=save)
    if as_json:
        typer.echo(json.dumps(inspection.to_dict(), indent=2, ensure_ascii=False))
        return
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=True)
    if not quiet:
        _print_facts(console, inspection, verbose)
    for warning in inspection.findings.warnings:
        console.print(f"[bold yellow]![/] {_plain(warning)}")
    if quiet:
        return
    for title, colour, sentences in (
        ("Good for", "green", inspection.findings.good_for),
        ("Missing", "cyan", inspection.findings.missing),
    ):
        if sentences:
            console.print(f"\n[bold]{title}[/]")
        for sentence in sentences:
            console.print(f"  [{colour}]•[/] {_plain(sentence)}")
    if inspection.saved is not None:
        console.print(f"\nSaved as {_plain(str(inspection.saved))}")


def _plain(text: str) -> str:
    """Keep square brackets of a text from being read as rich's markup."""
    return text.replace("[", "\\[")


def _print_facts(console: Console, inspection: Inspection, verbose: bool) -> None:
    recording, found = inspection.recording, inspection.findings
    console.print(f"[bold]{_plain(' + '.join(s.name for s in recording.sources))}[/]")
    minutes, seconds = divmod(found.duration, 60.0)
    length = f"{found.duration:.2f} s" if minutes < 2 else f"{minutes:.0f} min {seconds:.1f} s"
    gaps = f"{len(found.gaps)} gap(s)" if found.gaps else "no gaps"
    jitter = f"jitter {100 * found.jitter:.1f} % of a step"
    console.print(f"{found.samples} samples in {length}, {found.rate:.6g} Hz, {jitter}, {gaps}")
    console.print(_channel_table(recording, inspection, verbose))
    console.print(
        f"At rest {100 * found.rest_share:.0f} % of the time, moving {100 * found.motion_share:.0f} %: "
        f"{found.quiet_stretches} rests of a second or more in {found.poses} distinct poses, the longest "
        f"{found.longest_rest:.1f} s"
    )
    if found.temperature_range is not None:
        low, high = found.temperature_range
        console.print(f"Temperature {low:.1f} to {high:.1f} °C")
    console.print()
    for remark in recording.remarks:
        console.print(f"[dim]{remark.kind}[/] {_plain(remark.text)}")
    if verbose:
        for gap in found.gaps:
            console.print(
                f"[dim]gap[/] after t = {gap.time:.6f} s: {gap.duration:.6f} s, {gap.samples} sample(s)"
            )


def _channel_table(recording: Recording, inspection: Inspection, verbose: bool) -> Table:
    """One row a triad, or a channel if `verbose`: unit, range, noise at rest, smallest step."""
    from rich import box
    from rich.table import Table

    found = inspection.findings
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("channel", "unit", "lowest", "highest", "noise at rest", "smallest step"):
        table.add_column(name, justify="left" if name in ("channel", "unit") else "right")
    streams = (
        ("specific force", "a", recording.specific_force, recording.specific_force_unit),
        ("angular rate", "g", recording.angular_rate, recording.angular_rate_unit),
    )
    for title, letter, triad, unit in streams:
        if triad is None:
            table.add_row(title, "absent", "", "", "", "")
            continue
        names = [letter + axis for axis in "xyz"]
        groups = [(n, [i]) for i, n in enumerate(names)] if verbose else [(title, [0, 1, 2])]
        for label, axes in groups:
            table.add_row(
                label,
                unit,
                f"{triad[:, axes].min():.5g}",
                f"{triad[:, axes].max():.5g}",
                f"{max(found.noise_floor[names[i]] for i in axes):.2g}",
                f"{min(found.quantisation[names[i]] for i in axes):.3g}",
            )
    return table
