"""Measurements and the recordings they need; neither shipped nor tested. Run one as python -m benchmarks.NAME."""
