"""Colours of all pictures, films and files, as they are written and as light."""

LEFT, RIGHT, CENTRE = "#1f6fb4", "#dd7a12", "#33383d"
"""Sides of the body: blue and orange stay apart for every eye."""

TRUTH = "#a9b0b7"
WARNING = "#c8102e"
"""Lost cameras, gaps, frames without any camera, a result that is wrong; nothing else is red."""

CAUTION, GOOD = "#9a6700", "#2c7f78"
"""A result that is doubtful, and one that is good."""

RELATIVE, ROTATION_ONLY = "#7a6cb4", "#d9b13b"
"""A camera registered by extended landmarks, and one of which only the rotation is known."""

EQUIPMENT = "#8e4a8a"
"""Equipment, drawn thinner than limbs."""

INK, QUIET, FAINT = "#22272b", "#6b747c", "#e3e7ea"

GAMMA = 2.2
"""Exponent from values of a picture to light."""


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of ``#rrggbb``."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def linear(colour: str) -> tuple[float, ...]:
    """Red, green and blue, linear in light, 0 to 1, of ``#rrggbb``."""
    return tuple((value / 255.0) ** GAMMA for value in rgb(colour))


def side_colour(segment: str) -> str:
    """Colour of the side that a segment's name ends with."""
    if segment.endswith("_left"):
        return LEFT
    return RIGHT if segment.endswith("_right") else CENTRE
