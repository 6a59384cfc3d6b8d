"""Files that a user names: opened, read as JSON or YAML, unpacked within limits, and written, each in one way.

Every file of tumble's users comes in through this room: `opened` refuses what is no ordinary file (a pipe, a
device: their bytes can be read once only, or never end), `read_json` and `read_yaml` refuse documents that
would take all memory. What they refuse is an `OSError` or a `ValueError`, which `reading` makes one sentence of.

Every file that tumble writes goes out through it: whole, beside its place and then renamed, never over an input,
a device or a pipe.
"""

from tumble.files.documents import (
    HIDDEN,
    lines_of,
    number_of,
    opened,
    read_json,
    read_text,
    read_yaml,
    reading,
    shown,
    size_of,
    without_password,
)
from tumble.files.writing import (
    GrowingFile,
    check_target,
    files_in_place,
    filled_folder,
    inputs_kept,
    make_folder,
    put_text,
    results_folder,
    temporary_folder,
    write_text,
    write_texts,
    written_beside,
)

__all__ = [
    "HIDDEN",
    "GrowingFile",
    "check_target",
    "files_in_place",
    "filled_folder",
    "inputs_kept",
    "lines_of",
    "make_folder",
    "number_of",
    "opened",
    "put_text",
    "read_json",
    "read_text",
    "read_yaml",
    "reading",
    "results_folder",
    "shown",
    "size_of",
    "temporary_folder",
    "without_password",
    "write_text",
    "write_texts",
    "written_beside",
]
