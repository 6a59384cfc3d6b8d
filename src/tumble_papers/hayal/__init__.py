"""Hayal (2010): multi-position calibration by Gauss-Helmert adjustment, laboratory tests, a field campaign."""
