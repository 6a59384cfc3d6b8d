"""The models that `tumble noise` wrote, read for a calibration of the same unit."""

from __future__ import annotations

import os
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from tumble.errors import UsageError
from tumble.files import number_of, read_json, reading
from tumble.noise.terms import GaussMarkov, Line, NoiseModel
from tumble.noise.variances import LETTERS
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.units import angular_rate_factor, specific_force_factor

if TYPE_CHECKING:
    from tumble.calibration.session import Session
    from tumble.segmentation import HoldMeans

# Sampling rates that differ by more are not the same setting of a sensor.
_SAME_RATE = 0.02


@dataclass(frozen=True, slots=True)
class NoiseModels:
    """Models of a unit's channels.

    Attributes
    ----------
    source : the file's name.
    rate : Hz that the noise was recorded at, rows that repeat a value counted.
    channels : by name, ax to gz: the unit ("m/s²", "rad/s" or "counts") and the model in it.
    """

    source: str
    rate: float
    channels: dict[str, tuple[str, NoiseModel]]


def read_noise_models(path: str | os.PathLike[str]) -> NoiseModels:
    """Read the models of every channel from a document that `tumble noise` wrote.

    Parameters
    ----------
    path : noise.json.

    Raises
    ------
    UsageError
        If it cannot be read, is another kind of file, or has a channel without a model.
    """
    place = Path(path)
    how = "give the noise.json that `tumble noise RECORDING -o DIR` wrote for this unit"
    with reading(place, "a noise file", hint=how):
        document: Any = read_json(place)
    if not isinstance(document, dict) or cast("dict[str, Any]", document).get("format") != "tumble noise":
        raise UsageError(f"--noise {place} is no noise document: {how}.")
    try:
        content = cast("dict[str, Any]", document)
        rate = number_of(content.get("recorded_rate_hz") or content["rate_hz"])
        channels = {
            str(name): (str(channel["unit"]), _model(channel))
            for name, channel in content["channels"].items()
        }
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UsageError(
            f"--noise {place} is a noise document that lacks what one has ({error}): {how}."
        ) from error
    empty = [name for name, (_, model) in channels.items() if model == NoiseModel()]
    if empty:
        raise UsageError(
            f"--noise {place} has no model of {', '.join(empty)}: the noise was recorded for too short a time. "
            "Record longer at rest, or leave the option out."
        )
    return NoiseModels(str(place), rate, channels)


def _model(channel: dict[str, Any]) -> NoiseModel:
    """The model of one channel in its unit."""
    values = {str(name): number_of(term["value"]) for name, term in channel["terms"].items()}
    # Short processes are in the N that a filter takes; as states they would be of no use.
    whole: dict[str, Any] = channel.get("random_walk") or {}
    white = [number_of(time) for time in whole.get("correlation_times_s", ())]
    if white:
        values["N"] = number_of(whole["value"])
    processes = [
        GaussMarkov(values[f"sigma{mark}"], values[f"correlation time{mark}"])
        for mark in ("", " 2", " 3")
        if f"sigma{mark}" in values and values[f"correlation time{mark}"] not in white
    ]
    entries = cast("list[dict[str, Any]]", channel.get("lines") or [])
    lines = [_line(entry) for entry in entries]
    coefficients = {letter: values[letter] for letter in LETTERS if letter in values}
    return NoiseModel.from_coefficients(coefficients, tuple(processes), tuple(lines))


def _line(entry: dict[str, Any]) -> Line:
    return Line(number_of(entry["amplitude"]), number_of(entry["frequency_hz"]))


def triad_models(
    models: NoiseModels, letter: str, si: str, factor: float | None, unit: str
) -> list[NoiseModel]:
    """Return models of x, y and z in raw units.

    Parameters
    ----------
    models, letter : as read, and that of the channels: a or g.
    si : unit of the triad's models that are not in counts.
    factor, unit : of the raw unit to SI, None for counts; and its name.

    Raises
    ------
    UsageError
        If a channel is missing, or in another kind of unit.
    """
    found: list[NoiseModel] = []
    for name in (f"{letter}{axis}" for axis in "xyz"):
        if name not in models.channels:
            raise UsageError(
                f"--noise {models.source} has no channel {name}: record the noise of the whole unit."
            )
        given, model = models.channels[name]
        expected = "counts" if factor is None else si
        if given != expected:
            raise UsageError(
                f"--noise {models.source} has {name} in {given}, and {unit} is wanted: read both with the same --units."
            )
        found.append(model if factor is None else model.scaled(1.0 / factor))
    return found


@dataclass(slots=True)
class NoiseOfHolds:
    """Models in a recording's raw units, and what was said when they were used."""

    source: str
    force: list[NoiseModel] | None
    rate: list[NoiseModel] | None
    remarks: list[str] = field(default_factory=list[str])

    @classmethod
    def read(cls, path: str | os.PathLike[str], recording: Recording) -> NoiseOfHolds:
        """Read the models of a recording's channels, three for each triad that it has.

        Parameters
        ----------
        path, recording : of `noise.json`, and to be calibrated.

        Raises
        ------
        UsageError
            If it is no such file, or rate, units or channels are not the recording's.
        """
        models = read_noise_models(path)
        if abs(recording.rate / models.rate - 1.0) > _SAME_RATE:
            raise UsageError(
                f"--noise {models.source} was recorded at {models.rate:g} Hz and this one at {recording.rate:.4g} Hz: "
                "a sensor filters otherwise at another rate. Record the noise at the rate of the calibration."
            )
        si = {"a": ("m/s²", specific_force_factor), "g": ("rad/s", angular_rate_factor)}
        found = {
            triad.letter: triad_models(
                models, triad.letter, si[triad.letter][0], si[triad.letter][1](triad.unit), triad.unit
            )
            for triad in recording.triads
        }
        return cls(os.fspath(path), found.get("a"), found.get("g"))

    def means_of(self, session: Session) -> HoldMeans:
        """Return a session's means with the models' covariances.

        Parameters
        ----------
        session : with its holds.
        """
        from tumble.segmentation.modelled_means import model_means

        given = session.recording, session.timeline, session.means
        means, remarks = model_means(*given, self.force, self.rate)
        self.remarks += remarks
        return means

    def said(self) -> list[str]:
        """Return what a user is told."""
        said = (
            f"How well the means of holds are known comes from the noise models in {self.source}; that neighbouring "
            "holds are off together is counted in the uncertainties."
        )
        return [said, *self.remarks]
