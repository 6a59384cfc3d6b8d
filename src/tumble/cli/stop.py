"""What a stop does while Python still imports: it imports nothing itself, for each millisecond counts."""

import os


def stop_at_once(number: int, frame: object) -> None:
    """Say that nothing was changed, and leave.

    Parameters
    ----------
    number, frame : of the signal.
    """
    try:
        os.write(2, b"tumble: Stopped; no file was changed.\n")
    finally:
        os._exit(128 + number)
