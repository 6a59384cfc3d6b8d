"""Protocol files: YAML for people, read with the line of every mistake, written so that it reads back.

Angles are degrees and times are seconds, as people write them, and each key ends in its unit. What is
read is what was written to the last bit (see `tumble.protocol.keys`). The JSON schema is made of the reader's own
keys.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from tumble.earth.site import Site
from tumble.errors import ProtocolError, SiteError, UsageError
from tumble.files import read_text, reading
from tumble.files.writing import put_text, written_beside
from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.protocol.keys import FORMAT, STEPS, VERSION, known_keys, schema_of
from tumble.protocol.library import PROTOCOLS, named_protocol
from tumble.protocol.step_entries import steps_of
from tumble.protocol.steps import Protocol, Step
from tumble.protocol.yaml_nodes import Entry, compose, nearest
from tumble.protocol.yaml_text import protocol_to_text
from tumble.sample_rates import sample_rate

# Ten thousand steps are a megabyte; a recording that is given for a protocol is more.
LARGEST = 2 * 1024 * 1024


def read_protocol(path: str | os.PathLike[str]) -> Protocol:
    """Read a protocol file.

    Parameters
    ----------
    path : of the YAML file.

    Raises
    ------
    ProtocolError
        If it is no protocol file, or something in it is wrong; the message names the line and the step.
    """
    file = Path(path)
    with reading(file, "a protocol", ProtocolError):
        text = read_text(file, LARGEST)
    return _read(text, str(file), file.stem)


def write_protocol(protocol: Protocol, path: str | os.PathLike[str]) -> None:
    """Write a protocol file beside `path`, then rename it there.

    Parameters
    ----------
    protocol : with a site, without which a file cannot be read again.
    path : of the YAML file.

    Raises
    ------
    ProtocolError
        If no file can hold the protocol: it has no site, or a step that cannot be.
    UsageError
        If `path` is no place for a result.
    OutputError
        If it cannot be written; an earlier file is intact.
    """
    content = protocol_to_yaml(protocol)
    with written_beside(Path(path)) as beside:
        put_text(beside, content)


def protocol_to_yaml(protocol: Protocol) -> str:
    """Return a protocol as the text of a file, which reads back to the same protocol.

    Parameters
    ----------
    protocol : with a site, and directions of length 1.

    Raises
    ------
    ProtocolError
        If no file can hold it: it has no site, or a step that cannot be.
    """
    content = protocol_to_text(protocol)
    # The reader knows what cannot be: what it refuses is not written.
    _read(content, f"The protocol {protocol.name!r} cannot be a file", protocol.name, lines=False)
    return content


def _read(content: str, file: str, stem: str, *, lines: bool = True) -> Protocol:
    no_protocol = ProtocolError(
        f"{file} is not a protocol: write `format: {FORMAT}` as its first line, or give the file as what it is."
    )
    # A long recording given by mistake is told at once, not after minutes of looking for YAML in it.
    if content.strip() and "format" not in content:
        raise no_protocol
    root = Entry(file, compose(file, content), lines=lines)
    written = [str(key.value) for key, _ in root.node.value] if root.node.id == "mapping" else []
    if "format" not in written:
        raise no_protocol
    # Another kind of file is named as what it is, before its keys are found unknown.
    _check_format(
        next(replace(root, node=v, key="format") for k, v in root.node.value if k.value == "format")
    )
    # A key that stands too far left or right is another mapping's.
    outdented = {
        key: f"it belongs to a step, indent it below its `{kind}:`."
        for kind in STEPS
        for key in known_keys(kind)
    }
    outdented |= {kind: f"it is a step, write `- {kind}:` below `steps:`." for kind in STEPS}
    outdented |= dict.fromkeys(known_keys("site"), "it belongs to the site, indent it below `site:`.")
    keys = root.mapping(known_keys("protocol"), "a protocol", outdented)
    _check_version(keys)
    _check_conventions(keys)
    return _protocol(root, keys, stem)


def _check_format(entry: Entry) -> None:
    if entry.text() != FORMAT:
        raise entry.error(f"this is a file of the format `{entry.text()}`, and a protocol says `{FORMAT}`.")


def _check_version(keys: dict[str, Entry]) -> None:
    if "version" not in keys:
        return
    version = keys["version"].number(limits={"minimum": 1})
    if version != VERSION:
        raise keys["version"].error(
            f"the version is {version:g}, and this tumble reads version {VERSION}: install a newer tumble."
        )


def _check_conventions(keys: dict[str, Entry]) -> None:
    for key in ("frame", "angles"):
        sentence = known_keys("protocol")[key].schema["const"]
        if key in keys and keys[key].text() != sentence:
            raise keys[key].error(
                f"`{key}` states another convention than tumble's. Convert the steps to tumble's and remove "
                f'the line, or write: {key}: "{sentence}"'
            )


def _protocol(root: Entry, keys: dict[str, Entry], stem: str) -> Protocol:
    like = _named(keys["like"]) if "like" in keys else None
    text = {key: keys[key].text() for key in keys if keys[key].is_scalar and not keys[key].is_empty}
    # Lists where a text is meant are refused here.
    for key in ("name", "procedure", "description", "units", "columns"):
        if key in keys:
            keys[key].text()
    procedure = text.get("procedure", like.procedure if like else "")
    if not procedure:
        raise root.error("`procedure` is missing: write `procedure: multi-position` or another.")
    if procedure not in KNOWN_PROCEDURES:
        said = nearest(procedure, KNOWN_PROCEDURES)
        known = f" There are {', '.join(KNOWN_PROCEDURES)}." if said.endswith("?") else ""
        raise keys.get("procedure", root).error(f"there is no procedure `{procedure}`: {said}{known}")
    site = _site(root, keys)
    return Protocol(
        name=text.get("name", like.name if like else stem),
        procedure=procedure,
        steps=_steps(root, keys, like),
        site=site,
        description=text.get("description", like.description if like else ""),
        recordings=_recordings(keys),
        units=text.get("units"),
        columns=text.get("columns"),
        rate=_rate(keys["rate_hz"]) if "rate_hz" in keys else None,
    )


def _rate(entry: Entry) -> float:
    """Return a sampling rate, with its uncertainty if the file says it."""
    if not any(sign in entry.text() for sign in ("±", "+-", "+/-")):
        return entry.number(limits={"exclusiveMinimum": 0})
    try:
        return sample_rate(entry.text())
    except UsageError:
        raise entry.error(
            f"`rate_hz` is {entry.text()}: write it as 100, or as 100±0.1 with its standard uncertainty."
        ) from None


def _named(entry: Entry) -> Protocol:
    if entry.text() not in PROTOCOLS:
        raise entry.error(f"there is no named protocol `{entry.text()}`: {nearest(entry.text(), PROTOCOLS)}")
    return named_protocol(entry.text())


def _steps(root: Entry, keys: dict[str, Entry], like: Protocol | None) -> tuple[Step, ...]:
    if like is not None and "steps" in keys:
        raise keys["steps"].error("the steps are those of `like` already: remove one of the two.")
    if like is not None:
        return like.steps
    if "steps" not in keys:
        raise root.error("there are no steps: write `steps:` with at least one, or `like:` a named protocol.")
    return steps_of(keys["steps"])


def _recordings(keys: dict[str, Entry]) -> tuple[str, ...]:
    if "recordings" not in keys or keys["recordings"].is_empty:
        return ()
    names = tuple(entry.text() for entry in keys["recordings"].sequence())
    if not all(names):
        raise keys["recordings"].error("one of the recordings has no name: write it or remove its `- `.")
    for number, name in enumerate(names):
        if name in names[:number]:
            raise keys["recordings"].sequence()[number].error(f"{name} is named twice: remove one.")
    return names


def _site(root: Entry, keys: dict[str, Entry]) -> Site:
    """Return the site of the file, or of its one number for gravity."""
    if "site" in keys and "gravity" in keys:
        raise keys["gravity"].error("write `gravity` below `site`, beside its latitude.")
    if "gravity" in keys:
        return _site_of({"gravity": keys["gravity"]})
    if "site" not in keys:
        raise root.error(
            "the site is missing: write `site:` and below it `latitude_deg: 48.1` and `height_m: 520`, "
            "or write `gravity: 9.81` in m/s² where only that is known."
        )
    outside = {
        key: f"it belongs to the protocol, write `{key}:` without a space before it."
        for key in known_keys("protocol").keys() - known_keys("site").keys()
    }
    found = keys["site"].mapping(known_keys("site"), "a site", outside)
    if "latitude_deg" not in found and "gravity" not in found:
        raise keys["site"].error("write `latitude_deg` below `site`, or `gravity` in m/s².")
    return _site_of(found)


def _site_of(found: dict[str, Entry]) -> Site:
    """Return the site that a file's entries say: gravity as given, else normal gravity."""
    height, latitude, gravity, sigma = (
        found[key].number() if key in found else None
        for key in ("height_m", "latitude_deg", "gravity", "gravity_uncertainty")
    )
    site = None if latitude is None else Site.from_latitude(latitude, height)
    if gravity is not None:
        try:
            site = replace(
                (site or Site.unknown()).with_gravity(Site.from_gravity(gravity, sigma)), height=height
            )
        except SiteError as error:
            raise found["gravity"].error(str(error)) from None
    assert site is not None
    if sigma is not None:
        site = replace(site, gravity_sigma=sigma)
    if "source" in found:
        site = replace(site, source=found["source"].text())
    return site


def protocol_schema() -> dict[str, Any]:
    """Return the JSON schema of a protocol file, for editors that check while one types.

    What depends on more than one step (a spin without a hold before it, intervals that overlap) only the
    reader sees.
    """
    schema: dict[str, Any] = {
        "title": FORMAT,
        **schema_of("protocol"),
        "$defs": {kind: schema_of(kind) for kind in STEPS},
    }
    schema["properties"]["like"]["enum"] = list(PROTOCOLS)
    schema["properties"]["procedure"]["enum"] = list(KNOWN_PROCEDURES)
    schema["properties"]["site"] |= schema_of("site")
    return schema
