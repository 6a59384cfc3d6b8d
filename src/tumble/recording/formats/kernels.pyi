# Types for callers: the source has those of C.

import numpy as np
import numpy.typing as npt

def parse_rows(
    text: npt.NDArray[np.uint8],
    delimiter: int,
    skipped: npt.NDArray[np.uint8],
    table: npt.NDArray[np.float64],
) -> int: ...
