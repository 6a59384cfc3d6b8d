"""The unit that is exported: asymmetric matrices, so that a transposed or an inverted one fails."""

from __future__ import annotations

import numpy as np

from tumble.document.imported import calibration_from_model
from tumble.document.result import Calibration
from tumble.sensor import ImuModel

M_A = np.array([[1.012, 0.004, -0.007], [-0.009, 0.991, 0.006], [0.003, -0.012, 1.021]])
M_G = np.array([[0.985, -0.011, 0.008], [0.006, 1.017, -0.004], [-0.013, 0.005, 1.008]])
B_A, B_G = np.array([0.11, -0.23, 0.34]), np.array([0.012, -0.034, 0.021])
G = np.array([[1.1e-3, -4e-4, 2e-4], [3e-4, -9e-4, 6e-4], [-7e-4, 5e-4, 8e-4]])
RAW_A = np.array([[1.0, 2.0, 9.5], [-8.0, 3.0, -4.0], [0.3, -9.9, 1.2], [5.0, 5.0, 5.0]])
RAW_G = np.array([[0.1, -0.2, 0.3], [-1.5, 0.7, 0.2], [0.0, 2.0, -1.0], [0.4, 0.4, 0.4]])


def document(model: ImuModel, units: tuple[str, str] = ("m/s^2", "rad/s")) -> Calibration:
    return calibration_from_model(model, units, ("fixture", "its axes"), [], procedure="by hand", remarks=[])
