"""Messages that others of the same length take the place of, one after another as they stand in the file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field

from tumble.errors import RecordingError
from tumble.records import dataclass


@dataclass(slots=True)
class Exchange:
    """What is exchanged in a bag.

    Attributes
    ----------
    name : of the bag, for messages.
    marks : identities of the calibrations that each exchanged topic has gone through then.
    pairs : topic, message as it was and as it becomes, in the order of the file.
    count : messages exchanged so far.
    """

    name: str
    marks: Mapping[str, Sequence[str]]
    pairs: Iterator[tuple[str, bytes, bytes]]
    count: int = field(default=0)

    def of(self, topic: str, data: bytes) -> bytes:
        """Return what takes the place of the next message.

        Parameters
        ----------
        topic, data : of the message.

        Raises
        ------
        RecordingError
            If it is not the message that was corrected.
        """
        expected, before, after = next(self.pairs, ("", b"", b""))
        if expected != topic or before != data or len(after) != len(data):
            raise RecordingError(
                f"{self.name} cannot be copied: its messages come in another order the second time. It was written "
                "to meanwhile, or its index is wrong: repair it first (rosbag reindex, mcap recover)."
            )
        self.count += 1
        return after

    def finish(self) -> None:
        """Make sure that nothing that was corrected is missing.

        Raises
        ------
        RecordingError
            If it is.
        """
        if next(self.pairs, None) is not None:
            raise RecordingError(
                f"{self.name} cannot be copied: some of its messages stand where its index does not lead. Repair it "
                "first (rosbag reindex, mcap recover)."
            )
