"""De-noising a recording: what is done to each channel, and what it was worth, said beside the file."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

import tumble
from tumble.arrays import Series, Vectors
from tumble.counting import counted
from tumble.errors import OutputError, RecordingError, SegmentationError, UsageError
from tumble.recording import Recording, read_recording
from tumble.records import dataclass
from tumble.workflows.progress import silent

if TYPE_CHECKING:
    from tumble.noise.denoising.shrinkage import Shrinkage

FORMAT, VERSION = "tumble denoise", 1
WARNING = (
    "A filter does not know motion from noise: motion smaller than the noise of its band is lost "
    "with it. What is slower than the filter stays: bias instability, random walks of angle and "
    "bias. Do not calibrate with this file: means of holds stay as they were, and their scatter no "
    "longer shows how well they are known."
)

Method: TypeAlias = Literal["wavelet", "ar"]
Ranges: TypeAlias = list[tuple[int, int]]
# The inverse transform takes a time that doubles with each level.
_MOST_STATIONARY = 11
_BATCHES = 30  # of which the uncertainty of a scatter is taken


@dataclass(frozen=True, slots=True)
class ChannelOutcome:
    """What was done to a channel and what came of it, in the recording's unit.

    Attributes
    ----------
    name, unit : ax to gz.
    done : what was done, a phrase.
    before, after : standard deviation of a sample at rest about the mean of its rest; with `_sigma` its
        standard uncertainty.
    bandwidth : Hz, above which motion is lost, half the amplitude at it; None if nothing was done.
    smaller_than : peak of a sine that is lost, about `bandwidth` (first) and in the fastest octave (last);
        infinite where a filter takes all.
    delay : s, of a steady change; 0 of a filter that looks both ways.
    tau, allan_before, allan_after : s and Allan deviations at rest.
    settings : what chose it, as plain values.
    """

    name: str
    unit: str
    done: str
    before: float
    before_sigma: float
    after: float
    after_sigma: float
    bandwidth: float | None
    smaller_than: tuple[float, float]
    delay: float
    tau: Series
    allan_before: Series
    allan_after: Series
    settings: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Denoised:
    """The recording after de-noising, what was done by channel, sentences, and the files written."""

    recording: Recording
    channels: tuple[ChannelOutcome, ...]
    remarks: tuple[str, ...]
    document: dict[str, Any]
    files: tuple[Path, ...] = ()


@dataclass(frozen=True, slots=True)
class _Stretches:
    """Rest, motion, and the pieces between gaps, as half-open ranges."""

    rest: Ranges
    motion: Ranges
    whole: Ranges


def denoise(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    output: str | os.PathLike[str] | None = None,
    method: str = "wavelet",
    level: int | None = None,
    order: int | None = None,
    shrinkage: Shrinkage | None = None,
    filter_motion: bool = False,
    columns: str | None = None,
    units: str | Sequence[str] | None = None,
    rate: float | str | None = None,
    topics: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Denoised:
    """De-noise a recording and write it with a statement of what was done; nothing is written over.

    Parameters
    ----------
    paths, columns, units, rate, topics : as for `tumble.recording.read_recording`.
    output : ``.csv`` or ``.parquet``; the statement stands beside with ``.denoise.json``. By default the
        recording's name with ``-denoised.csv``.
    method : "wavelet", or "ar": an autoregression of the noise at rest and a filter of the level through it.
    level : of decomposition, for all channels; None lets each channel choose.
    order : of the autoregression; None lets BIC choose.
    shrinkage : thresholds of the wavelet method.
    filter_motion : whether samples in motion are de-noised too (wavelets alone can).
    progress : called with a sentence on what is being done.

    Raises
    ------
    RecordingError
        If a file cannot be read as a recording, or never rests.
    UsageError
        If an option is malformed or does not go with the method, or a file of that name is there already.
    OutputError
        If a file cannot be written; none is then left.
    """
    _check(method, level, order, shrinkage, filter_motion)
    target, statement = _targets(output, paths)
    say = progress or silent
    say("reading")
    recording = read_recording(paths, columns=columns, units=units, rate=rate, topics=topics)
    say("looking for rest")
    result = denoise_recording(
        recording,
        method=method,
        level=level,
        order=order,
        shrinkage=shrinkage,
        filter_motion=filter_motion,
        progress=say,
    )
    say("writing")
    _write(result, target, statement)
    return replace(result, files=(target, statement))


def denoise_recording(
    recording: Recording,
    *,
    method: str = "wavelet",
    level: int | None = None,
    order: int | None = None,
    shrinkage: Shrinkage | None = None,
    filter_motion: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Denoised:
    """De-noise a recording in memory; parameters as for `denoise`.

    Raises
    ------
    RecordingError
        If the recording never rests.
    UsageError
        If an option is malformed or does not go with the method.
    """
    from tumble.noise.denoising.shrinkage import Shrinkage
    from tumble.recording.doctor import channels_of

    _check(method, level, order, shrinkage, filter_motion)
    how = shrinkage or Shrinkage()
    recording = _lively(recording)
    stretches = _stretches(recording)
    outcomes: list[ChannelOutcome] = []
    signals: dict[str, Series] = {}
    channels = channels_of(recording)
    for name, values in counted(channels.items(), len(channels)):
        (progress or silent)(f"de-noising {name}")
        unit = recording.angular_rate_unit if name.startswith("g") else recording.specific_force_unit
        signals[name], outcome = _one_channel(
            (name, unit), values, recording.rate, stretches, method, level, order, how, filter_motion
        )
        outcomes.append(outcome)
    done = replace(
        recording,
        specific_force=_triad("a", signals, recording.specific_force),
        angular_rate=_triad("g", signals, recording.angular_rate),
    )
    remarks = _remarks(recording, stretches, filter_motion)
    document = _document(recording, outcomes, remarks, stretches, method, filter_motion)
    return Denoised(done, tuple(outcomes), remarks, document)


def _check(method: str, level: int | None, order: int | None, shrinkage: object, motion: bool) -> None:
    if method not in ("wavelet", "ar"):
        raise UsageError(f"--method {method}: give wavelet or ar.")
    if level is not None and not 1 <= level <= 30:
        raise UsageError(f"--level {level}: give the levels of decomposition, 1 or more.")
    if order is not None and not 0 <= order <= 100:
        raise UsageError(f"--order {order}: give the order of the autoregression, from 0 to 100.")
    if method == "ar" and (level is not None or shrinkage is not None):
        raise UsageError(
            "--level, --threshold, --shape, --wavelet and --no-stationary are of --method wavelet."
        )
    if method == "wavelet" and order is not None:
        raise UsageError("--order is of --method ar; the wavelet method has --level.")
    if method == "ar" and motion:
        raise UsageError(
            "--motion filter: an autoregression of the noise at rest knows no motion and would smear it by its delay; "
            "leave samples in motion as they are, or use --method wavelet."
        )


def _lively(recording: Recording) -> Recording:
    """Each value once where a logger wrote it several times, or there would be no noise between rows."""
    from tumble.noise.held import find_held, say_held, without_repeats
    from tumble.recording import Remark
    from tumble.recording.doctor import channels_of

    if all(
        float(np.nanmin(values)) == float(np.nanmax(values)) for values in channels_of(recording).values()
    ):
        raise RecordingError("No channel ever changes: dead sensors, or columns that are no signals.")
    held = find_held(recording)
    if held is None:
        return recording
    once = without_repeats(recording, held) or recording
    return replace(once, remarks=(*once.remarks, Remark("mended", say_held(held))))


def _stretches(recording: Recording) -> _Stretches:
    """Rests and motion between the gaps."""
    from tumble.noise.deviation import find_pieces
    from tumble.recording.doctor import channels_of
    from tumble.segmentation import find_timeline

    table = np.column_stack(list(channels_of(recording).values()))
    whole = [(int(a), int(b)) for a, b in find_pieces(table, recording.gaps)]
    try:
        timeline = find_timeline(recording)
    except SegmentationError as error:
        raise RecordingError(
            f"No rest was found that would show the noise ({str(error).rstrip('.')}): record some ten "
            "seconds without touching the unit, and de-noise these together with the motion."
        ) from error
    held = [piece for hold in timeline.holds for piece in hold.stretches()]
    rest = [(max(a, c), min(b, d)) for a, b in held for c, d in whole if min(b, d) > max(a, c)]
    resting = np.zeros(len(recording) + 1, dtype=np.int8)
    for a, b in rest:
        resting[a:b] = 1
    motion: Ranges = []
    for a, b in whole:
        edges = np.flatnonzero(np.diff(np.concatenate([[1], resting[a:b], [1]])))
        motion += [(a + int(c), a + int(d)) for c, d in zip(edges[::2], edges[1::2], strict=True)]
    return _Stretches(rest, motion, whole)


def _one_channel(
    label: tuple[str, str],
    values: Series,
    rate: float,
    stretches: _Stretches,
    method: str,
    level: int | None,
    order: int | None,
    how: Shrinkage,
    filter_motion: bool,
) -> tuple[Series, ChannelOutcome]:
    """The channel after de-noising and what came of it."""
    values = np.ascontiguousarray(values, dtype=np.float64)
    done, bandwidth, smaller, delay = "nothing: it never changes at rest", None, (0.0, 0.0), 0.0
    signal, settings = values, dict[str, Any]()
    if any(np.ptp(values[a:b]) > 0.0 for a, b in stretches.rest):
        if method == "ar":
            signal, done, bandwidth, delay, settings = _followed(values, rate, stretches, order)
            smaller = (np.inf, np.inf)
        else:
            signal, done, bandwidth, smaller, settings = _shrunk(
                values, rate, stretches, level, how, filter_motion
            )
    before, after = (_scatter(each, stretches.rest) for each in (values, signal))
    tau, allan_before = _allan(values, rate, stretches.rest)
    _, allan_after = _allan(signal, rate, stretches.rest)
    return signal, ChannelOutcome(
        *label, done, *before, *after, bandwidth, smaller, delay, tau, allan_before, allan_after, settings
    )


def _shrunk(
    values: Series, rate: float, stretches: _Stretches, level: int | None, how: Shrinkage, filter_motion: bool
) -> tuple[Series, str, float | None, tuple[float, float], dict[str, Any]]:
    from tumble.noise.denoising.shrinkage import choose_level, denoise_signal, level_above, motion_bandwidth

    settings: dict[str, Any] = {
        "wavelet": how.wavelet,
        "stationary": how.stationary,
        "threshold": how.rule,
        "shape": how.shape,
    }
    chosen, reason = level, "as asked for"
    if chosen is None:
        found = choose_level(values, rate, stretches.rest, wavelet=how.wavelet)
        chosen, reason = found.level, found.reason
        settings["allan_minimum_s"] = found.allan_minimum
        if how.stationary and chosen > _MOST_STATIONARY:
            chosen, reason = (
                _MOST_STATIONARY,
                "the most that are taken by themselves; --no-stationary takes more",
            )
        band = motion_bandwidth(values, rate, stretches.motion, stretches.rest) if filter_motion else None
        if band is not None and level_above(band, rate) < chosen:
            chosen, reason = level_above(band, rate), f"99.9 % of the motion's power is below {band:.3g} Hz"
            settings["motion_bandwidth_hz"] = band
    pieces = stretches.whole if filter_motion else stretches.rest
    result = denoise_signal(values, pieces, stretches.rest, chosen, how)
    settings |= {"level": chosen, "reason": reason}
    if not chosen:
        return values, f"nothing: {reason}", None, (0.0, 0.0), settings
    # A sine's peak in the stationary transform, whose filters pass at most one.
    lost = result.threshold * 2.0 ** (-0.5 * np.arange(1, chosen + 1))
    settings |= {
        "noise_by_level": result.noise.tolist(),
        "threshold_by_level": [_finite(t) for t in result.threshold.tolist()],
        "share_kept_by_level": result.kept.tolist(),
    }
    done = f"{chosen} level(s) of {how.wavelet}, {how.rule}, {how.shape} ({reason})"
    return result.signal, done, rate / 2.0 ** (chosen + 1), (float(lost[-1]), float(lost[0])), settings


def _followed(
    values: Series, rate: float, stretches: _Stretches, order: int | None
) -> tuple[Series, str, float, float, dict[str, Any]]:
    from tumble.noise.denoising.autoregression import whiteness
    from tumble.noise.denoising.level_filter import fit_level_filter
    from tumble.noise.denoising.shrinkage import choose_level

    block = 1 << choose_level(values, rate, stretches.rest).level
    found = fit_level_filter(values, stretches.rest, block, order=order)
    noise = found.noise
    settings: dict[str, Any] = {
        "order": noise.order,
        "order_by": "BIC" if order is None else "as asked for",
        "coefficients": noise.coefficients.tolist(),
        "coefficient_sigmas": np.sqrt(np.diag(noise.covariance)).tolist(),
        "innovation_sd": float(np.sqrt(noise.innovation_variance)),
        "gain": found.gain,
    }
    longest = max(stretches.rest, key=lambda piece: piece[1] - piece[0])
    if longest[1] - longest[0] > noise.order + 40:
        settings["residuals_white_probability"] = whiteness(values, noise, pieces=[longest]).probability
    kind = ", nearly the mean of all so far" if found.gain * (longest[1] - longest[0]) < 3.0 else ""
    done = f"autoregression of order {noise.order} (Burg), level with gain {found.gain:.3g}{kind}"
    return (
        found.follow(values, stretches.rest),
        done,
        found.bandwidth() * rate,
        found.delay / rate,
        settings,
    )


def _scatter(values: Series, rest: Ranges) -> tuple[float, float]:
    """Standard deviation about each rest's mean, and its standard uncertainty from batches of squares."""
    squares = np.concatenate([(values[a:b] - values[a:b].mean()) ** 2 for a, b in rest])
    variance = float(squares.mean())
    size = max(squares.size // _BATCHES, 1)
    batches = squares[: size * (squares.size // size)].reshape(-1, size).mean(axis=1)
    sigma = float(batches.std(ddof=1) / np.sqrt(batches.size)) if batches.size > 1 else float("nan")
    deviation = float(np.sqrt(variance))
    return deviation, 0.5 * sigma / deviation if deviation > 0.0 else 0.0


def _allan(values: Series, rate: float, rest: Ranges) -> tuple[Series, Series]:
    from tumble.noise.deviation import allan_deviation

    masked = np.full(values.size, np.nan)
    for a, b in rest:
        masked[a:b] = values[a:b]
    if max(b - a for a, b in rest) < 2:
        return np.zeros(0), np.zeros(0)
    # Rests that touch, as at an excluded knock, are not one.
    curve = allan_deviation(masked, rate, gaps=[a for a, _ in rest if a > 0])
    return curve.tau, curve.deviation[:, 0]


def _triad(letter: str, signals: dict[str, Series], there: Vectors | None) -> Vectors | None:
    return None if there is None else np.column_stack([signals[letter + axis] for axis in "xyz"])


def _remarks(recording: Recording, stretches: _Stretches, filter_motion: bool) -> tuple[str, ...]:
    seconds = sum(b - a for a, b in stretches.rest) / recording.rate
    moving = sum(b - a for a, b in stretches.motion) / recording.rate
    said = [f"{r.kind}: {r.text}" for r in recording.remarks if r.kind in ("assumed", "mended")]
    said.append(f"The noise is known from {seconds:.4g} s at rest in {len(stretches.rest)} piece(s).")
    if moving:
        said.append(
            f"{moving:.4g} s in motion or doubtful are de-noised too."
            if filter_motion
            else f"{moving:.4g} s in motion or doubtful are left exactly as they were (--motion filter changes that)."
        )
    if recording.gaps:
        said.append(f"No filter reaches across the {len(recording.gaps)} gap(s).")
    return tuple(said)


def _document(
    recording: Recording,
    outcomes: list[ChannelOutcome],
    remarks: tuple[str, ...],
    stretches: _Stretches,
    method: str,
    filter_motion: bool,
) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "software": f"tumble {tumble.__version__}",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "recordings": [{"name": s.name, "sha256": s.sha256} for s in recording.sources],
        "rate_hz": recording.rate,
        "method": method,
        "motion": "filter" if filter_motion else "keep",
        "warning": WARNING,
        "remarks": list(remarks),
        "rest": [list(piece) for piece in stretches.rest],
        "channels": {each.name: _channel(each) for each in outcomes},
    }


def _channel(each: ChannelOutcome) -> dict[str, Any]:
    return {
        "unit": each.unit or "counts",
        "done": each.done,
        "scatter_at_rest": {
            "before": each.before,
            "before_standard_uncertainty": _finite(each.before_sigma),
            "after": each.after,
            "after_standard_uncertainty": _finite(each.after_sigma),
        },
        "bandwidth_hz": each.bandwidth,
        "sines_lost_below": [_finite(v) for v in each.smaller_than],
        "delay_s": each.delay,
        "allan_deviation": {
            "tau_s": each.tau.tolist(),
            "before": each.allan_before.tolist(),
            "after": each.allan_after.tolist(),
        },
        "settings": each.settings,
    }


def _finite(value: float) -> float | None:
    """The number, or None where there is none, as JSON wants it."""
    return float(value) if np.isfinite(value) else None


def _targets(
    output: str | os.PathLike[str] | None, paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]
) -> tuple[Path, Path]:
    """The file and its statement, neither of which is there."""
    from tumble.recording.formats.output import ENDINGS

    named = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    target = Path(output) if output is not None else Path(f"{Path(named[0]).stem}-denoised.csv")
    if target.is_dir():
        raise UsageError(f"-o {target} is a folder: give a file, .csv or .parquet.")
    if target.suffix.lower() not in ENDINGS:
        raise UsageError(f"-o {target.name}: recordings are written as .csv or .parquet.")
    if not target.parent.is_dir():
        raise OutputError(f"{target} could not be written: the folder {target.parent} does not exist.")
    statement = target.with_suffix(".denoise.json")
    for file in (target, statement):
        if file.exists() or file.is_symlink():
            raise UsageError(f"{file} is there already, and is not written over: give another file with -o.")
    return target, statement


def _write(result: Denoised, target: Path, statement: Path) -> None:
    from tumble.files import uninterrupted, write_text
    from tumble.recording import write_recording

    text = json.dumps(result.document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_text(statement, text)
    try:
        write_recording(result.recording, target)
    except BaseException:
        with uninterrupted():
            statement.unlink(missing_ok=True)
        raise
