"""Inertial sensors in the cameras: samples, their calibration, and the motion between two stamps."""
