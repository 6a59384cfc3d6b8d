"""What a run left behind, reduced to sentences and numbers; and the differences of two such outcomes."""

from __future__ import annotations

import csv
import difflib
import json
import math
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

RELATIVE = 1e-9
"""How far a number may move, as a part of itself."""
OF_ITS_ARRAY = 1e-9
"""... as a part of the largest number of its array: an entry that is nearly zero is round-off of the others."""
OF_ITS_SIGMA = 2e-6
"""... as a part of its standard uncertainty, where it has one: iterations end when a step is less than this."""
OF_A_LINE = 2e-8
"""... as a part of the largest number of its line, in texts, where nine digits are printed."""
ROUND_OFF = 1e-10
"""... in texts at least, where lines are of round-off alone."""

# What moves on unchanged code when the linear algebra adds in another order (OPENBLAS_CORETYPE=Sandybridge), and
# would move with any other order of the same sums. Where it is, tolerance relative to the number, and absolute.
LOOSER: tuple[tuple[str, float, float], ...] = (
    # An array's gyro bias from hold to hold is hardly seen, and the iterations of variance components end early.
    (r"--array.*/covariance/", 1e-2, 1e-13),
    (r"--array", 2e-4, 1e-6),
    # How long it took.
    (r"reproduce [^/]*/out/\d+/seconds$", 0.0, 1e9),
    # Parts of an error budget that are zero but for round-off; eigenvalues of nearly singular plans.
    (r"/by_source/", 1e-8, 1e-15),
    (r"/(largest_over_smallest_performance|of_noise_alone|data_sheet_spreads)$", 1e-7, 0.0),
    # Variance components are iterated until they change by less than this; uncertainties follow from them.
    (r"/variance_components/|/sigma0|normalised_residual$", 2e-6, 1e-15),
    (r"/(standard_)?uncertainty$|standard_uncertainty", 2e-6, 1e-13),
    # Differences of nearly equal sums of squares, and the probability of such a difference.
    (r"/(f_statistic|probability|chi_square|p_value)$", 2e-4, 1e-6),
    (r"uncertainty_over_that_alone/", 1e-4, 0.0),
    # As many unknowns as equations: what is left is round-off.
    (r"/rms_(hold_norm|turn_angle)$", 1e-8, 1e-12),
    # Parameters that a frame or a gauge makes zero.
    (r"/parameters/\d+/value$", 1e-9, 1e-16),
    (r"/largest_share_of_variance$", 1e-9, 1e-12),
    # A hundred-millionth of a mg, a millionth of a degree an hour.
    (r"/(accelerometer/bias|accelerometer_bias)/", 1e-9, 1e-10),
    (r"/(gyroscope/bias|biases|gyroscope_bias)/", 1e-7, 5e-12),
    # Derivatives with temperature that are zero but for round-off.
    (r"truth\.json/thermal/", 1e-9, 1e-18),
)

DROPPED_KEYS = {"created", "software", "sha256", "seconds_by_stage", "path"}
MASKS = (
    (re.compile(r"\b[0-9a-f]{64}\b"), "HASH"),
    # The identity of a calibration is made of its file, date and all.
    (re.compile(r"(?<=corrected_by_)[0-9a-f]{12}\b"), "HASH"),
    (re.compile(r"(?<![\w.])(?=[0-9]*[a-f])(?=[a-f]*[0-9])[0-9a-f]{8,16}(?!\w)"), "HASH"),
    (re.compile(r"(?<=, seed \d, )[\d.e-]+ s\.$"), "SECONDS."),
    # The joint procedure's draws adjust anew for some seconds, so that a loaded machine makes fewer.
    (re.compile(r"\b\d+ full adjustments"), "SOME full adjustments"),
    (
        re.compile(r"(drawn anew scatter by|scatter by) [\d.]+ of what the first order says \(1 ± [\d.]+"),
        "SCATTER",
    ),
    (re.compile(r"^time: .* s$"), "SECONDS BY STAGE"),
    (
        re.compile(r"\b20[2-9]\d-[01]\d-[0-3]\d([T ][0-2]\d:[0-5]\d(:[0-5]\d(\.\d+)?)?)?( ?UTC|Z|\+00:00)?"),
        "DATE",
    ),
    (re.compile(r"\btumble \d+\.\d+\.\d+\S*"), "tumble VERSION"),
)
# Eight digits and more (nine, less a zero at the end): for another program, not rounded for a reader; or round-off.
LONG_NUMBER = re.compile(
    r"(?<![\w.])-?(?:(?=(?:\.?\d){8})\d+\.\d+(?:e[-+]?\d+)?|\d(?:\.\d+)?e-(?:1[1-9]|[2-9]\d))(?!\w)"
)
SILENT = {"script", "style", "svg", "head"}
ROWS = {
    "p",
    "dl",
    "dt",
    "dd",
    "div",
    "section",
    "li",
    "tr",
    "table",
    "figure",
    "figcaption",
    "summary",
    "details",
    "br",
    "pre",
}
ROWS |= {f"h{level}" for level in range(1, 7)}


class _Visible(HTMLParser):
    """Collects the visible sentences of a page, a line each; cells of a row are parted by a bar."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._line = ""
        self._hidden = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._hidden += tag in SILENT
        if tag in ROWS:
            self.end_line()

    def handle_endtag(self, tag: str) -> None:
        self._hidden -= tag in SILENT
        if tag in ("td", "th"):
            self._line += " | "
        if tag in ROWS:
            self.end_line()

    def handle_data(self, data: str) -> None:
        if not self._hidden:
            self._line += data

    def end_line(self) -> None:
        line = " ".join(self._line.split())
        if line:
            self.lines.append(line)
        self._line = ""


def page_lines(html: str) -> list[str]:
    """Return the visible lines of a page."""
    reader = _Visible()
    reader.feed(html)
    reader.close()
    reader.end_line()
    return [masked(line) for line in reader.lines]


def masked(text: str) -> str:
    """Return a text without what differs from run to run: hashes, dates, the version."""
    for pattern, word in MASKS:
        text = pattern.sub(word, text)
    return text


def text_lines(text: str) -> list[str]:
    """Return the lines of a terminal's text: how wide a table is does not count."""
    lines = (" ".join(re.sub("[─━═╌]+", "─", line).split()) for line in text.splitlines())
    return [masked(line) for line in lines if line]


def stream(text: str) -> object:
    """Return what was printed: numbers and sentences if it is JSON, else its lines."""
    if text.startswith(("{", "[")):
        try:
            return reduced(json.loads(text))
        except ValueError:
            pass
    return text_lines(text)


def reduced(value: object) -> object:
    """Return a JSON document without what differs from run to run."""
    if isinstance(value, dict):
        return {key: reduced(item) for key, item in value.items() if key not in DROPPED_KEYS}
    if isinstance(value, list):
        return [reduced(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return masked(value) if isinstance(value, str) else value


def table_summary(path: Path) -> object:
    """Return header, number of rows, three rows, and mean and root mean square of each column of a CSV file."""
    with path.open(encoding="utf-8", newline="") as file:
        lines = [line for line in file if not line.startswith("#")]
    rows = list(csv.reader(lines))
    try:
        numbers = [[float(cell) for cell in row] for row in rows[1:]]
        columns = [[x for x in column if math.isfinite(x)] for column in zip(*numbers, strict=True)]
    except ValueError:
        return [masked(line.rstrip()) for line in lines]
    if not numbers:
        return rows
    return {
        "header": [masked(cell) for cell in rows[0]],
        "rows": len(numbers),
        "some": [[str(x) if not math.isfinite(x) else x for x in numbers[k]] for k in _places(len(numbers))],
        "mean": [math.fsum(column) / max(len(column), 1) for column in columns],
        "rms": [math.sqrt(math.fsum(x * x for x in column) / max(len(column), 1)) for column in columns],
    }


def _places(count: int) -> tuple[int, ...]:
    return 0, count // 3, count - 1


def file_outcome(path: Path) -> object:
    """Return what a file says."""
    if path.suffix == ".csv":
        return table_summary(path)
    if path.suffix in (".parquet", ".npy", ".png", ".gz"):
        return "binary"
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".html":
        return page_lines(text)
    if path.suffix == ".json":
        return reduced(json.loads(text))
    return masked(text).splitlines()


def differences(old: object, new: object) -> Iterator[str]:
    """Yield a line for each difference of two outcomes: where it is, and what became of what."""
    yield from _walk(old, new, "", 0.0)


def _walk(old: object, new: object, path: str, floor: float) -> Iterator[str]:
    if isinstance(old, dict) and isinstance(new, dict):
        sigma = old.get("standard_uncertainty")
        of_sigma = (
            OF_ITS_SIGMA * sigma if isinstance(sigma, int | float) and not isinstance(sigma, bool) else 0.0
        )
        for key in [*old, *(key for key in new if key not in old)]:
            if key not in new:
                yield f"{path}/{key}: gone, was {_short(old[key])}"
            elif key not in old:
                yield f"{path}/{key}: new, {_short(new[key])}"
            else:
                yield from _walk(old[key], new[key], f"{path}/{key}", of_sigma if key == "value" else 0.0)
    elif isinstance(old, list) and isinstance(new, list):
        yield from _walk_list(old, new, path, floor)
    elif _is_number(old) and _is_number(new):
        relative, absolute = tolerance(path)
        if abs(new - old) > max(floor, absolute, relative * max(abs(old), abs(new))):
            part = (new - old) / abs(old) if old else math.inf
            yield f"{path}: {old!r} became {new!r} ({part:+.1e} of it)"
    elif isinstance(old, str) and isinstance(new, str):
        yield from _walk_lines([old], [new], path)
    elif type(old) is not type(new) or old != new:
        yield f"{path}: {_short(old)} became {_short(new)}"


def _walk_list(old: list[object], new: list[object], path: str, floor: float) -> Iterator[str]:
    if _is_text(old) and _is_text(new):
        if path.endswith(".html"):
            old, new = _in_any_order(old), _in_any_order(new)
        yield from _walk_lines(old, new, path)
        return
    if len(old) != len(new):
        yield f"{path}: {len(old)} items became {len(new)}"
        return
    if path.endswith("covariance") and all(isinstance(row, list) for row in old):
        sigmas = [math.sqrt(abs(row[k])) if _is_number(row[k]) else 0.0 for k, row in enumerate(old)]
        for i, (row, other) in enumerate(zip(old, new, strict=True)):
            for j, (x, y) in enumerate(zip(row, other, strict=True)):
                yield from _walk(
                    x, y, f"{path}/{i}/{j}", max(2.0 * OF_ITS_SIGMA * sigmas[i] * sigmas[j], 1e-23)
                )
        return
    largest = max((abs(x) for x in _numbers(old)), default=0.0)
    floor = max(floor, OF_ITS_ARRAY * largest)
    for index, (x, y) in enumerate(zip(old, new, strict=True)):
        yield from _walk(x, y, f"{path}/{index}", floor)


def _in_any_order(lines: list[str]) -> list[str]:
    """Lines of a page: its sections may change places, and a minus is one however it is set."""
    return sorted((line.replace("−", "-") for line in lines), key=lambda line: LONG_NUMBER.sub("#", line))


def _walk_lines(old: list[str], new: list[str], path: str) -> Iterator[str]:
    """Lines are told by what is gone and what is new, so that one more line is one difference.

    Numbers of many digits are compared as numbers; rounded ones must be the same letter by letter.
    """
    old, new = [masked(line) for line in old], [masked(line) for line in new]
    same = difflib.SequenceMatcher(
        None,
        [LONG_NUMBER.sub("#", line) for line in old],
        [LONG_NUMBER.sub("#", line) for line in new],
        autojunk=False,
    )
    for kind, i, i_end, j, j_end in same.get_opcodes():
        if kind != "equal":
            yield from (f"{path}: - {_short(line)}" for line in old[i:i_end])
            yield from (f"{path}: + {_short(line)}" for line in new[j:j_end])
            continue
        for before, after in zip(old[i:i_end], new[j:j_end], strict=True):
            if before != after:
                pair = [[float(text) for text in LONG_NUMBER.findall(line)] for line in (before, after)]
                largest = max(map(abs, pair[0]), default=0.0)
                yield from _walk_list(
                    *pair, f"{path}/{_short(before, 40)}", max(OF_A_LINE * largest, ROUND_OFF)
                )


def _numbers(values: list[object]) -> Iterator[float]:
    """Numbers of an array, and of the arrays in it."""
    for value in values:
        if _is_number(value):
            yield value
        elif isinstance(value, list):
            yield from _numbers(value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_text(values: list[object]) -> bool:
    return all(isinstance(value, str) for value in values)


def _short(value: object, length: int = 300) -> str:
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) < length else text[:length] + " …"


def tolerance(path: str) -> tuple[float, float]:
    """Return how far a number may move: as a part of it, and in its own unit."""
    for pattern, relative, absolute in LOOSER:
        if re.search(pattern, path):
            return relative, absolute
    return RELATIVE, 1e-300
