"""Asymmetries of the gyros: half of the relative difference of the scale factors for both ways round."""

from tumble.calibration.terms.term import curve_term

TERM = curve_term(
    "gyroscope",
    "asymmetry",
    words="asymmetries of the gyros",
    tried="with gyros",
    label="asymmetry of gyro {}",
    remedy="turns both ways about {}",
    plate=0.01,
    shown_by="gyro",
    gives_way=1,
)
