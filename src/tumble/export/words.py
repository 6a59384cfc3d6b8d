"""Numbers and comments as other tools' files have them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

import tumble
from tumble.export.subject import Subject
from tumble.files import shown


def number(value: float) -> str:
    """Return a number with all its digits, always with a point or an exponent that YAML 1.1 takes for a number."""
    text = repr(float(value) + 0.0)
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e")
    return text


def row(values: Iterable[Any]) -> str:
    """Return numbers in brackets."""
    return "[" + ", ".join(number(v) for v in np.asarray(values, dtype=float)) + "]"


def yaml_rows(matrix: Any, indent: int) -> str:
    """Return a matrix as a YAML list of rows, each on its own line."""
    return "\n".join(" " * indent + "- " + row(line) for line in np.asarray(matrix, dtype=float))


def head(
    subject: Subject,
    title: str,
    formula: Sequence[str],
    vectors: Sequence[str] | None = None,
) -> list[str]:
    """Return the sentences that a file begins with: what it is, formula, frame, losses, test vector.

    Parameters
    ----------
    title : of the target.
    formula : lines, in the target's own names.
    vectors : lines of a test vector, or None for the standard one in the subject's units.
    """
    lines = [f"{title}, written by tumble {tumble.__version__}"]
    calibration = subject.calibration
    if calibration is not None:
        unit = " ".join(p for p in (calibration.imu.model, calibration.imu.serial_number) if p)
        lines.append(
            f"from calibration {calibration.identity} of {calibration.created}"
            + (f", unit {unit}" if unit else "")
        )
        lines += formula
        lines.append(
            f"raw in {subject.units[0]} and {subject.units[1]}; corrected vectors in frame {subject.frame}:"
        )
        lines.append(f"  {subject.frame_words}")
        lines += vectors if vectors is not None else example_lines(subject)
    else:
        lines += formula
    lines += [f"note: {remark}" for remark in subject.remarks]
    if subject.noise is not None:
        lines += [f"note: {remark}" for remark in subject.noise.remarks]
    lines += [f"loss: {loss.text}" for loss in subject.losses]
    return lines


def example_lines(
    subject: Subject, scale: tuple[float, float] = (1.0, 1.0), units: str = "m/s^2, rad/s"
) -> list[str]:
    """Return a test vector as text: raw in, corrected out.

    Parameters
    ----------
    scale : of corrected specific force and angular rate, from SI to the tool's units.
    units : their names.
    """
    raw_force, raw_rate, force, rate = subject.vectors()
    return [
        f"test vector: raw specific force {row(raw_force[2])}, raw angular rate {row(raw_rate[2])}",
        f"  corrected to {row(scale[0] * force[2])}, {row(scale[1] * rate[2])} ({units})",
    ]


def commented(lines: Sequence[str], mark: str = "#") -> str:
    """Return lines behind a comment mark, so that no text in them ends the comment (see `escaped`)."""
    return "".join(f"{mark} {escaped(line, mark)}".rstrip() + "\n" for line in lines)


def escaped(text: str, mark: str) -> str:
    """Return a text as it may stand in a comment of the language whose comments begin with a mark.

    A calibration's texts come from anywhere: a name with a line break in it would go on as code.

    Parameters
    ----------
    text : one line; a line break or another hidden character in it is written as its number.
    mark : ``#`` of Python, YAML and parameters, ``//`` of C++, `` *`` of C, ``%`` of MATLAB.
    """
    line = shown(text).rstrip()
    if mark in ("//", " *"):
        # The end of the comment; trigraphs, of which ??/ is a backslash; a backslash that joins the next line to it.
        line = line.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
        return line + " ." if line.endswith("\\") else line
    # Python takes an encoding from a comment in its first two lines, and in UTF-7 a comment may hold line breaks.
    return re.sub(r"coding(?=[:=])", "coding ", line) if mark == "#" else line


def yaml_text(text: str) -> str:
    """Return a text as a YAML value: as it is where it is a plain name, else in double quotes."""
    plain = re.fullmatch(r"[A-Za-z/][A-Za-z0-9_/.-]*", text)
    return text if plain else quoted(text)


def quoted(text: str) -> str:
    """Return a text in the double quotes of YAML (and of OpenCV), hidden characters as their numbers."""
    return json.dumps(shown(text), ensure_ascii=False)
