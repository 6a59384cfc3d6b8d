"""`tumble inspect`: what a recording holds and what it is good for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tumble.cli.groups import PRINTED
from tumble.cli.options import PrintOptions
from tumble.cli.terminal import console, plain, progress, say, say_json, table
from tumble.records import dataclass
from tumble.workflows import InspectRequest, option

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from tumble.recording import Recording
    from tumble.workflows import Inspection


@dataclass(frozen=True)
class InspectPrintOptions(PrintOptions):
    """How findings are printed.

    Attributes
    ----------
    quiet : Print warnings only.
    verbose : Print every gap and every channel.
    """

    quiet: bool = option(PRINTED, "", "--quiet", "-q", default=False)
    verbose: bool = option(PRINTED, "", "--verbose", "-v", default=False)


def inspect_command(asked: InspectRequest, printed: InspectPrintOptions) -> None:
    """Say what a recording holds: streams, units, rate, gaps, rest and motion, and what it is good for."""
    from tumble.workflows import inspect

    with progress(printed.silent) as tell:
        tell("reading")
        inspection = inspect(**vars(asked))
    if printed.as_json:
        say_json(inspection.to_dict(), indent=2)
        return
    screen = console(soft_wrap=True)
    if not printed.quiet:
        _print_facts(screen, inspection, printed.verbose)
    for warning in inspection.findings.warnings:
        screen.print(_led("! ", "bold yellow", warning))
    if printed.quiet:
        return
    for title, colour, sentences in (
        ("Good for", "green", inspection.findings.good_for),
        ("Missing", "cyan", inspection.findings.missing),
    ):
        if sentences:
            screen.print(f"\n{title}", style="bold")
        for sentence in sentences:
            screen.print(_led("  • ", colour, sentence))
    if inspection.saved is not None:
        say(f"\nSaved as {inspection.saved}")


def _led(mark: str, style: str, words: str) -> object:
    """Words behind a coloured mark."""
    from rich.text import Text

    return Text.assemble((mark, style), plain(words))


def shares(resting: float, moving: float) -> tuple[int, int, int]:
    """Return whole percents of rest, of motion, and of neither; they add up to 100.

    Parameters
    ----------
    resting, moving : shares of the time, together at most one.
    """
    first = round(100 * resting)
    second = min(round(100 * moving), 100 - first)
    return first, second, 100 - first - second


def _print_facts(screen: Console, inspection: Inspection, verbose: bool) -> None:
    recording, found = inspection.recording, inspection.findings
    screen.print(" + ".join(s.name for s in recording.sources), style="bold")
    minutes, seconds = divmod(found.duration, 60.0)
    length = f"{found.duration:.2f} s" if minutes < 2 else f"{minutes:.0f} min {seconds:.1f} s"
    gaps = f"{len(found.gaps)} gap(s)" if found.gaps else "no gaps"
    jitter = f"jitter {100 * found.jitter:.1f} % of a step"
    screen.print(f"{found.samples} samples in {length}, {found.rate:.6g} Hz, {jitter}, {gaps}")
    screen.print(_channel_table(recording, inspection, verbose))
    resting, moving, neither = shares(found.rest_share, found.motion_share)
    unclear = f", too short or too unsteady to say {neither} %" if neither else ""
    screen.print(
        f"At rest {resting} % of the time, moving {moving} %{unclear}: "
        f"{found.quiet_stretches} rests of a second or more in {found.poses} distinct poses, the longest "
        f"{found.longest_rest:.1f} s"
    )
    if found.magnetic_field is not None:
        from tumble.recording import say_field

        screen.print(say_field(found.magnetic_field))
    if found.temperature_range is not None:
        low, high = found.temperature_range
        screen.print(f"Temperature {low:.1f} to {high:.1f} °C")
    screen.print()
    for remark in recording.remarks:
        screen.print(_led(f"{remark.kind} ", "dim", remark.text))
    for gap in found.gaps if verbose else ():
        words = f"after t = {gap.time:.6f} s: {gap.duration:.6f} s, {gap.samples} sample(s)"
        screen.print(_led("gap ", "dim", words))


def _channel_table(recording: Recording, inspection: Inspection, verbose: bool) -> Table:
    """One row a triad, or a channel if `verbose`: unit, range, noise at rest, smallest step."""
    found, field, rows = inspection.findings, recording.magnetic_field, list[list[str]]()
    streams: list[tuple[str, str, Any, str, Any]] = [
        ("specific force", "a", recording.specific_force, recording.specific_force_unit, found),
        ("angular rate", "g", recording.angular_rate, recording.angular_rate_unit, found),
    ]
    if field is not None:
        streams.append(("magnetic field", "m", field.values, field.unit, found.magnetic_field))
    for title, letter, triad, unit, facts in streams:
        if triad is None:
            rows.append([title, "absent", "", "", "", ""])
            continue
        names = [letter + axis for axis in "xyz"]
        for label, axes in [(n, [i]) for i, n in enumerate(names)] if verbose else [(title, [0, 1, 2])]:
            values = (
                f"{triad[:, axes].min():.5g}",
                f"{triad[:, axes].max():.5g}",
                f"{max(facts.noise_floor[names[i]] for i in axes):.2g}",
                f"{min(facts.quantisation[names[i]] for i in axes):.3g}",
            )
            rows.append([label, unit, *values])
    heads = ("channel", "unit", "lowest", "highest", "noise at rest", "smallest step")
    return table(heads, rows, right=range(2, 6), box="SIMPLE_HEAD")
