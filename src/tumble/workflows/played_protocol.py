"""Which protocol a simulation plays: a named one, a file's, or a unit that lies still."""

from __future__ import annotations

import difflib
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

from tumble.errors import UsageError
from tumble.workflows.protocols import read_given_protocol

if TYPE_CHECKING:
    from tumble.protocol import Protocol

REST_SECONDS = 600.0
"""What a unit at rest is recorded where nobody says how long."""


def read_played(protocol: str | os.PathLike[str], duration: float | None = None) -> Protocol:
    """Return the protocol that is to be played: a named one, a file's, or a unit that lies still.

    Parameters
    ----------
    protocol : a file, or a name; "rest" lies still for its noise.
    duration : s, of a rest; None takes ten minutes.

    Raises
    ------
    UsageError, ProtocolError
        If there is no such protocol, or a duration is given that is none or not a rest's.
    """
    from tumble.protocol import PROTOCOLS
    from tumble.protocol.library import REST, rest_protocol

    name = str(protocol)
    # A folder of that name is what an earlier simulation wrote, and no protocol.
    if name == REST and not Path(name).is_file():
        seconds = REST_SECONDS if duration is None else duration
        if not 1.0 <= seconds < math.inf:
            raise UsageError(f"--duration {seconds:g}: give at least one second.")
        return rest_protocol(seconds)
    if duration is not None:
        raise UsageError(
            f"--duration is for a unit at rest: `tumble simulate {REST} --duration {duration:g}`."
        )
    if name not in PROTOCOLS and not Path(name).exists() and Path(name).suffix not in (".yaml", ".yml"):
        near = difflib.get_close_matches(name.lower(), [*PROTOCOLS, REST], 1)
        meant = f" Did you mean {near[0]}?" if near else ""
        raise UsageError(
            f"There is no protocol {name!r}: give a protocol file, or one of {', '.join(PROTOCOLS)}, {REST}.{meant}"
        )
    return read_given_protocol(protocol).protocol


__all__ = ["REST_SECONDS", "read_played"]
