"""Options that several commands share, each declared once, and the groups in which commands take them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from tumble.cli.groups import PRINTED
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.workflows import ADVANCED, PLACE, RECORD, CalibrateRequest, option, shared

if TYPE_CHECKING:
    from tumble.earth import Site


@dataclass(frozen=True)
class UnitOptions:
    """What a unit is called.

    Attributes
    ----------
    imu_model : Model of the unit, noted in the file.
    imu_serial : Serial number of the unit, noted in the file.
    """

    imu_model: str | None = option(RECORD, "MODEL")
    imu_serial: str | None = option(RECORD, "SERIAL")

    @property
    def imu(self) -> tuple[str | None, str | None]:
        """Model and serial number."""
        return self.imu_model, self.imu_serial


RegistryName: TypeAlias = Annotated[str | None, shared(CalibrateRequest, "registry")]
NoteOption: TypeAlias = Annotated[list[str] | None, shared(CalibrateRequest, "notes")]
Json: TypeAlias = Annotated[bool, option(PRINTED, "", "--json", help="Print everything as JSON.")]


@dataclass(frozen=True)
class SiteOptions:
    """Where a recording was made.

    Attributes
    ----------
    site : Latitude in degrees and height in metres, for gravity and the Earth's rate.
    gravity : Gravity there in m/s², good to half its last digit, or as 9.80788±0.00002.
    """

    site: str | None = option(PLACE, "LAT[,H]")
    gravity: str | None = option(PLACE, "G[±U]")

    @property
    def place(self) -> Site | None:
        """The place as it was given; None if nothing was."""
        from tumble.workflows import choose_site

        return choose_site(self.site, self.gravity)


@dataclass(frozen=True)
class PrintOptions:
    """How an answer is printed.

    Attributes
    ----------
    quiet : Print the verdict only.
    """

    as_json: Json = False
    quiet: bool = option(PRINTED, "", "--quiet", "-q", default=False)

    @property
    def silent(self) -> bool:
        """Whether nothing is shown while work is going on."""
        return self.as_json or self.quiet


@dataclass(frozen=True)
class LongPrintOptions(PrintOptions):
    """How an answer with details is printed.

    Attributes
    ----------
    verbose : Print more of what was found.
    """

    verbose: bool = option(PRINTED, "", "--verbose", "-v", default=False)


FiguresOption: TypeAlias = Annotated[
    str | None,
    option(
        ADVANCED,
        "pdf|svg|png",
        "--figures",
        help="Also draw the figures of the page for a paper, one column wide, in the folder figures beside it.",
    ),
]


def check_figures(form: str | None, output: object) -> None:
    """Refuse before minutes of work what cannot be drawn.

    Parameters
    ----------
    form : as asked for, or None.
    output : where the page will be, or None.

    Raises
    ------
    UsageError
        If the form is unknown, no page is written, or the library is not installed.
    """
    if form is None:
        return
    from tumble.report import FORMS, require_library

    if form not in FORMS:
        raise UsageError(f"--figures {form}: give one of {', '.join(FORMS)}.")
    if output is None:
        raise UsageError("--figures draws the figures of the page, and no page is written: give -o FOLDER.")
    require_library()


def draw_figures(form: str | None, page: Callable[[], Any], files: Iterable[Path]) -> list[Path]:
    """Draw the figures of a page beside the file that holds it; return what was drawn.

    Parameters
    ----------
    form : as asked for, or None.
    page : makes the page.
    files : that were written, the page among them.

    Raises
    ------
    OutputError
        If a figure cannot be written.
    """
    folders = [file.parent for file in files if file.suffix == ".html"]
    if form is None or not folders:
        return []
    from tumble.report import write_figures

    return write_figures(page().figures, folders[0] / "figures", form)
