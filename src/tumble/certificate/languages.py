"""The words of a certificate in its languages; a term that a language lacks here stays English."""

from __future__ import annotations

from importlib.resources import files

LANGUAGES = {"en": "English", "de": "German", "fr": "French", "es": "Spanish", "zh": "Chinese"}
# Which write a comma where English has a point.
DECIMAL_COMMA = ("de", "fr", "es")

_ORDER = ("en", "de", "fr", "es", "zh")


def _read() -> str:
    """A phrase a line: its key, then itself in each language."""
    return (files("tumble.certificate") / "templates" / "phrases.txt").read_text(encoding="utf-8")


PHRASES: dict[str, dict[str, str]] = {
    key: dict(zip(_ORDER, (word.strip(" ​") for word in words), strict=True))
    for key, *words in (line.split("|") for line in _read().strip().splitlines())
}


def phrases(language: str) -> dict[str, str]:
    """Return all phrases in a language, by key.

    Parameters
    ----------
    language : of `LANGUAGES`.
    """
    return {key: words[language] for key, words in PHRASES.items()}


def parameter_words(name: str, language: str) -> str:
    """Return what a parameter without its triad is called, its axis behind.

    Parameters
    ----------
    name : as a calibration has it, without accelerometer or gyro in front.
    language : of `LANGUAGES`.
    """
    for key in sorted(PHRASES, key=len, reverse=True):
        if name == key or name.startswith(f"{key} "):
            return f"{PHRASES[key][language]}{name[len(key) :].replace(' to force ', ' ← ')}"
    return name
