"""What a calibration looks like to its user: the terminal's table and the HTML report.

Nothing is estimated here. Non-SI units appear: this room writes numbers in the units people use.
"""

from __future__ import annotations
