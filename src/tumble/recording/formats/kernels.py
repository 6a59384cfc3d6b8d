"""Rows of numbers in text, compiled: what any logger writes, and nothing else."""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import NAN, fabs, fma

_SPACE = cython.declare(cython.uchar, 32)
_TAB = cython.declare(cython.uchar, 9)
_RETURN = cython.declare(cython.uchar, 13)
_LINE = cython.declare(cython.uchar, 10)


def parse_rows(
    text: cython.const[cython.uchar][::1],
    delimiter: cython.int,
    skipped: cython.const[cython.uchar][::1],
    table: cython.double[:, ::1],
) -> int:
    """Fill rows with the numbers of a text whose last character ends a line; return how many rows there are.

    `delimiter` is a character, or 0 for any run of spaces and tabs; `skipped` has a one for each column that is passed
    over. An empty cell is not a number, and lines that are empty or begin with #, %, ! or // are none. Returned is -1
    where anything else stands, a row is short or long, or a number has more digits than can be rounded correctly here.
    """
    with cython.nogil:
        rows = _parse(text, delimiter, skipped, table)
    return int(rows)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.locals(sign=cython.uchar)
def _parse(
    text: cython.const[cython.uchar][::1],
    delimiter: cython.int,
    skipped: cython.const[cython.uchar][::1],
    table: cython.double[:, ::1],
) -> cython.Py_ssize_t:
    """Return the rows, or -1."""
    powers = cython.declare(cython.double[23])
    place = cython.declare(cython.Py_ssize_t[1])
    number = cython.declare(cython.double[1])
    powers[0] = 1.0
    for k in range(22):
        powers[k + 1] = 10.0 * powers[k]
    columns, row = skipped.shape[0], 0
    place[0] = 0
    while True:
        _pass_space(text, delimiter, place)
        if place[0] >= text.shape[0]:
            return row
        sign = text[place[0]]
        if sign == _LINE:
            place[0] += 1
            continue
        if sign == 35 or sign == 37 or sign == 33 or (sign == 47 and text[place[0] + 1] == 47):
            _pass_line(text, place)
            continue
        if row == table.shape[0]:
            return -1
        for column in range(columns):
            if skipped[column]:
                while text[place[0]] != delimiter and text[place[0]] != _LINE:
                    place[0] += 1
            elif (delimiter or text[place[0]] != _LINE) and _parse_number(text, place, powers, number):
                table[row, column] = number[0]
            else:
                return -1
            _pass_space(text, delimiter, place)
            if column + 1 < columns and delimiter:
                if text[place[0]] != delimiter:
                    return -1
                place[0] += 1
                _pass_space(text, delimiter, place)
        if text[place[0]] == 35:
            _pass_line(text, place)
        elif text[place[0]] == _LINE:
            place[0] += 1
        else:
            return -1
        row += 1


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _pass_space(
    text: cython.const[cython.uchar][::1], delimiter: cython.int, place: cython.p_Py_ssize_t
) -> cython.void:
    """Go to the next character that is no space, nor a tab that parts no cells; at the end of the text, there."""
    while place[0] < text.shape[0]:
        sign = text[place[0]]
        if sign != _SPACE and sign != _RETURN and (sign != _TAB or delimiter == _TAB):
            return
        place[0] += 1


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _pass_line(text: cython.const[cython.uchar][::1], place: cython.p_Py_ssize_t) -> cython.void:
    """Go to the beginning of the next line."""
    while text[place[0]] != _LINE:
        place[0] += 1
    place[0] += 1


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
@cython.locals(
    mantissa=cython.ulonglong,
    digit=cython.uchar,
    sign=cython.uchar,
    fall=cython.uchar,
    exponent=cython.int,
    written=cython.int,
)
def _parse_number(
    text: cython.const[cython.uchar][::1],
    place: cython.p_Py_ssize_t,
    powers: cython.p_double,
    number: cython.p_double,
) -> cython.bint:
    """Read the number at a place and go beyond it; say whether there is one, or an empty cell.

    The digits are a whole number below 2^64, as two doubles. By a power of ten up to the 22nd, which is a double, it
    is divided or multiplied to twice the precision; if an error in the last places could change the double that is
    nearest to it, that is refused.
    """
    at, mantissa, exponent = place[0], 0, 0
    sign = text[at]
    if sign == 45 or sign == 43:
        at += 1
    begin = at
    while text[at] == 48:
        at += 1
    # Zeros before the first other digit are digits, and add none to the whole number.
    zeros, first = at - begin, at
    digit = text[at] - 48
    while digit < 10:
        mantissa = 10 * mantissa + digit
        at += 1
        digit = text[at] - 48
    digits = at - first
    if text[at] == 46:
        at += 1
        first = at
        if digits == 0:
            while text[at] == 48:
                at += 1
            zeros += at - first
        digits -= at - first
        digit = text[at] - 48
        while digit < 10:
            mantissa = 10 * mantissa + digit
            at += 1
            digit = text[at] - 48
        exponent = first - at
        digits += at - first
    if digits + zeros == 0 or digits > 19:
        number[0] = NAN
        # Nothing at all is an empty cell; a sign or a point alone is none.
        return digits + zeros == 0 and at == place[0]
    if text[at] == 101 or text[at] == 69:
        at += 1
        fall = text[at]
        if fall == 45 or fall == 43:
            at += 1
        first, written = at, 0
        digit = text[at] - 48
        while digit < 10 and at - first < 4:
            written = 10 * written + digit
            at += 1
            digit = text[at] - 48
        if at == first:
            return False
        exponent += -written if fall == 45 else written
    if exponent < -22 or exponent > 22:
        return False
    place[0] = at
    high = cython.cast(cython.double, mantissa)
    if high < 9007199254740992.0:
        value = high / powers[-exponent] if exponent < 0 else high * powers[exponent]
    else:
        low = cython.cast(
            cython.double, cython.cast(cython.longlong, mantissa - cython.cast(cython.ulonglong, high))
        )
        if exponent < 0:
            first_part = high / powers[-exponent]
            rest = (fma(-first_part, powers[-exponent], high) + low) / powers[-exponent]
        else:
            first_part = high * powers[exponent]
            rest = fma(high, powers[exponent], -first_part) + low * powers[exponent]
        value = first_part + rest
        doubt = fabs(first_part) * 7.9e-31  # 2^-100
        if first_part + (rest + doubt) != value or first_part + (rest - doubt) != value:
            return False
    number[0] = -value if sign == 45 else value
    return True


__all__ = ["parse_rows"]
