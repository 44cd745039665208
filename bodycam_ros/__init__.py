"""Motion capture from body-mounted cameras: images in, a metric skeleton in the world out."""

import os

__version__ = "0.1.0"

MOST_PIXELS = 200_000_000
"""Of an image: a few kilobytes of PNG can claim a thousand times as many, and OpenCV would allocate them."""

# OpenCV reads this once, when it is loaded; every import of it in this package comes after this line.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MOST_PIXELS))
