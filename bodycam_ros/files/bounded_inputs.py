"""What a program of ours sets in the libraries that it uses; a program that imports the package decides for itself."""

import os

MOST_PIXELS = 200_000_000
"""Bound of an image: a few kilobytes of PNG can claim a thousand times as many, and OpenCV would allocate them."""


def bound_inputs() -> None:
    """Bound what a file can make this process allocate; before OpenCV is loaded, which reads its limit once."""
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MOST_PIXELS))
    is_bounded.append(True)


is_bounded: list[bool] = []
"""Not empty once ``bound_inputs`` was called: other libraries are bounded when they are loaded."""
