# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Indices: TypeAlias = npt.NDArray[np.int64]

def whiten(covariance: Floats, given: list[Floats], root: Floats, white: list[Floats]) -> int: ...
def add_to_nodes(
    node: Indices,
    residual: Floats,
    columns: Indices,
    by_border: Floats,
    by: Floats,
    by_before: Floats,
    gradient: Floats,
    border: Floats,
    diagonal: Floats,
    lower: Floats,
) -> None: ...
def add_to_border(
    chain: Indices, residual: Floats, columns: Indices, by_border: Floats, corner: Floats, gradient: Floats
) -> None: ...
def add_squares(
    chain: Indices, columns: Indices, square: Floats, right: Floats, corner: Floats, gradient: Floats
) -> None: ...
def eliminate(diagonal: Floats, lower: Floats, border: Floats, gradient: Floats) -> int: ...
def substitute(
    diagonal: Floats, lower: Floats, border: Floats, gradient: Floats, corner_step: Floats, steps: Floats
) -> None: ...
def solve_chain(diagonal: Floats, lower: Floats, solution: Floats) -> None: ...
def invert_selected(
    diagonal: Floats,
    lower: Floats,
    border: Floats,
    corner_covariance: Floats,
    own: Floats,
    following: Floats,
    with_border: Floats,
) -> None: ...
