"""Colours of the view, those of the evaluation's pictures."""

from bodycam_ros.drawing.picture_style import QUIET, WARNING, side_colour

REGISTERED, LOST, UNKNOWN = "#2c7f78", WARNING, QUIET
"""A camera that knows its own pose at the instant shown, one that does not, one of which nothing is known."""

SELECTED = "#f2c200"
"""The part that is being moved; no side of the body, no state of a camera and no axis is yellow."""

GRID_FINE, GRID = "#e3e7ea", "#b9c1c8"


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of ``#rrggbb``."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def segment_rgb(segment: str) -> tuple[int, int, int]:
    """Colour of a segment's side."""
    return rgb(side_colour(segment))
