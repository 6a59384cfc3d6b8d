"""Quadratic terms of the accelerometers: the squared own input beside it."""

from tumble.calibration.terms.term import curve_term

TERM = curve_term(
    "accelerometer",
    "quadratic",
    name="quadratic",
    words="quadratic terms of the accelerometers",
    tried="always",
    label="quadratic term of accelerometer {}",
    remedy="a hold with {0} up and one with {0} down",
    plate=1e-3,
    shown_by="force",
    gives_way=6,
)
