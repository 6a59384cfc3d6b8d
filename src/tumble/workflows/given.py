"""What a user gives beside the recording: its site, its protocol, a data sheet, noise models."""

from __future__ import annotations

import difflib
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tumble.calibration import FleetSheet, StableKnowledge, TriadFleet, stable_knowledge
from tumble.document import PLACES, Calibration, entry_names, read_calibration, stacked
from tumble.earth import Site
from tumble.errors import SiteError, UsageError
from tumble.files import read_json
from tumble.fleet import PROCEDURE
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.simulation import GRADES, Grade, find_grade

if TYPE_CHECKING:
    from tumble.protocol import Protocol, Step


def choose_site(site: str | None, gravity: str | None) -> Site | None:
    """Return the site for ``--site LATITUDE[,HEIGHT]`` (degrees, metres) or ``--gravity G[±U]`` (m/s²).

    None if neither is given.

    With both, gravity is the one given, unless latitude and height tell it better than its digits do; see
    `Site.with_gravity`. The latitude determines the Earth rate's direction.

    Raises
    ------
    UsageError
        If `site` is not one or two numbers.
    SiteError
        If the place or the gravity is none of the Earth's.
    """
    if site is None:
        return None if gravity is None else Site.from_gravity(gravity)
    try:
        numbers = [float(part) for part in site.split(",")]
    except ValueError:
        numbers = []
    if not 1 <= len(numbers) <= 2 or not all(math.isfinite(number) for number in numbers):
        raise UsageError(
            f"--site {site} is not LATITUDE[,HEIGHT] in degrees and metres, for example --site 48.1,520."
        )
    if abs(numbers[0]) > 90.0:
        raise SiteError(f"The latitude {numbers[0]:g} is beyond the poles: give degrees from -90 to 90.")
    place = Site.from_latitude(math.radians(numbers[0]), *numbers[1:])
    return place if gravity is None else place.with_gravity(Site.from_gravity(gravity))


def given_site(site: object) -> Site | None:
    """Return a site that a program gave, or None.

    Raises
    ------
    UsageError
        If it is something else, of which nobody knows whether it is in degrees or radians.
    SiteError
        If its gravity is not that of its latitude and height.
    """
    if site is None:
        return None
    if isinstance(site, Site):
        if site.latitude is not None:
            site.with_gravity(site)
        return site
    raise UsageError(
        f"site is a {type(site).__name__}: give a tumble.Site, as tumble.Site.from_latitude(math.radians(48.1), 520.0) "
        "with the latitude in rad and the height in m, or tumble.Site.from_gravity(9.81)."
    )


Span = tuple[float, float]


@dataclass(frozen=True)
class GivenProtocol:
    """A protocol and the folder that its files are relative to; None for a named one."""

    protocol: Protocol
    folder: Path | None

    def files(self) -> list[Path]:
        """Return the recordings that the protocol names, in order; steps' own files in theirs."""
        folder = self.folder or Path()
        return [folder / name for name in self.protocol.recordings or self._own_files()]

    def _own_files(self) -> list[str]:
        """The files that steps name, each once."""
        return list(dict.fromkeys(step.file for step in self.protocol.steps if step.file is not None))

    def predicted(self) -> dict[str, float]:
        """Return the standard uncertainties (SI) of the ``plan.json`` beside the protocol; empty without one."""
        if self.folder is None:
            return {}
        try:
            plan: Any = read_json(self.folder / "plan.json")
            if plan["format"] == "tumble plan of a protocol" and plan["protocol"] != self.protocol.name:
                return {}
            parameters: Any = plan.get("both_triads") or plan["parameters"]
            return {
                one["name"]: float(one["standard_uncertainty"])
                for one in parameters
                if one["standard_uncertainty"] and float(one["standard_uncertainty"]) > 0.0
            }
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return {}

    def on_clock_of(self, recordings: list[Recording], spans: list[Span]) -> Protocol:
        """Return the protocol with every step's own file or interval on the joined recording's clock.

        Parameters
        ----------
        recordings, spans : as they were joined.

        Raises
        ------
        UsageError
            If a step names a file that was not given.
        """
        if len(recordings) == 1 and all(step.file is None for step in self.protocol.steps):
            return self.protocol
        place = {
            source.name: (recording, span)
            for recording, span in zip(recordings, spans, strict=True)
            for source in recording.sources
        }
        own = self._own_files()
        if len(own) == len(recordings) and [Path(name).name for name in own] == [
            recording.sources[0].name for recording in recordings
        ]:
            # In their order, because files of two folders may share a name.
            place = dict(zip(own, zip(recordings, spans, strict=True), strict=True))
        steps = tuple(_placed(step, number, place) for number, step in enumerate(self.protocol.steps, 1))
        return replace(self.protocol, steps=steps)


def _placed(step: Step, number: int, place: dict[str, tuple[Recording, Span]]) -> Step:
    if step.file is None:
        return step
    name = step.file if step.file in place else Path(step.file).name
    if name not in place:
        raise UsageError(
            f"Step {number} of the protocol names the recording {step.file}, which is not among those given: "
            f"{', '.join(place)}. Give no recordings, and those of the protocol are read."
        )
    recording, (start, stop) = place[name]
    if step.interval is None:
        return replace(step, interval=(start, stop))
    shift = start - float(recording.time[0])
    return replace(step, interval=(step.interval[0] + shift, step.interval[1] + shift))


def read_given_protocol(given: str | os.PathLike[str]) -> GivenProtocol:
    """Return the protocol of a file, or the named one where there is no such file.

    Parameters
    ----------
    given : path of a protocol file, a folder that holds a ``protocol.yaml``, or a name.

    Raises
    ------
    ProtocolError
        If the file is not a protocol, or something in it is wrong; the message names the line.
    UsageError
        If there is neither such a file nor such a name.
    """
    from tumble.protocol import PROTOCOLS, named_protocol, read_protocol

    path = Path(given)
    if path.is_dir():
        path = path / "protocol.yaml"
    if path.exists():
        return GivenProtocol(read_protocol(path), path.parent)
    if str(given) in PROTOCOLS:
        return GivenProtocol(named_protocol(str(given)), None)
    raise UsageError(
        f"There is no protocol file {path}, and no protocol of that name: give a file, or one of "
        f"{', '.join(PROTOCOLS)}."
    )


REST_SECONDS = 600.0
"""What a unit at rest is recorded where nobody says how long."""


def read_played(protocol: str | os.PathLike[str], duration: float | None = None) -> Protocol:
    """Return the protocol that is to be played: a named one, a file's, or a unit that lies still.

    Parameters
    ----------
    protocol : a file, or a name; "rest" lies still for its noise.
    duration : s, of a rest; None takes ten minutes.

    Raises
    ------
    UsageError, ProtocolError
        If there is no such protocol, or a duration is given that is none or not a rest's.
    """
    from tumble.protocol import PROTOCOLS, REST, rest_protocol

    name = str(protocol)
    # A folder of that name is what an earlier simulation wrote, and no protocol.
    if name == REST and not Path(name).is_file():
        seconds = REST_SECONDS if duration is None else duration
        if not 1.0 <= seconds < math.inf:
            raise UsageError(f"--duration {seconds:g}: give at least one second.")
        return rest_protocol(seconds)
    if duration is not None:
        raise UsageError(
            f"--duration is for a unit at rest: `tumble simulate {REST} --duration {duration:g}`."
        )
    if name not in PROTOCOLS and not Path(name).exists() and Path(name).suffix not in (".yaml", ".yml"):
        near = difflib.get_close_matches(name.lower(), [*PROTOCOLS, REST], 1)
        meant = f" Did you mean {near[0]}?" if near else ""
        raise UsageError(
            f"There is no protocol {name!r}: give a protocol file, or one of {', '.join(PROTOCOLS)}, {REST}.{meant}"
        )
    return read_given_protocol(protocol).protocol


@dataclass(frozen=True)
class Known:
    """What is known before a recording: the angles of the unit itself, or the spreads of its kind."""

    angles: StableKnowledge | None = None
    sheet: Grade | FleetSheet | None = None


def known_beforehand(prior: str | os.PathLike[str], serial: str | None = None) -> Known:
    """Return what is known before a recording of the unit itself, or of its kind.

    Parameters
    ----------
    prior : a calibration.json of the unit, or the folder with it, whose accelerometer angles are kept; a file of
        `tumble registry fleet`; or the name of a grade.
    serial : of the unit, if it is known.

    Raises
    ------
    CalibrationFileError
        If the file cannot be read, or states no uncertainty of the angles.
    UsageError
        If there is no such grade, or the calibration is of another unit or states no accelerometer matrix.
    """
    text = os.fspath(prior)
    if text in GRADES or not (Path(text).exists() or text.endswith(".json")):
        return Known(sheet=find_grade(text))
    earlier = read_calibration(text)
    if earlier.procedure == PROCEDURE:
        return Known(sheet=FleetSheet(_triad(earlier, "accelerometer"), _triad(earlier, "gyroscope")))
    if serial is not None and earlier.imu.serial_number not in (None, serial):
        raise UsageError(
            f"{prior} is the calibration of unit {earlier.imu.serial_number}, and this is unit {serial}: "
            "a prior must be of the same unit."
        )
    wanted = [f"accelerometer.matrix[{i},{j}]" for i in range(3) for j in range(3)]
    if not {*wanted} <= {*earlier.covariance_parameters} or earlier.model.accelerometer is None:
        raise UsageError(
            f"{prior} states no accelerometer matrix with its covariance: it cannot serve as --prior."
        )
    place = PLACES["accelerometer.matrix"][0]
    return Known(stable_knowledge(earlier.model.accelerometer.matrix, stacked(earlier)[1][place, place]))


def find_sheet(name: str | os.PathLike[str]) -> Grade | FleetSheet:
    """Return a data sheet: a grade, or a file of `tumble registry fleet`.

    Parameters
    ----------
    name : of a grade, or the file.

    Raises
    ------
    UsageError
        If there is no such grade, or the file is a unit's calibration.
    CalibrationFileError
        If the file cannot be read.
    """
    sheet = known_beforehand(name).sheet
    if sheet is None:
        raise UsageError(
            f"{name} is a unit's calibration and no fleet's: `tumble registry fleet -o fleet.json` writes one."
        )
    return sheet


def _triad(document: Calibration, kind: str) -> TriadFleet | None:
    triad = getattr(document.model, kind)
    wanted = [name for name in entry_names() if name.startswith((f"{kind}.matrix", f"{kind}.bias"))]
    if triad is None or not {*wanted} <= {*document.covariance_parameters}:
        return None
    place = slice(PLACES[f"{kind}.matrix"][0].start, PLACES[f"{kind}.bias"][0].stop)
    units = document.raw_units
    unit = units.specific_force if kind == "accelerometer" else units.angular_rate
    return TriadFleet.of(unit, triad.matrix, triad.bias, stacked(document)[1][place, place])
