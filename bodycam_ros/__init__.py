"""Motion capture from body-mounted cameras: images in, a metric skeleton in the world out."""

__version__ = "0.1.0"
