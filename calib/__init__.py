"""Calibration: the T-pose of a person, subject files; joint zeros of a robot."""
