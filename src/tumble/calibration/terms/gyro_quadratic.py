"""Quadratic terms of the gyros: the squared own input beside it, as turns at several rates show it."""

from tumble.calibration.terms.term import curve_term

TERM = curve_term(
    "gyroscope",
    "quadratic",
    words="quadratic terms of the gyros",
    tried="where a table turns at several rates both ways",
    label="quadratic term of gyro {}",
    remedy="turns about {} at several rates, both ways",
    plate=1e-3,
    shown_by="table",
    gives_way=5,
)
