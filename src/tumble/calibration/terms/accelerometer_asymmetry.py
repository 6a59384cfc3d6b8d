"""Asymmetries of the accelerometers: half of the relative difference of the scale factors for both signs."""

from tumble.calibration.terms.term import curve_term

TERM = curve_term(
    "accelerometer",
    "asymmetry",
    words="asymmetries of the accelerometers",
    tried="always",
    label="asymmetry of accelerometer {}",
    remedy="holds with {} up, down and level",
    plate=0.01,
    shown_by="force",
    gives_way=0,
)
