"""A hundred and fifty changed files, and all that were findings once: each is a result or a sentence."""

from pathlib import Path

import pytest
from tests.fuzz.cases import READERS, Case, case_of, found, outcome
from tests.fuzz.seeds import seeds


@pytest.mark.parametrize("part", range(3))
def test_a_changed_file_is_read_or_refused_in_a_sentence(part: int) -> None:
    wrong = {number: outcome(case_of(number)) for number in range(50 * part, 50 * (part + 1))}
    assert {number: what for number, what in wrong.items() if what is not None} == {}


def test_what_was_found_once_is_not_found_again() -> None:
    wrong = {f"{n}: {case.kind} {case.name}": outcome(case) for n, case in enumerate(found())}
    assert {name: what for name, what in wrong.items() if what is not None} == {}


def test_the_sound_files_are_read(tmp_path: Path) -> None:
    """A seed that is refused would test nothing."""
    for kind, files in seeds().items():
        for name, content in files if kind not in ("call", "work") else ():
            file = tmp_path / Path(name).name
            file.write_bytes(content)
            READERS[kind](file, Case(kind, name, content))


def test_a_case_is_the_same_every_time() -> None:
    assert [case_of(n) for n in range(20)] == [case_of(n) for n in range(20)]
