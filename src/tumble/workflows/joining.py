"""Several recordings of one unit as one: put one after the other, with a pause between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.errors import UsageError
from tumble.recording import Recording, Remark

if TYPE_CHECKING:
    from tumble.segmentation import Hold, HoldMeans, Rejection, Timeline, Turn

# Between recordings of separate poses: long enough that no hold and no turn goes across.
PAUSE = 10.0

Span = tuple[float, float]


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
    require_different_samples(recordings)
    _require_same_columns(recordings)


def require_different_samples(recordings: list[Recording]) -> None:
    """Refuse a recording that is given twice, under another name too.

    Parameters
    ----------
    recordings : to be calibrated together.

    Raises
    ------
    UsageError
        If two hold the same samples.
    """
    _require_different(recordings)
    for number, recording in enumerate(recordings):
        for earlier in recordings[:number]:
            if _same_samples(recording, earlier):
                raise UsageError(
                    f"{recording.sources[0].name} and {earlier.sources[0].name} hold the same samples: the same "
                    "recording tells nothing more a second time."
                )


def _same_samples(one: Recording, other: Recording) -> bool:
    """Whether two files hold the same samples, stamps aside."""
    pairs = ((one.specific_force, other.specific_force), (one.angular_rate, other.angular_rate))
    return all(
        (a is None and b is None) or (a is not None and b is not None and np.array_equal(a, b))
        for a, b in pairs
    )


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
    def every(name: str) -> Any:
        parts = [getattr(own, name) for own in means]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    middle = [0.5 * (recording.time[h.start] + recording.time[h.stop - 1]) for h in timeline.holds]
    names = [f.name for f in fields(means[0]) if not f.name.endswith("_between") and f.name != "time"]
    return replace(
        means[0],
        **{name: every(name) for name in names},
        time=np.array(middle),
        specific_force_between=None,
        angular_rate_between=None,
    )


def _require_different(recordings: list[Recording]) -> None:
    seen: dict[str, str] = {}
    for source in (source for recording in recordings for source in recording.sources):
        if source.sha256 in seen:
            raise UsageError(
                f"{source.name} and {seen[source.sha256]} are the same recording: it tells nothing more a second time."
            )
        seen[source.sha256] = source.name


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
    gaps: list[int] = []
    spans: list[Span] = []
    end, samples = 0.0, 0
    for number, recording in enumerate(recordings):
        moved = recording.time - recording.time[0] + (end + PAUSE if number else 0.0)
        gaps += [samples + gap for gap in recording.gaps] + ([samples] if number else [])
        times.append(moved)
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
    )
    return whole, spans
