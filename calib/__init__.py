"""Calibration: the T-pose of a person, subject files."""
