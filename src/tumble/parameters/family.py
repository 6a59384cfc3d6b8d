"""Parameters of a calibration: what each is of, what it is called, and in which unit.

A name such as ``gyro bias x`` is made of its family's record here, and found by it again: nobody else takes a name
apart. Names and units are those of ``calibration.json``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import TypeVar

from tumble.parameters.measures import plain_unit
from tumble.records import dataclass

T = TypeVar("T")

ACCELEROMETER, GYRO, BETWEEN, OPTIONAL = "Accelerometer", "Gyro", "Between the triads", "Optional terms"
TEMPERATURE = "Changes with temperature"
MAGNETOMETER = "Magnetometer"
GROUPS = (ACCELEROMETER, GYRO, BETWEEN, OPTIONAL, TEMPERATURE, MAGNETOMETER)
"""Headings of tables, in their order."""
ANGLES = ("non-orthogonality", "misalignment", "rotation")
"""Kinds of parameters that are angles."""
_LEANS = tuple(a + b for a in "xyz" for b in "xyz" if a != b)


@dataclass(frozen=True)
class Family:
    """Parameters that differ by their axes alone: limits, fleets and figures take them together.

    Attributes
    ----------
    name : "gyro bias"; a parameter's is this one with its axes behind, unless `form` says otherwise.
    triad : "accelerometer", "gyro", "magnetometer"; empty between them.
    kind : "bias", "scale factor error", "scale factor" (of counts), an angle of `ANGLES`, and so on.
    group, words : the heading of tables that it stands under, and what it is called there.
    short : on a figure's axis.
    axes : of its parameters.
    unit : with ``{raw}`` for the triad's raw unit.
    form : a parameter's name, with ``{}`` for its axes.
    """

    name: str
    triad: str
    kind: str
    group: str
    words: str
    short: str
    axes: tuple[str, ...]
    unit: str
    form: str = ""

    def named(self, axes: str) -> str:
        """Return the name of the parameter of some axes."""
        return self.form.format(axes) if self.form else f"{self.name} {axes}".rstrip()

    def labels(self, raw: str = "", axes: tuple[str, ...] = ()) -> list[tuple[str, str]]:
        """Return names and units of its parameters.

        Parameters
        ----------
        raw : the triad's raw unit.
        axes : of those that are wanted, in their order; all where none is named.
        """
        unit = self.unit.format(raw=raw)
        return [(self.named(one), unit) for one in axes or self.axes]


@dataclass(frozen=True)
class Parameter:
    """One parameter: its name, its family, and its axes, such as "x", "yz" or "x to force y"; empty for none."""

    name: str
    family: Family
    axes: str

    @property
    def axis(self) -> int:
        """The number of its first axis: of the sensor that it belongs to."""
        return "xyz".index(self.axes[0])

    @property
    def label(self) -> str:
        """What it is called under its group's heading."""
        return f"{self.family.words} {self.axes.replace(' to force', ', force')}".rstrip()

    @property
    def short(self) -> str:
        """What it is called on a figure's axis."""
        return f"{self.family.short} {self.axes.replace(' to force ', '←')}".rstrip()

    @property
    def within_triad(self) -> str:
        """Its name without the triad in front."""
        return self.name.removeprefix(f"{self.family.triad} ")


# Kind, on a figure's axis, axes, unit; of accelerometers and of gyros.
_OF_TRIADS = (
    ("bias", "bias", tuple("xyz"), "{raw}"),
    ("scale factor error", "scale", tuple("xyz"), "1"),
    ("scale factor", "scale", tuple("xyz"), "{raw}/(%s)"),
    ("non-orthogonality", "angle", _LEANS, "rad"),
    ("misalignment", "misalignment", _LEANS, "rad"),
    ("asymmetry", "asymmetry", tuple("xyz"), "1"),
    ("quadratic", "quadratic", tuple("xyz"), "1/({raw})"),
)


def _of_triad(triad: str, group: str, brief: str, si: str) -> list[Family]:
    """Families that accelerometers and gyros have alike: asymmetries and quadratic terms are optional."""
    made: list[Family] = []
    for kind, short, axes, unit in _OF_TRIADS:
        name, optional = f"{triad} {kind}", kind in ("asymmetry", "quadratic")
        heading, words = (OPTIONAL, name) if optional else (group, kind)
        made.append(
            Family(name, triad, kind, heading, words, f"{brief} {short}", axes, unit.replace("%s", si))
        )
    return made


def _of_magnetometer(kind: str, short: str, axes: tuple[str, ...], unit: str, form: str = "") -> Family:
    name = form.removesuffix(" {}") or f"magnetometer {kind}"
    return Family(name, "magnetometer", kind, MAGNETOMETER, kind, short, axes, unit, form)


def _of_places(name: str, axes: tuple[str, ...]) -> Family:
    short = name.replace("accelerometer", "acc")
    return Family(name, "accelerometer", "lever arm", OPTIONAL, name, short, axes, "m")


_LAG = "lag of the accelerometer behind the gyro"
_FORCES = tuple(f"{a} to force {b}" for a in "xyz" for b in "xyz")
_SUMS = tuple(f"{pair}{sign}{pair[::-1]}" for pair in ("xy", "xz", "yz") for sign in "+-")
_TRIADS = "rotation between the triads"
FAMILIES = {
    family.name: family
    for family in (
        *_of_triad("accelerometer", ACCELEROMETER, "acc", "m/s²"),
        *_of_triad("gyro", GYRO, "gyro", "rad/s"),
        Family(_TRIADS, "", "rotation", BETWEEN, "rotation", "rotation", tuple("xyz"), "rad"),
        Family(
            *("gyro g-sensitivity", "gyro", "g-sensitivity", OPTIONAL, "g-sens. gyro", "g-sens."),
            *(_FORCES, "{raw}/(m/s²)", "g-sensitivity of gyro {}"),
        ),
        Family(_LAG, "", "lag", OPTIONAL, _LAG, "time lag", ("",), "s"),
        _of_places("accelerometer lever arm", tuple(a + b for a in "xyz" for b in "xyz")),
        _of_places("accelerometer lever arms", _SUMS),
        _of_magnetometer("bias", "magnetometer bias", tuple("xyz"), "{raw}"),
        _of_magnetometer("scale factor", "magnetometer scale", tuple("xyz"), "{raw}"),
        _of_magnetometer("soft iron", "magnetometer soft iron", ("yz", "xz", "xy"), "{raw}"),
        _of_magnetometer(
            *("rotation", "rotation of the magnetometer", tuple("xyz"), "rad"),
            form="rotation of the magnetometer {}",
        ),
    )
}
"""All families by name but those of coefficients of temperature, which differ by what the function is of."""
LAG = FAMILIES[_LAG]


def thermal_family(triad: str, words: str, unit: str = "") -> Family:
    """Return a family of coefficients of temperature.

    Parameters
    ----------
    triad : whose they are; empty for what is no triad's.
    words : what they are of, such as "bias by dT", without "thermal" and the triad.
    unit : of the coefficients.

    Examples
    --------
    >>> thermal_family("gyro", "bias by dT", "rad/s/K").labels(axes=("x",))
    [('thermal gyro bias by dT x', 'rad/s/K')]
    """
    said = f"{triad} {words}".lstrip()
    short = plain_unit(f"thermal {said}").replace("accelerometer", "acc")
    return Family(f"thermal {said}", triad, "thermal", TEMPERATURE, plain_unit(said), short, (), unit)


@cache
def _known() -> dict[str, Parameter]:
    return {
        family.named(axes): Parameter(family.named(axes), family, axes)
        for family in FAMILIES.values()
        for axes in family.axes
    }


def is_known(name: str) -> bool:
    """Return whether a name is one of a parameter that a calibration may have, temperature apart.

    Parameters
    ----------
    name : such as "gyro bias x".
    """
    return name in _known()


@cache
def parameter_of(name: str) -> Parameter:
    """Return the parameter of a name.

    A name that no version of tumble gives is a family of its own, among the optional terms.

    Parameters
    ----------
    name : as a calibration has it.

    Examples
    --------
    >>> parameter_of("gyro bias y").family.name, parameter_of("gyro bias y").axes
    ('gyro bias', 'y')
    """
    if found := _known().get(name):
        return found
    if not name.startswith("thermal "):
        return Parameter(name, Family(name, "", "", OPTIONAL, name, name, ("",), ""), "")
    said, axes = name.removeprefix("thermal "), ""
    head, _, last = said.rpartition(" ")
    if len(last) <= 2 and set(last) <= set("xyz"):
        said, axes = head, last
    triad = next((one for one in ("accelerometer", "gyro") if said.startswith(f"{one} ")), "")
    return Parameter(name, thermal_family(triad, said.removeprefix(f"{triad} ")), axes)


def in_families(names: Sequence[str]) -> dict[str, list[int]]:
    """Return the numbers of the parameters of each family, by its name.

    Parameters
    ----------
    names : of parameters.
    """
    families: dict[str, list[int]] = {}
    for number, name in enumerate(names):
        families.setdefault(parameter_of(name).family.name, []).append(number)
    return families


def under_headings(rows: Iterable[T], key: Callable[[T], str]) -> list[tuple[str, list[T]]]:
    """Return rows of parameters under their headings, in the headings' order.

    Parameters
    ----------
    rows : in any order.
    key : gives a row's parameter by its name.
    """
    groups: dict[str, list[T]] = {}
    for row in rows:
        groups.setdefault(parameter_of(key(row)).family.group, []).append(row)
    return [(group, groups[group]) for group in GROUPS if group in groups]


def triad_labels(
    triad: str, raw: str, angles: str, axes: tuple[str, ...], *, si: bool
) -> list[tuple[str, str]]:
    """Return names and units of a triad's biases, scale factors and angles.

    Parameters
    ----------
    triad, raw : "accelerometer" or "gyro", and its raw unit.
    angles, axes : "non-orthogonality" or "misalignment", and of which axes.
    si : whether the raw unit has a factor to SI: scale factors are then errors.
    """
    scale = "scale factor error" if si else "scale factor"
    kinds = (("bias", ()), (scale, ()), (angles, axes))
    return [label for kind, own in kinds for label in FAMILIES[f"{triad} {kind}"].labels(raw, own)]


def family_of(term: str) -> Family:
    """Return the family of a block of entries that has parameters of its own.

    Parameters
    ----------
    term : such as "gyroscope.bias" or "gyroscope.g_sensitivity".
    """
    triad, _, kind = term.partition(".")
    return FAMILIES[f"{triad.replace('gyroscope', 'gyro')} {kind.replace('_', '-')}"]
