"""Files that a user names: opened in one way, read as JSON or YAML in one way, unpacked within limits.

Every file of tumble's users comes in through this room: `opened` refuses what is no ordinary file (a pipe, a
device: their bytes can be read once only, or never end), `read_json` and `read_yaml` refuse documents that
would take all memory, `copied` unpacks no more than a limit. What they refuse is an `OSError` or a `ValueError`
whose words end a sentence that the caller begins with the file's name.
"""

from tumble.files.documents import read_json, read_yaml
from tumble.files.numbers import number_of
from tumble.files.opening import opened, read_text, size_of
from tumble.files.text import HIDDEN, lines_of, shown

__all__ = [
    "HIDDEN",
    "lines_of",
    "number_of",
    "opened",
    "read_json",
    "read_text",
    "read_yaml",
    "shown",
    "size_of",
]
