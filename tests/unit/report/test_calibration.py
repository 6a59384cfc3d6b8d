"""The page: complete, offline, escaped, and its numbers apply as they stand."""

import json
import re
from typing import Any

import numpy as np
import pytest
from lxml.html import document_fromstring
from msgspec import structs

from tumble.report.calibration import formula_text, render_report, title
from tumble.report.parameters import parameter_rows
from tumble.report.subject import Subject
from tumble.report.words import component_words

WAYS = ("hand_held", "without_gyro", "in_counts")


class Page:
    """Elements in order, the scripts' texts by id, and all visible text."""

    def __init__(self, text):
        root: Any = document_fromstring(text)
        self.tags: list[tuple[str, dict[str, str]]] = [
            (one.tag, dict(one.attrib)) for one in root.iter() if isinstance(one.tag, str)
        ]
        self.scripts: list[tuple[dict[str, str], str]] = [
            (dict(one.attrib), one.text or "") for one in root.iter("script")
        ]
        self.text = "".join(root.xpath("//text()[not(parent::script) and not(parent::style)]"))

    def json(self, name):
        (text,) = [text for attributes, text in self.scripts if attributes.get("id") == name]
        return json.loads(text, parse_constant=lambda constant: pytest.fail(f"{constant} is no JSON"))


@pytest.fixture(scope="module", params=WAYS)
def run(request):
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="module")
def text(run):
    return render_report(Subject(**run))


@pytest.fixture(scope="module")
def page(text):
    return Page(text)


def test_the_page_fetches_nothing(page, text):
    """No element names an address, the policy forbids what a script could try, and no address stands in our own."""
    for _, attributes in page.tags:
        assert not {"src", "href", "srcset", "data", "action"} & set(attributes)
    (policy,) = [a["content"] for tag, a in page.tags if tag == "meta" and "http-equiv" in a]
    assert policy.startswith("default-src 'none'")
    library = max((script for _, script in page.scripts), key=len)
    assert library.lstrip().startswith("/**\n* plotly.js")
    assert re.findall(r"https?://|@import|url\(", text.replace(library, "")) == []


def test_names_that_would_break_the_page_are_escaped(run, page):
    for source in run["calibration"].recordings:
        assert source.name in page.text
    assert not any(tag in ("b", "i") for tag, _ in page.tags)
    assert [tag for tag, _ in page.tags].count("script") == 4


def test_every_figure_has_its_place_its_caption_and_its_words_for_screen_readers(page):
    places = [attributes["id"] for tag, attributes in page.tags if tag == "div" and "id" in attributes]
    figures = page.json("figures")
    assert [figure["name"] for figure in figures] == places
    assert len(set(places)) == len(places)
    assert all(figure["data"] and figure["layout"]["height"] > 0 for figure in figures)
    tags = [tag for tag, _ in page.tags]
    assert tags.count("figure") == tags.count("figcaption")
    assert all(a.get("aria-label") for tag, a in page.tags if tag == "div" and "id" in a)
    assert tags.count("noscript") == 1


def test_the_page_says_all_that_the_calibration_says_in_reading_order(run, page):
    calibration = run["calibration"]
    assert page.json("calibration") == json.loads(calibration.to_json())
    order = ["Fit for use" if calibration.verdict.fit else "Not fit for use", "Parameters", "Timeline"]
    order += ["Poses", "Holds: norm against gravity", "Parameters with 95 % intervals", "Correlations"]
    order += ["The formula, both ways", "What to do next"]
    places = [page.text.index(title) for title in order]
    assert places == sorted(places)
    has_turns = bool(np.any(np.isfinite(run["estimate"].turns.angles)))
    assert ("Turns: gravity carried by the gyro" in page.text) == has_turns
    plain = page.text.replace("`", "")
    for sentence in [*calibration.verdict.reasons, *calibration.not_determined, *calibration.remarks]:
        assert sentence.replace("`", "") in plain
    for row in parameter_rows(calibration):
        assert row.label in page.text
        assert row.shown.text.replace("-", "−") in page.text
    for value in np.ravel(calibration.accelerometer.matrix):
        assert f"{value + 0.0:.9g}" in page.text  # nine digits of every entry of the matrix


def test_the_formula_names_the_terms_of_each_sensor(calibration):
    gyro = structs.replace(calibration.gyroscope, asymmetry=(0.01, -0.02, 0.03), quadratic=(1e-3,) * 3)
    text = formula_text(structs.replace(calibration, gyroscope=gyro))
    assert "f = inverse(M_a) u,   u + q u² = raw_a - b_a\n" in text
    assert "w = inverse(M_g) u,   u + a |u| + q u² = raw_g - b_g - G f\n" in text
    gyro = structs.replace(calibration.gyroscope, matrix=None)
    text = formula_text(structs.replace(calibration, gyroscope=gyro))
    assert "only the bias and g-sensitivity can be removed: raw_g - b_g - G f" in text
    assert "M_g" not in text
    assert "-0.3" in text.split("\nG ")[1]


@pytest.mark.parametrize(
    ("name", "sigma", "words"),
    [
        (
            "gyro bias from hold to hold, rad/s",
            0.0,
            "Gyro bias from hold to hold: none found beyond the noise.",
        ),
        # 1e-4 rad/s = 0.0057 °/s = 20.6 °/h.
        ("gyro bias from hold to hold, rad/s", 1e-4, "Gyro bias from hold to hold: 21 °/h."),
        ("direction after a turn, rad", 0.0013, "Direction after a turn: 1.3 mrad."),
    ],
)
def test_variance_components_are_told_in_words(name, sigma, words):
    assert component_words(name, sigma) == words


def test_of_many_recordings_the_title_names_the_first_and_the_last(calibration):
    (only,) = calibration.recordings
    names = [structs.replace(only, name=f"step-{k:03d}.csv") for k in range(1, 105)]
    many = structs.replace(calibration, recordings=names)
    assert title(many) == "Calibration of 104 files, step-001.csv … step-104.csv"
    few = structs.replace(calibration, recordings=many.recordings[:3])
    assert title(few) == "Calibration of step-001.csv, step-002.csv, step-003.csv"


def test_on_a_table_nobody_is_told_to_hold_the_unit_with_a_corner_up(run):
    from tumble.protocol import named_protocol
    from tumble.report.calibration import next_steps

    site = structs.replace(run["calibration"].site, latitude_deg=None)
    calibration = structs.replace(run["calibration"], site=site)
    up_b = 9.81 * np.eye(3)[np.arange(len(run["means"])) % 3]
    free, placed = (
        Subject(**(run | {"calibration": calibration, "protocol": told}))
        for told in (None, named_protocol("rate-table"))
    )
    vars(free)["up_b"] = vars(placed)["up_b"] = up_b
    assert any("Hold the unit with" in step for step in next_steps(free))
    assert ("--site" in "".join(next_steps(free))) == (calibration.quality.turns > 0)
    steps = next_steps(placed)
    assert not any("Hold the unit with" in step for step in steps)
    assert any("placement" in step for step in steps)
