"""Fixtures ``body`` and ``random``."""

from helpers.jointed_body import body, random

__all__ = ["body", "random"]
