"""Text from files: its lines, and the characters in it that nobody sees."""

from __future__ import annotations

import re

HIDDEN = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters, separators of lines, marks that turn the direction of writing, halves of characters."""
# A user with a password, as a URL has them: also where its scheme was left out.
_SECRET = re.compile(r"(?<=://)[^\s/'\"@]+@|[^\s/'\"@:]+:[^\s/'\"@]+@")


def shown(text: str) -> str:
    """Return a text on one line, each hidden character as its number.

    Examples
    --------
    >>> shown("MPU-9250")
    'MPU-9250'
    >>> shown("a" + chr(10) + "b")
    'a<U+000A>b'
    """
    return HIDDEN.sub(lambda match: f"<U+{ord(match[0]):04X}>", text)


def without_password(text: str) -> str:
    """Return a text whose URLs have no user and password.

    Examples
    --------
    >>> without_password("tcp://me:secret@host:8786 does not answer")
    'tcp://***@host:8786 does not answer'
    """
    return _SECRET.sub("***@", text)


def lines_of(text: str) -> list[str]:
    """Return the lines of a text, which end with LF, CR LF or CR.

    `str.splitlines` also ends lines at form feeds, vertical tabs, U+0085 and U+2028, as no table and no editor does.
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return lines[:-1] if lines and not lines[-1] else lines
