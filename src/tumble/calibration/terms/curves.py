"""Asymmetries and quadratic terms: the curves that each sensor of a triad has for itself.

An asymmetry is half of the relative difference of the scale factors for both signs, or both ways round. A quadratic
term is the squared own input beside it; of gyros turns at several rates show it.
"""

from tumble.calibration.terms.term import curve_term

TERMS = (
    curve_term(
        "accelerometer",
        "asymmetry",
        words="asymmetries of the accelerometers",
        tried="always",
        label="asymmetry of accelerometer {}",
        remedy="holds with {} up, down and level",
        plate=0.01,
        shown_by="force",
        gives_way=0,
    ),
    curve_term(
        "gyroscope",
        "asymmetry",
        words="asymmetries of the gyros",
        tried="with gyros",
        label="asymmetry of gyro {}",
        remedy="turns both ways about {}",
        plate=0.01,
        shown_by="gyro",
        gives_way=1,
    ),
    curve_term(
        "gyroscope",
        "quadratic",
        words="quadratic terms of the gyros",
        tried="where a table turns at several rates both ways",
        label="quadratic term of gyro {}",
        remedy="turns about {} at several rates, both ways",
        plate=1e-3,
        shown_by="table",
        gives_way=5,
    ),
    curve_term(
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
    ),
)
