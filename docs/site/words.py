"""The rules of `docs/style.md` that a program can check: over every message of the source and every page.

`python docs/site/words.py` lists what breaks a rule and ends with 1; `--readability` prints how the pages read.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 30
"""Words of a sentence."""
LONG_SHARE = 0.035
"""Of a page's sentences outside the first hour may be longer: they are formulas and lists of figures in prose."""
WORDS_A_PAGE = 900
"""On average, tables and examples counted: a page that grows has something that another page says, or its output."""

# What is read before the first calibration is trusted: every sentence is held to the limit there.
FIRST_HOUR = (
    *(
        "README.md",
        "docs/index.md",
        "docs/style.md",
        "docs/start/*.md",
        "docs/tutorials/*.md",
        "docs/capture.md",
    ),
    *("docs/commands.md", "docs/glossary.md", "docs/inspect.md", "docs/plan.md", "docs/python.md"),
    *("docs/report.md", "docs/registry.md", "docs/certificate.md"),
)
# Generated from the modules' openings, and by `make docs`.
GENERATED = ("docs/architecture.md", "docs/reference/**/*.md")

_SAYING = r"\b(?:fore)?(?:tells?|told|telling)\b"
_INVERTED = (
    r"(?:^|(?<=[.:;?!] ))(?:Not |Also )?[A-Z][a-z]+(?:ed|wn|ound|ept|eft|ven|aid) (?:is|are|was|were) "
    r"(?!by |in |at |on |with |from |to |for )"
)
_IDLE = r"\b(?:simply|obviously|of course|in order to|please|utili[sz]\w+|hitherto|whilst|thereof|herein)\b"
RULES = (
    (re.compile(_SAYING, re.I), "a recording determines, a message states, a figure shows, a plan predicts"),
    (re.compile(_INVERTED), "the subject comes first"),
    (re.compile(_IDLE, re.I), "leave the word out"),
)


@dataclass(frozen=True, slots=True)
class Finding:
    """A rule that a sentence breaks.

    Attributes
    ----------
    place : file and line.
    rule : in words.
    sentence : as it stands.
    """

    place: str
    rule: str
    sentence: str

    def __str__(self) -> str:
        return f"{self.place}: {self.rule}: {self.sentence}"


def count_words(sentence: str) -> int:
    """Return how many words a sentence has; a link counts by its text, an operator or a dash not at all."""
    text = re.sub(r"\]\([^)\s]*\)", "]", sentence)
    return sum(bool(re.search(r"\w", word)) for word in text.split())


def sentences_of(text: str) -> list[str]:
    """Return the sentences of a paragraph."""
    return [one for one in re.split(r"(?<=[.?!])[)\"*]*\s+(?=\S)|\n\s*\n|\n(?=#)", text.strip()) if one]


def messages_of(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and text of every string that may be printed; what an f-string fills in is one word.

    Docstrings are not printed. A template of source code is no prose: it has lines that end as code does. An equation
    is no sentence either, but what stands after its semicolon is.
    """
    tree = ast.parse(source)
    silent = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for line, text in _strings(tree, silent):
        if len(text.split()) < 3 or re.search(r"[;{}]\s*$|^\s*(?:def|import|from) \w", text, re.M):
            continue
        if text.count(" = ") > 1 or re.match(
            r"\S+ = ", text
        ):  # a formula in clauses, each of which is read by itself
            text = re.sub(r"[^;]* = [^;]*(?:;|$)", " ", text).replace(";", ".")
        yield line, text


def helps_of(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and paragraphs of every docstring that `--help` prints: of commands, by their names."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef) and node.name.endswith("_command"):
            for paragraph in re.split(r"\n\s*\n", ast.get_docstring(node) or ""):
                if not paragraph.startswith("tumble "):
                    yield node.lineno, " ".join(paragraph.split())


def _strings(node: ast.AST, silent: set[int]) -> Iterator[tuple[int, str]]:
    if isinstance(node, ast.JoinedStr):
        parts = [str(part.value) if isinstance(part, ast.Constant) else "1" for part in node.values]
        yield node.lineno, "".join(parts)
        for part in node.values:
            if isinstance(part, ast.FormattedValue):
                yield from _strings(part.value, silent)
        return
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in silent:
        yield node.lineno, node.value
    for child in ast.iter_child_nodes(node):
        yield from _strings(child, silent)


def prose_of(page: str) -> list[str]:
    """Return the paragraphs, headings, entries of lists and cells of tables of a page, without code and formulas."""
    text = re.sub(r"(?s)<!--.*?-->|\$\$.*?\$\$", "", page)
    text = re.sub(r"(?ms)^```.*?^```\s*$", "\n\n", text)
    text = re.sub(r"(?m)^(?: {4}|\t).*$", "\n", text)
    paragraphs: list[str] = []
    for block in re.split(r"\n\s*\n|\n(?=\s*[-*•] |\d+\. |#|\|)", text):
        words = " ".join(block.split())
        if words.startswith("|"):
            paragraphs += [cell.strip() for cell in words.strip("|").split(" | ")]
        elif words:
            paragraphs.append(words.lstrip("#-*• "))
    return [one for one in paragraphs if re.search(r"\w", one)]


def judge(text: str, place: str, longest: int | None = LONGEST) -> list[Finding]:
    """Return what breaks a rule in a paragraph, as it stands.

    >>> [one.rule for one in judge("Printed are the names.", "here")]
    ['the subject comes first']
    """
    found: list[Finding] = []
    for sentence in sentences_of(text):
        plain = re.sub(r"`[^`]*`", "`…`", sentence)
        found += [Finding(place, rule, sentence) for pattern, rule in RULES if pattern.search(plain)]
        if longest is not None and count_words(sentence) > longest:
            found.append(Finding(place, f"{count_words(sentence)} words, {longest} at most", sentence))
    return found


def judge_messages() -> list[Finding]:
    """Return what breaks a rule in the strings of the source, and in the docstrings that are the help of commands."""
    found: list[Finding] = []
    for path in sorted((ROOT / "src").rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        texts = [*messages_of(source), *(helps_of(source) if "cli" in path.parts else ())]
        for line, text in texts:
            found += judge(text, f"{path.relative_to(ROOT).as_posix()}:{line}")
    # What stands in the tables of protocols is printed, too: a text in each line, after its key.
    for path in sorted(
        path for end in ("json", "yaml") for path in (ROOT / "src/tumble/protocol").glob(f"*.{end}")
    ):
        for line, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            said = "" if text.lstrip().startswith("#") else text.partition(": ")[2].strip("'\", ")
            found += judge(said, f"{path.relative_to(ROOT).as_posix()}:{line}")
    return found


def pages() -> list[Path]:
    """Return the pages that are held to the rules."""
    out = {path for pattern in GENERATED for path in ROOT.glob(pattern)}
    return sorted({ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")} - out)


def judge_pages() -> list[Finding]:
    """Return what breaks a rule in the pages; sentences are measured where the first hour is spent."""
    first = {path for pattern in FIRST_HOUR for path in ROOT.glob(pattern)}
    found: list[Finding] = []
    for path in pages():
        # The page of style shows what not to write in the left column of its table.
        text = path.read_text(encoding="utf-8")
        if path.name == "style.md":
            text = re.sub(r"(?m)^\| .*\|$", "", text)
        for paragraph in prose_of(text):
            place = path.relative_to(ROOT).as_posix()
            found += judge(paragraph, place, LONGEST if path in first else None)
    return found


def readability() -> dict[str, float]:
    """Return how the pages read: words a page and a sentence, share of long sentences, of pages with an example."""
    texts = [path.read_text(encoding="utf-8") for path in pages()]
    lengths = [
        words
        for text in texts
        for paragraph in prose_of(text)
        for sentence in sentences_of(paragraph)
        if (words := count_words(sentence)) > 2
    ]
    runnable = [bool(re.search(r"(?m)^```(?:console|python)|^    (?:tumble|\$) ", text)) for text in texts]
    return {
        "pages": len(texts),
        "words a page": sum(len(text.split()) for text in texts) / len(texts),
        "words a sentence": sum(lengths) / len(lengths),
        "long sentences, %": 100.0 * sum(n > LONGEST for n in lengths) / len(lengths),
        "pages with an example that runs, %": 100.0 * sum(runnable) / len(runnable),
    }


def main(arguments: list[str]) -> int:
    """Print what breaks a rule, or how the pages read."""
    if arguments == ["--readability"]:
        for name, value in readability().items():
            print(f"{name:36} {value:8.1f}")
        return 0
    found = [*judge_messages(), *judge_pages()]
    print(*found, sep="\n", end="\n" if found else "")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
