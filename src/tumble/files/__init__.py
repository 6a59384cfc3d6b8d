"""Files that a user names: opened, read as JSON or YAML, unpacked within limits, and written, each in one way.

Every file of tumble's users comes in through this room: `opened` refuses what is no ordinary file (a pipe, a
device: their bytes can be read once only, or never end), `read_json` and `read_yaml` refuse documents that
would take all memory. What they refuse is an `OSError` or a `ValueError`, which `reading` makes one sentence of.

Every file that tumble writes goes out through it: whole, beside its place and then renamed, never over an input,
a device or a pipe.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
