"""Fixtures ``body`` and ``random``."""

from jointed_body import body, random

__all__ = ["body", "random"]
