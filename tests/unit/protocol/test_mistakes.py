"""Every mistake in a protocol file is named by file, line and step, and says what to write; its schema sees most."""

import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from jsonschema import Draft202012Validator

from tumble.earth import Site
from tumble.errors import ProtocolError
from tumble.protocol import (
    PROTOCOLS,
    HoldStep,
    Pose,
    Protocol,
    SpinStep,
    TurnStep,
    named_protocol,
    protocol_schema,
    protocol_to_yaml,
    read_protocol,
)

# Line 1 is `format`; the steps begin in line 9.
SITE = "site:\n  latitude_deg: 48.1\n  height_m: 520\n"
HEAD = f"format: tumble protocol\nversion: 1\nname: trial\nprocedure: multi-position\n{SITE}"
STEPS = """\
steps:
  - hold: x up
    up: x
    uncertainty_deg: 5
    seconds: 30
  - turn:
    axis: [0, 1, -1]
    angle_deg: 90
    seconds: 3
  - hold: on the table
    up: z
    seconds: 30
  - spin: clockwise
    rate_deg_per_s: -41.78
    revolutions: 3
    ramp_s: 2
"""
GOOD = HEAD + STEPS


def message(path, content):
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ProtocolError) as raised:
        read_protocol(path)
    return str(raised.value)


# What stands in the file, what is written instead, the line that is named, and what is said.
SPOILT = {
    "an unknown key": ("name: trial", "nmae: trial", 3, "has no key `nmae`: did you mean `name`?"),
    "an unknown key of a step": ("    seconds: 3\n", "    secs: 3\n", 16, "step 2: a turn has no key `secs`"),
    "the nearest key of a step": ("angle_deg: 90", "angle: 90", 15, "key `angle`: did you mean `angle_deg`?"),
    "an unknown kind of step": ("turn:", "trun:", 13, "2: `trun` is no kind of step; did you mean `turn`?"),
    "no kind of step": ("- turn:", "- wait:", 13, "a step is `hold:`, `turn:`, `spin:`, `soak:`, `ramp:`."),
    "two kinds at once": ("    angle_deg: 90", "    hold: too", 13, "and `turn` at once: make two steps"),
    "a key twice": ("    angle_deg: 90", "    axis: x", 15, "stands twice, first in line 14: remove one."),
    "a key of the file twice": ("version: 1", "procedure: x", 4, "`procedure` stands twice, first in line 2"),
    "a missing site": (SITE, "", 1, "the site is missing: write `site:` and below it `latitude_deg: 48.1`"),
    "a site of nothing but a height": ("  latitude_deg: 48.1\n", "", 6, "write `latitude_deg` below `site`"),
    "a latitude beyond the poles": ("latitude_deg: 48.1", "latitude_deg: 91", 6, "90 there are the poles"),
    "a latitude in quotes": ("latitude_deg: 48.1", "latitude_deg: '48'", 6, "a number, without quotes."),
    "a height above the air": ("height_m: 520", "height_m: 52000", 7, "from -500 to 10000"),
    "a gravity of the Moon": ("height_m: 520", "gravity: 1.62", 7, "from 9.75 to 9.85"),
    "an angle beyond a turn": ("angle_deg: 90", "angle_deg: 400", 15, "a turn of more as `revolutions`."),
    "a heading beyond a turn": ("uncertainty_deg: 5", "heading_deg: -361", 11, "`heading_deg` is -361"),
    "an attitude beyond a turn": (
        "    up: x\n    uncertainty_deg: 5",
        "    attitude_deg: [0, 0, 720]",
        10,
        "to be from -360 to 360",
    ),
    "a negative time": ("seconds: 30", "seconds: -30", 12, "1 (x up): `seconds` is -30: it has to be more"),
    "no time at all": ("seconds: 30", "seconds: 0", 12, "`seconds` is 0: it has to be more than 0."),
    "a time left out": ("    seconds: 30\n", "", 9, "step 1 (x up): `seconds` is missing"),
    "a negative ramp": ("ramp_s: 2", "ramp_s: -2", 23, "`ramp_s` is -2: it has to be 0 or more."),
    "a rate of zero": ("rate_deg_per_s: -41.78", "rate_deg_per_s: 0", 21, "which is no spin: write a hold."),
    "a rate left out": ("    rate_deg_per_s: -41.78\n", "", 20, "`rate_deg_per_s` is missing"),
    "a spin of no length": ("    revolutions: 3\n", "", 20, "`seconds` or `revolutions` is missing"),
    "revolutions and seconds": ("ramp_s: 2", "seconds: 20", 22, "say the same: remove one."),
    "revolutions backwards": ("revolutions: 3", "revolutions: -3", 22, "The sign of the rate says the way."),
    "an angle against the rate": ("ramp_s: 2", "angle_deg: 1080", 23, "the table cannot turn one way"),
    "an angle of no spin": ("ramp_s: 2", "angle_deg: 0", 23, "`angle_deg` is 0, which is no spin"),
    "an uncertainty of no angle": ("ramp_s: 2", "angle_uncertainty_arcsec: 2", 23, "without `angle_deg`"),
    "an angle and revolutions": (
        "    angle_deg: 90",
        "    angle_deg: 90\n    revolutions: 2",
        16,
        "the same: remove one.",
    ),
    "a negative uncertainty": ("uncertainty_deg: 5", "uncertainty_deg: -5", 11, "from 0 to 180"),
    "an uncertainty of nothing": ("    angle_deg: 90", "    uncertainty_deg: 1", 15, "without `angle_deg`"),
    "a heading of nothing": ("    up: x\n", "    heading_deg: 3\n", 10, "says nothing without `up`"),
    "a word that is no direction": ("up: x", "up: nose", 10, "write x, -y, or a list such as [1, 1, 0]."),
    "no direction at all": ("[0, 1, -1]", "[0, 0, 0]", 14, "which is no direction: one must differ from 0."),
    "a direction of two numbers": ("[0, 1, -1]", "[0, 1]", 14, "to be a list of 3 numbers"),
    "an attitude and what is up": ("uncertainty_deg: 5", "attitude_deg: [0, 0, 0]", 11, "remove it, or `up`"),
    "an interval that ends first": ("seconds: 30", "interval_s: [9, 4]", 12, "4 s, not after its start at 9"),
    "an interval longer than any number": (
        "seconds: 30",
        "interval_s: [-1e308, 1e308]",
        12,
        "longer than any number",
    ),
    "an interval of one number": ("seconds: 30", "interval_s: 9", 12, "to be a list of 2 numbers"),
    "not a number": ("seconds: 30", "seconds: .nan", 12, "`seconds` is .nan: a finite number is needed."),
    "NaN as others write it": ("seconds: 30", "seconds: NaN", 12, "a finite number is needed."),
    "an infinite time": ("seconds: 30", "seconds: inf", 12, "a finite number is needed."),
    "an infinity in a list": ("[0, 1, -1]", "[0, .inf, -1]", 14, "a finite number is needed."),
    "a word for a number": ("seconds: 30", "seconds: long", 12, "is `long`, and is to be a number."),
    "a number with its unit": ("seconds: 30", "seconds: 30 s", 12, "write 30 alone, the key says the unit."),
    "a decimal comma": ("seconds: 30", "seconds: 30,5", 12, "write the number with a point, 30.5."),
    "a number in quotes": ("seconds: 30", "seconds: '30'", 12, "write a number, without quotes."),
    "a number that is a list": ("seconds: 30", "seconds: [30]", 12, "to be one number, and is a sequence."),
    "a number that is empty": ("seconds: 30", "seconds:", 12, "`seconds` is empty: write a number after it"),
    "a name that is a list": ("name: trial", "name: [a]", 3, "`name` is to be a text, and is a sequence."),
    "a name that is a mapping": ("- turn:", "- turn: {axis: x}", 13, "after `turn:` stands its name alone"),
    "a site that is a number": (SITE, "site: 48.1\n", 5, "a site is to be"),
    "steps that are a word": (STEPS, "steps: many\n", 8, "`steps` is to be a list"),
    "empty steps": (STEPS, "steps:\n", 8, "there are no steps: write at least one"),
    "an empty list of steps": (STEPS, "steps: []\n", 8, "there are no steps: write at least one"),
    "a step that is a word": (STEPS, "steps:\n  - x up\n", 9, "`turn:`, `spin:`, `soak:` or `ramp:`"),
    "steps left out": (STEPS, "", 1, "there are no steps: write `steps:` with at least one"),
    "no hold": (STEPS, "steps:\n  - turn:\n    seconds: 3\n", 9, "there is no hold among the steps"),
    "steps and like": ("name: trial", "like: six-position", 9, "the steps are those of `like` already"),
    "like nothing": (STEPS, "like: six-postion\n", 8, "protocol `six-postion`: did you mean `six-position`?"),
    "no procedure": ("procedure: multi-position\n", "", 1, "`procedure` is missing"),
    "a slip in a procedure": (
        "multi-",
        "mutli-",
        4,
        "procedure `mutli-position`: did you mean `multi-position`? There are hand-held, ",
    ),
    "a newer version": ("version: 1", "version: 2", 2, "reads version 1: install a newer tumble."),
    "a version that is no number": ("version: 1", "version: one", 2, "is to be a number"),
    "another convention": ("version: 1", "angles: clockwise", 2, "states another convention than tumble's."),
    "a recording twice": ("version: 1", "recordings: [a.csv, b.csv, a.csv]", 2, "named twice: remove one."),
    "a recording without a name": ("version: 1", "recordings: [a.csv, '']", 2, "the recordings has no name"),
    "units that are a list": ("version: 1", "units: [g]", 2, "`units` is to be a text, and is a sequence."),
    "a rate of no samples": ("version: 1", "rate_hz: 0", 2, "`rate_hz` is 0: it has to be more than 0."),
    "another kind of file": ("tumble protocol", "tumble calibration", 1, "the format `tumble calibration`"),
    "a syntax error": ("[0, 1, -1]", "[0, 1, -1", 14, "this is not YAML: "),
    "a tab": ("    angle_deg", "\tangle_deg", 15, "Indent with spaces, not with tabs"),
    "a character of no text": ("x up", "x\x07up", 9, "has no place in a text file"),
    "two files in one": ("version: 1", "---", 2, "this is not YAML"),
}


@pytest.mark.parametrize(("found", "instead", "line", "said"), SPOILT.values(), ids=SPOILT)
def test_a_mistake_is_named_with_its_line(found, instead, line, said, tmp_path):
    assert found in GOOD
    text = message(tmp_path / "p.yaml", GOOD.replace(found, instead, 1))
    assert re.match(rf"{tmp_path / 'p.yaml'}, line {line}(, step \d( \(.*?\))?)?: ", text), text
    assert said in text
    assert "\n" not in text


SPIN = "  - spin:\n    rate_deg_per_s: 50\n    revolutions: 1\n"
HOLD = "  - hold: h\n    seconds: 9\n"
TURN = "  - turn:\n    seconds: 3\n"
RAMP = "  - ramp:\n    to_celsius: 9\n"


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        (SPIN + HOLD, "line 9, step 1: a spin without a hold before it: write the hold on the table first."),
        (HOLD + TURN + SPIN, "step 3: a spin without a hold before it: write the hold on the table after"),
        (
            f"{HOLD}    interval_s: [0, 9]\n{HOLD}    interval_s: [8.5, 20]\n",
            "line 12, step 2 (h): its interval",
        ),
        (
            "".join(f"{HOLD}    file: {x}.csv\n" for x in "aba"),
            "line 15, step 3 (h): its file a.csv is named",
        ),
        ("  - soak: cold\n    seconds: 5\n", "`temperature_celsius` is missing"),
        ("  - soak:\n    temperature_celsius: 293.15\n", "`seconds` is missing"),
        ("  - soak:\n    temperature_celsius: 353\n    seconds: 5\n", "It is in °C, not in K."),
        (f"{RAMP}    from_celsius: 9\n    seconds: 9\n", "write a `soak:` instead"),
        (
            f"{RAMP}    from_celsius: 4\n    seconds: 9\n    rate_k_per_min: 1\n",
            "`rate_k_per_min` say the same",
        ),
    ],
)
def test_a_mistake_between_steps_or_of_a_temperature_is_named(steps, said, tmp_path):
    assert said in message(tmp_path / "p.yaml", HEAD + "steps:\n" + steps)


def test_spins_may_follow_one_another_steps_share_a_file_and_files_have_clocks_of_their_own(tmp_path):
    def steps_of(steps):
        (tmp_path / "p.yaml").write_text(HEAD + "steps:\n" + steps, encoding="utf-8")
        return read_protocol(tmp_path / "p.yaml").steps

    named = "    file: a.csv\n"
    shared = f"{HOLD}{named}{SPIN}{named}{SPIN}{HOLD}{named}{TURN}{HOLD}    file: b.csv\n"
    files = [step.file for step in steps_of(shared)]
    assert files == ["a.csv", "a.csv", None, "a.csv", None, "b.csv"]
    clocks = "".join(f"{HOLD}    file: {name}.csv\n    interval_s: [0, 9]\n" for name in "ab")
    assert [step.interval for step in steps_of(clocks)] == [(0.0, 9.0)] * 2


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "is empty: a protocol begins with `format: tumble protocol`."),
        ("# only a comment\n", "is not a protocol"),
        ("t,ax,ay,az\n0,0,0,9.81\n", "is not a protocol: write `format: tumble protocol` as its first line"),
        ("- format\n- b\n", "is not a protocol"),
        ("[" * 5000 + "format", "is not a protocol: it is nested too deeply."),
    ],
)
def test_what_is_no_protocol_is_told_so(content, said, tmp_path):
    assert said in message(tmp_path / "p.yaml", content)


def test_a_file_that_is_not_there_or_no_text_is_told_so(tmp_path):
    with pytest.raises(ProtocolError, match=r"There is no protocol .*none\.yaml"):
        read_protocol(tmp_path / "none.yaml")
    with pytest.raises(ProtocolError, match="cannot be read as a protocol: it is a folder"):
        read_protocol(tmp_path)
    (tmp_path / "binary").write_bytes(b"format\xff\xfe\x00")
    with pytest.raises(ProtocolError, match="no text in UTF-8"):
        read_protocol(tmp_path / "binary")
    (tmp_path / "long").write_bytes(b"format\n" * (16 * 2**20 // 7 + 1))
    with pytest.raises(ProtocolError, match="longer than 2 MB"):
        read_protocol(tmp_path / "long")


@pytest.mark.parametrize(
    ("written", "instead", "line", "hint"),
    [
        ("name: trial", "name: trial: one", 3, 'stands in quotes: name: "trial: one"'),
        ("hold: x up", "hold: face: x up", 9, 'stands in quotes: hold: "face: x up"'),
        ("    up: x", "  up: x", 10, "indentation"),
        ("    uncertainty_deg", "   uncertainty_deg", 11, "indentation"),
        ("  - turn:", "- turn:", 13, "indentation"),
        (
            "  latitude_deg: 48.1\n  ",
            "latitude_deg: 48.1\n",
            6,
            "belongs to the site, indent it below `site:`",
        ),
        ("steps:", "  steps:", 8, "belongs to the protocol, write `steps:` without a space"),
        ("    up: x", "    up:x", 10, "a colon and a space"),
        ("[0, 1, -1]", "[0, 1, -1", 14, "bracket"),
        ("name: trial", "name: 'trial", 3, "quote"),
        ("name: trial", "name: @trial", 3, "in quotes"),
    ],
)
def test_what_is_no_yaml_is_hinted_at_in_the_line_that_is_to_be_mended(
    written, instead, line, hint, tmp_path
):
    assert written in GOOD
    said = message(tmp_path / "trial.yaml", GOOD.replace(written, instead, 1))
    assert f"trial.yaml, line {line}: " in said
    assert hint in said


# The schema -------------------------------------------------------------------------------------

PLACE = Site(9.81, 2e-5, 0.8, 100.0, "a tie")
FITS = Draft202012Validator(protocol_schema()).is_valid


@pytest.mark.parametrize("name", PROTOCOLS)
def test_the_file_of_a_named_protocol_fits(name):
    assert FITS(yaml.safe_load(protocol_to_yaml(replace(named_protocol(name), site=PLACE))))


def test_a_file_with_every_key_fits():
    oblique = np.array([0.36, 0.48, -0.8])
    protocol = Protocol(
        "all",
        "multi-position",
        (
            HoldStep(1e-5, Pose(oblique, 0.3, 0.1), file="a.csv", interval=(0.0, 4.0)),
            TurnStep(2.0, oblique, 9.0, 0.1),
            HoldStep(2.0),
            SpinStep(2.0, -0.3, oblique, 1e-6, 0.0, angle=-0.4, angle_sigma=1e-5),
        ),
        PLACE,
        "for people",
        ("a.csv", "b.csv"),
        "g",
        "ax,ay,az",
        12.5,
    )
    document = yaml.safe_load(protocol_to_yaml(protocol))
    assert FITS(document)
    assert FITS({"format": "tumble protocol", "like": "six-position", "gravity": 9.81})
    Draft202012Validator.check_schema(protocol_schema())


NO_YAML = {"a syntax error", "a tab", "a character of no text", "two files in one"}
# What depends on more than one value: a schema has no words for it, or YAML's loader drops it.
READER_ALONE = {"a key twice", "a key of the file twice", "an angle against the rate", "no direction at all"}
READER_ALONE |= {"an interval that ends first", "an infinity in a list", "not a number"}
READER_ALONE |= {"a recording without a name"}


@pytest.mark.parametrize("mistake", sorted(SPOILT.keys() - NO_YAML - READER_ALONE))
def test_an_editor_with_the_schema_sees_the_mistake_too(mistake):
    assert FITS(yaml.safe_load(GOOD))
    found, instead, *_ = SPOILT[mistake]
    assert not FITS(yaml.safe_load(GOOD.replace(found, instead, 1)))
