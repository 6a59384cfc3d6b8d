"""The documentation is true: links lead somewhere, make targets exist, worked examples run."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# `make docs` writes some more into docs/reference, which Sphinx checks.
PAGES = sorted(
    page
    for page in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    if ROOT / "docs" / "reference" not in page.parents
)

# Pages whose Python runs here, and how many assertions each has at least.
EXECUTED = {
    "README.md": 1,
    "docs/conventions.md": 6,
    "docs/file-format.md": 9,
    "docs/magnetometer.md": 1,
    "docs/navigation.md": 2,
    "docs/plan.md": 2,
    "docs/noise.md": 3,
    "docs/noise-models.md": 5,
    "docs/poses.md": 3,
    "docs/python.md": 2,
    "docs/real-recordings.md": 2,
    "docs/simulation.md": 2,
    "docs/thermal.md": 4,
}

FENCED = re.compile(r"^```.*?^```$", re.M | re.S)
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def label(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def anchors_of(page: Path) -> set[str]:
    """The anchors of a page's headings, as code hosts make them."""
    headings = re.findall(r"^#+ (.+)$", FENCED.sub("", page.read_text(encoding="utf-8")), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def leads_nowhere(page: Path, link: str) -> bool:
    """Whether a link to a file of this repository, or to a heading in it, has no such end."""
    if re.match(r"[a-z]+:", link):
        return False  # an address elsewhere: tests use no network
    path, _, anchor = link.partition("#")
    end = (page.parent / path).resolve() if path else page
    return not end.exists() or (bool(anchor) and anchor not in anchors_of(end))


@pytest.mark.parametrize("page", PAGES, ids=label)
def test_every_link_leads_somewhere(page: Path) -> None:
    links = LINK.findall(FENCED.sub("", page.read_text(encoding="utf-8")))
    assert not [link for link in links if leads_nowhere(page, link)]


def test_a_link_to_nothing_is_found() -> None:
    assert leads_nowhere(ROOT / "README.md", "docs/no-such-page.md")
    assert leads_nowhere(ROOT / "README.md", "docs/conventions.md#no-such-heading")
    assert not leads_nowhere(ROOT / "README.md", "docs/conventions.md#the-one-model")


@pytest.mark.parametrize("page", PAGES, ids=label)
def test_every_make_target_that_is_mentioned_exists(page: Path) -> None:
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.M))
    text = page.read_text(encoding="utf-8")
    mentioned = set(re.findall(r"(?:`|^ {4}|^\$ )make ([a-z]+)\b", text, re.M))
    assert mentioned <= targets


@pytest.mark.parametrize(("name", "assertions"), EXECUTED.items())
def test_the_code_of_a_page_runs(name, assertions, tmp_path, monkeypatch):
    """Its assertions are worked out by hand on the page, or follow from what the page says."""
    page = ROOT / name
    text = page.read_text(encoding="utf-8")
    blocks = list(re.finditer(r"^```python\n(.*?)^```$", text, re.M | re.S))
    assert sum(block[1].count("assert ") for block in blocks) >= assertions
    # Pages that read the repository's reference data run where it is; the others write where they run.
    reads = any("tests/reference" in block[1] for block in blocks)
    monkeypatch.chdir(ROOT if reads else tmp_path)
    names: dict[str, object] = {}
    for block in blocks:
        line = text.count("\n", 0, block.start(1))
        exec(compile("\n" * line + block[1], str(page), "exec"), names)


def test_every_page_can_be_reached_from_the_first() -> None:
    seen: set[Path] = set()
    pending = [ROOT / "README.md"]
    while pending:
        page = pending.pop()
        if page in seen or not page.exists():
            continue
        seen.add(page)
        if page.is_dir():
            pending.extend(page.rglob("*.md"))
        elif page.suffix == ".md":
            links = LINK.findall(FENCED.sub("", page.read_text(encoding="utf-8")))
            pending.extend(
                (page.parent / link.partition("#")[0]).resolve() for link in links if ":" not in link
            )
    unreachable = {label(page) for page in PAGES} - {label(page) for page in seen} - {"CHANGELOG.md"}
    assert not unreachable
