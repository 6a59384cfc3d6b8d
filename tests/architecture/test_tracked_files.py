"""Nothing that is committed knows the machine that it was written on, or where packages come from."""

import re
import subprocess

import pytest

HOME = re.compile(r"(?<![\w.])/(root|work|opt|home/\w+|Users/\w+)/")
INDEX = re.compile(
    r"""(registry|resolved|(extra-)?index(_url|-url)?|find-links)"?\s*[:=\s]\s*\{?\s*"?(registry\s*=\s*"?)?(https?|file)://"""
)


@pytest.fixture(scope="module")
def tracked_texts(root):
    """The text of every tracked file, binary ones left out."""
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, text=True, check=False)
    if listing.returncode:
        pytest.fail("This test reads what git tracks: run it in a clone.")
    texts: dict[str, str] = {}
    for name in filter(None, listing.stdout.split("\0")):
        data = (root / name).read_bytes() if (root / name).is_file() else b"\0"
        if b"\0" not in data:
            texts[name] = data.decode("utf-8", errors="replace")
    return texts


def test_no_tracked_file_names_a_path_of_a_machine_or_a_package_index(tracked_texts):
    assert "uv.lock" not in tracked_texts
    assert not [name for name, text in tracked_texts.items() if HOME.search(text) or INDEX.search(text)]


def test_the_locks_hold_hashes_and_no_address(root):
    for name in ("run.txt", "dev.txt"):
        lines = (root / "requirements" / name).read_text().splitlines()
        pins = [line for line in lines if not line.startswith(" ")]
        assert pins
        assert all(re.match(r"[a-z0-9-]+==[\w.]+( ; .+)? \\$", pin) for pin in pins)
        assert "://" not in "".join(lines)
        assert sum("--hash=sha256:" in line for line in lines) >= len(pins)


@pytest.mark.parametrize("text", ["x /" + "home/anna/data", '"/' + 'root/.venv"'])
def test_a_path_of_a_machine_is_found(text):
    assert HOME.search(text)


@pytest.mark.parametrize("text", ['registry = "https' + '://x"', "--index-url https" + "://x"])
def test_an_address_of_a_package_index_is_found(text):
    assert INDEX.search(text)
