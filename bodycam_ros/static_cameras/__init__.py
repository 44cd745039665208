"""Cameras that stand around the body: regions, surfaces, where they stand (B 2)."""
