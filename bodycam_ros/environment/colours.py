"""Colours as they are written, and as light."""

GAMMA = 2.2
"""Exponent from values of a picture to light."""


def linear(colour: str) -> tuple[float, ...]:
    """Red, green and blue, linear in light, 0 to 1, of ``#rrggbb``."""
    return tuple((value / 255.0) ** GAMMA for value in bytes.fromhex(colour.removeprefix("#")))
