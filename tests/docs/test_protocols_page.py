"""The page of protocols: its tables are the reader's keys and the library's; its examples run.

    python tests/docs/test_protocols_page.py

writes the tables anew.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from tumble.protocol import PROTOCOLS, HoldStep, SpinStep, named_protocol, protocol_schema, read_protocol
from tumble.protocol.keys import STEPS, Key, known_keys
from tumble.simulation import play_protocol

KINDS = {kind: known_keys(kind) for kind in STEPS}
ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "protocols.md"
SCHEMA_FILE = ROOT / "docs" / "schema" / "protocol.schema.json"


def blocks(language: str) -> list[re.Match[str]]:
    text = PAGE.read_text(encoding="utf-8")
    return list(re.finditer(rf"^```{language}\n(.*?)^```$", text, re.M | re.S))


def examples(folder: Path) -> list[Path]:
    """The YAML of the page, each as the file that the page calls it."""
    paths = [folder / "plate.yaml", folder / "six.yaml"]
    for path, block in zip(paths, blocks("yaml"), strict=True):
        path.write_text(block[1], encoding="utf-8")
    return paths


def key_table(keys: dict[str, Key]) -> str:
    rows = [
        f"| `{name}` | {key.words}{f' ({key.unit})' if key.unit else ''} | {key.default} |"
        for name, key in keys.items()
    ]
    return "\n".join(["| key | is (unit) | without it |", "|---|---|---|", *rows])


# Keys that every step has stand in one table.
SHARED = {
    name for name, key in KINDS["hold"].items() if all(keys.get(name) == key for keys in KINDS.values())
}

TABLES = {
    "file": lambda: key_table(known_keys("protocol")),
    "site": lambda: key_table(known_keys("site")),
    "step": lambda: key_table({name: KINDS["hold"][name] for name in KINDS["hold"] if name in SHARED}),
    **{
        kind: lambda kind=kind: key_table({n: key for n, key in KINDS[kind].items() if n not in SHARED})
        for kind in KINDS
    },
}


@pytest.mark.parametrize("name", TABLES)
def test_a_table_of_the_page_is_that_of_the_code(name: str) -> None:
    found = re.search(
        rf"<!-- {name}: .*?-->\n(.*?)\n?<!-- /{name} -->", PAGE.read_text(encoding="utf-8"), re.S
    )
    assert found is not None
    assert found[1] == TABLES[name](), "run python tests/docs/test_protocols_page.py"


def test_the_named_protocols_of_the_page_are_those_of_the_library() -> None:
    section = PAGE.read_text(encoding="utf-8").partition("\n## Named protocols")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `([\w-]+)` \| (\d+) \| (\d+|–) \| ([\d.]+) \|", section, re.M)
    assert [row[0] for row in rows] == list(PROTOCOLS)
    for name, poses, spins, minutes in rows:
        protocol = named_protocol(name)
        held = [s.pose for s in protocol.steps if isinstance(s, HoldStep) and s.pose is not None]
        assert len({(*pose.up_b, pose.heading) for pose in held}) == int(poses)
        assert sum(isinstance(s, SpinStep) for s in protocol.steps) == (0 if spins == "–" else int(spins))
        assert float(minutes) == pytest.approx(protocol.duration / 60.0, abs=0.051)  # one decimal


def test_the_examples_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its assertions are worked out by hand on the page, or follow from what the page says."""
    paths = examples(tmp_path)
    monkeypatch.chdir(tmp_path)
    text, names = PAGE.read_text(encoding="utf-8"), dict[str, object]()
    assert sum(block[1].count("assert ") for block in blocks("python")) >= 9
    for block in blocks("python"):
        line = text.count("\n", 0, block.start(1))
        exec(compile("\n" * line + block[1], str(PAGE), "exec"), names)
    for path in paths:
        play_protocol(read_protocol(path), np.random.default_rng(1))


def test_the_published_schema_is_the_reader_s() -> None:
    published = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
    assert published.pop("$schema") == "https://json-schema.org/draft/2020-12/schema"
    published.pop("$comment")
    assert published == protocol_schema(), "run make schema"


if __name__ == "__main__":
    page = PAGE.read_text(encoding="utf-8")
    for name, make in TABLES.items():
        before, opening, rest = page.partition(
            f"<!-- {name}: printed by tests/docs/test_protocols_page.py -->\n"
        )
        _, closing, after = rest.partition(f"<!-- /{name} -->")
        page = f"{before}{opening}{make()}\n{closing}{after}"
    PAGE.write_text(page, encoding="utf-8")
