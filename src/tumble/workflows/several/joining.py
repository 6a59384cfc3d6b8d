"""The recordings that were named, as one: several of one unit are put one after the other, with a pause between."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.errors import ConvergenceError, ObservabilityError, UsageError
from tumble.parameters.family import parameter_of
from tumble.recording import MagneticField, Recording, Remark, read_recordings
from tumble.recording.formats.frames import Frame
from tumble.recording.reading import Paths, recording_inputs
from tumble.recording.samples import joined_fields
from tumble.workflows.corrected.corrections import corrections_of
from tumble.workflows.given.protocols import GivenProtocol, Span
from tumble.workflows.request import CalibrateRequest

if TYPE_CHECKING:
    from tumble.calibration.session import Session
    from tumble.protocol import Protocol
    from tumble.segmentation import Hold, HoldMeans, Rejection, Timeline, Turn

# Between recordings of separate poses: long enough that no hold and no turn goes across.
PAUSE = 10.0

NamedSpan = tuple[str, Span]

# Holds of a file from which on their scatter, or what they tell of the accelerometers by themselves, is compared.
FEWEST_SCATTERED, FEWEST_ALONE = 4, 12
# Files of one unit that was switched on once differ by no more: in the scatter of the holds of a file, and in standard
# uncertainties (repeated calibrations of real units differ by twice as many as they should).
LARGEST_BIAS_STEP, LARGEST_DIFFERENCE = 6.0, 8.0


def read_as_told(
    request: CalibrateRequest, given: GivenProtocol | None
) -> tuple[Recording, Protocol | None, list[NamedSpan]]:
    """Read the recordings named, or the protocol's own; options go before what the protocol says.

    Returns the recordings as one, the protocol on its clock, and where on it each recording is.

    Parameters
    ----------
    request, given : what was asked for, and the protocol that was given, if one was.

    Raises
    ------
    UsageError
        If nothing is named, or the recordings are not of one unit with the same columns.
    """
    how = request.how()
    if isinstance(request.paths, Recording):
        recordings = [request.paths]
    else:
        named = _files_of(request.paths, given)
        if not named:
            raise UsageError(
                f"The protocol {given.protocol.name} names no recordings: give them, or list them in its file."
                if given is not None
                else "Name a recording, or a protocol file that names its recordings (--protocol FILE): "
                "see `tumble calibrate --help`."
            )
        if given is not None:
            how |= {key: how[key] or getattr(given.protocol, key) for key in ("columns", "units", "rate")}
        recordings = read_recordings(named, **how)
    recording, spans = join_recordings(recordings)
    told = None if given is None else given.on_clock_of(recordings, spans)
    return recording, told, named_spans(recordings, spans)


def _files_of(paths: Paths | Recording, given: GivenProtocol | None) -> Sequence[Path | Frame]:
    """What was named, or the protocol's own files; nothing of a recording that was read before."""
    if isinstance(paths, Recording) or (isinstance(paths, list | tuple) and not paths):
        return [] if given is None else given.files()
    return recording_inputs(paths)


def corrected_by_before(request: CalibrateRequest, given: GivenProtocol | None) -> list[str]:
    """Return the identities of the calibrations that all recordings were corrected by before.

    Parameters
    ----------
    request, given : what was asked for, and the protocol that was given, if one was.

    Raises
    ------
    UsageError
        If they were not all corrected by the same.
    """
    marks = {corrections_of([one], request.topics) for one in _files_of(request.paths, given)}
    if len(marks) > 1:
        words = "; ".join(", ".join(mark) or "none" for mark in sorted(marks))
        raise UsageError(
            f"The recordings were corrected by different calibrations ({words}): take all of them raw, or all "
            "corrected by the same."
        )
    return list(marks.pop()) if marks else []


def join_recordings(recordings: list[Recording]) -> tuple[Recording, list[Span]]:
    """Return one recording, and where each of the several lies on its clock, in seconds.

    Parameters
    ----------
    recordings : of one unit, in order; a single one stays as it is.

    Raises
    ------
    UsageError
        If they differ in units or sensors, or one is given twice.
    """
    if len(recordings) == 1:
        only = recordings[0]
        return only, [(float(only.time[0]), float(only.time[-1]))]
    _require_different(recordings)
    _require_same_columns(recordings)
    return _concatenated(recordings)


def require_one_unit(recordings: list[Recording]) -> None:
    """Refuse recordings that cannot be of one unit with the same columns, and one that is given twice.

    Parameters
    ----------
    recordings : to be calibrated together.

    Raises
    ------
    UsageError
        If they differ in units or sensors, or one is given twice, under another name too.
    """
    _require_different(recordings)
    for earlier, recording in itertools.combinations(recordings, 2):
        if _same_samples(recording, earlier):
            raise UsageError(
                f"{recording.sources[0].name} and {earlier.sources[0].name} hold the same "
                "samples: the same recording adds nothing a second time."
            )
    _require_same_columns(recordings)


def _same_samples(one: Recording, other: Recording) -> bool:
    """Whether two files hold the same samples, stamps aside."""
    pairs = ((one.specific_force, other.specific_force), (one.angular_rate, other.angular_rate))
    return all(
        (a is None and b is None) or (a is not None and b is not None and np.array_equal(a, b))
        for a, b in pairs
    )


def named_spans(recordings: Sequence[Recording], spans: Sequence[Span]) -> list[NamedSpan]:
    """Return by what name each recording goes, and where it lies on the joined one's clock.

    Parameters
    ----------
    recordings, spans : as given to `join_recordings`, and from there.
    """
    known = [(one.sources[0].name, span) for one, span in zip(recordings, spans, strict=True) if one.sources]
    return [*zip(labels_of([name for name, _ in known]), (span for _, span in known), strict=True)]


def labels_of(names: Sequence[str]) -> list[str]:
    """Return the shortest names that tell recordings apart: file names, with folders before them, or with numbers.

    A folder's ``protocol.yaml`` goes by the folder's name.

    Parameters
    ----------
    names : of the recordings in order, as paths or as file names alone.
    """
    paths = [Path(name) for name in names]
    parts = [p.parent.parts if p.name == "protocol.yaml" and p.parent.name else p.parts for p in paths]
    for length in range(1, max((len(own) for own in parts), default=0) + 1):
        short = ["/".join(own[-length:]) for own in parts]
        if len(set(short)) == len(short):
            return short
    return [f"{name} ({number})" for number, name in enumerate(names, 1)]


def check_files(session: Session, files: Sequence[NamedSpan]) -> list[str]:
    """Refuse files that are not of one unit switched on once; return what speaks against those without a hold.

    Parameters
    ----------
    session : of recordings that were joined, without a protocol that says what each of them is.
    files : where each of them is.

    Raises
    ------
    UsageError
        If two files with many holds have other gyro biases, or other accelerometers.
    """
    if len(files) < 2:
        return []
    time = session.means.time
    named = [(name, np.flatnonzero((time >= start) & (time <= stop))) for name, (start, stop) in files]
    for (one, its), (other, others) in itertools.combinations(named, 2):
        difference = _rate_difference(session, its, others) or _force_difference(session, its, others)
        if difference:
            raise UsageError(
                f"{one} and {other} are not of one unit that was switched on once: {difference}. Give --turn-ons if it "
                "is the same unit, switched on anew; else calibrate each by itself."
            )
    return [
        f"{name} gives no hold, and the result is of the other files alone: look at it with tumble inspect. Recordings "
        "of different units are calibrated each by itself."
        for name, holds in named
        if not holds.size
    ]


def _rate_difference(session: Session, *holds: np.ndarray) -> str:
    """By how much the gyros at rest differ between two files, if far beyond what holds of a file do."""
    rates = session.means.angular_rate
    if rates is None or min(own.size for own in holds) < FEWEST_SCATTERED:
        return ""
    one, other = (rates[own] for own in holds)
    scatter = np.sqrt(0.5 * (one.var(axis=0, ddof=1) + other.var(axis=0, ddof=1)))
    step = np.abs(np.median(one, axis=0) - np.median(other, axis=0))
    if not np.any(step > LARGEST_BIAS_STEP * scatter):
        return ""
    axis = int(np.argmax(step - LARGEST_BIAS_STEP * scatter))
    return (
        f"at rest gyro {'xyz'[axis]} differs by {step[axis]:.2g} {session.recording.angular_rate_unit} between them, "
        f"and within a file by {scatter[axis]:.2g}"
    )


def _force_difference(session: Session, *holds: np.ndarray) -> str:
    """By how much the accelerometers differ that the holds of each of two files tell by themselves."""
    if session.means.specific_force is None or min(own.size for own in holds) < FEWEST_ALONE:
        return ""
    from tumble.calibration.joint import calibrate_accelerometers

    try:
        one, other = (
            calibrate_accelerometers(session, _means_of(session.means, own), own.tolist()) for own in holds
        )
    except (ObservabilityError, ConvergenceError):
        return ""
    others = {parameter.name: parameter for parameter in other.parameters}
    for own in one.parameters:
        its = others.get(own.name)
        if its is None or parameter_of(own.name).family.triad != "accelerometer":
            continue
        sigma = np.hypot(own.standard_uncertainty, its.standard_uncertainty)
        if abs(own.value - its.value) > LARGEST_DIFFERENCE * sigma:
            return (
                f"by themselves they have {own.name} {own.value:.4g} and {its.value:.4g} {own.unit}, "
                f"{abs(own.value - its.value) / sigma:.0f} standard uncertainties apart"
            )
    return ""


def _means_of(means: HoldMeans, holds: np.ndarray) -> HoldMeans:
    """Some of the holds."""
    parts = {f.name: getattr(means, f.name) for f in fields(means)}
    own = {
        name: None if value is None else value[holds]
        for name, value in parts.items()
        if name not in ("modelled", "parts")
    }
    return replace(means, **own, parts=None)


def join_timelines(
    recording: Recording, timelines: Sequence[Timeline], means: Sequence[HoldMeans], starts: Sequence[int]
) -> tuple[Timeline, HoldMeans]:
    """Return holds, turns and means of several recordings as those of the joined one.

    Parameters
    ----------
    recording : the joined one.
    timelines, means : of each recording by itself.
    starts : index of each one's first sample in the joined recording.
    """
    from tumble.segmentation import Timeline

    holds: list[Hold] = []
    turns: list[Turn] = []
    rejections: list[Rejection] = []
    for timeline, start in zip(timelines, starts, strict=True):
        turns += [
            replace(
                t,
                before=t.before + len(holds),
                after=t.after + len(holds),
                start=t.start + start,
                stop=t.stop + start,
            )
            for t in timeline.turns
        ]
        rejections += [replace(r, start=r.start + start, stop=r.stop + start) for r in timeline.rejections]
        holds += [
            replace(
                h,
                start=h.start + start,
                stop=h.stop + start,
                excluded=tuple((a + start, b + start) for a, b in h.excluded),
            )
            for h in timeline.holds
        ]
    whole = Timeline(tuple(holds), tuple(turns), tuple(rejections), timelines[0].noise_floor)
    return whole, _joined_means(recording, whole, means)


def _joined_means(recording: Recording, timeline: Timeline, means: Sequence[HoldMeans]) -> HoldMeans:
    from tumble.segmentation.rest_wander import observe_parts

    def every(name: str) -> Any:
        parts = [getattr(own, name) for own in means]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    middle = [0.5 * (recording.time[h.start] + recording.time[h.stop - 1]) for h in timeline.holds]
    names = [f.name for f in fields(means[0]) if f.name not in ("time", "parts", "modelled")]
    return replace(
        means[0],
        **{name: every(name) for name in names},
        time=np.array(middle),
        parts=observe_parts(recording, timeline),
    )


def _require_different(recordings: list[Recording]) -> None:
    seen: dict[str, str] = {}
    sources = [source for recording in recordings for source in recording.sources]
    for source, name in zip(sources, labels_of([source.name for source in sources]), strict=True):
        if source.sha256 in seen:
            raise UsageError(
                f"{name} and {seen[source.sha256]} are the same recording: it adds nothing a second time."
            )
        seen[source.sha256] = name


def _require_same_columns(recordings: list[Recording]) -> None:
    first = recordings[0]
    for other in recordings[1:]:
        same = (
            other.specific_force_unit == first.specific_force_unit
            and other.angular_rate_unit == first.angular_rate_unit
            and (other.specific_force is None) == (first.specific_force is None)
            and (other.angular_rate is None) == (first.angular_rate is None)
        )
        if not same:
            raise UsageError(
                f"{other.sources[0].name} has other units or sensors than {first.sources[0].name}: "
                "only recordings of one unit with the same columns can be calibrated together."
            )


def _concatenated(recordings: list[Recording]) -> tuple[Recording, list[Span]]:
    times: list[np.ndarray] = []
    magnetic: list[MagneticField | None] = []
    gaps: list[int] = []
    spans: list[Span] = []
    end, samples = 0.0, 0
    for number, recording in enumerate(recordings):
        moved = recording.time - recording.time[0] + (end + PAUSE if number else 0.0)
        gaps += [samples + gap for gap in recording.gaps] + ([samples] if number else [])
        times.append(moved)
        field = recording.magnetic_field
        magnetic.append(
            None if field is None else replace(field, time=field.time + float(moved[0] - recording.time[0]))
        )
        end, samples = float(moved[-1]), samples + len(recording)
        spans.append((float(moved[0]), end))

    def joined(name: str) -> np.ndarray | None:
        parts = [getattr(recording, name) for recording in recordings]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    first = recordings[0]
    remarks = [remark for recording in recordings for remark in recording.remarks]
    remarks.append(Remark("found", f"{len(recordings)} recordings are taken together as one unit's."))
    whole = Recording(
        time=np.concatenate(times),
        specific_force=joined("specific_force"),
        angular_rate=joined("angular_rate"),
        specific_force_unit=first.specific_force_unit,
        angular_rate_unit=first.angular_rate_unit,
        rate=first.rate,
        temperature=joined("temperature"),
        sources=tuple(source for recording in recordings for source in recording.sources),
        remarks=tuple(dict.fromkeys(remarks)),
        gaps=tuple(sorted(gaps)),
        temperature_unit=first.temperature_unit,
        said_clock=max((recording.clock for recording in recordings), key=lambda clock: clock.sigma),
        magnetic_field=joined_fields(magnetic),
    )
    return whole, spans
