"""The ways in which drivers lay out pixels, by the names that ROS has for them."""

from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

_BITS = {"8": 8, "16": 16}
_MOSAICS = {"rggb": "BG", "bggr": "RG", "gbrg": "GR", "grbg": "GB"}
"""ROS names a mosaic by its first two rows from the corner; OpenCV by two pixels of the second row."""


@dataclass(frozen=True)
class PixelEncoding:
    """How the bytes of an image are to be read.

    Attributes:
        bits: of a value: 8 or 16, all of them used.
        values: per pixel and row.
        to_grey: OpenCV's conversion to grey; None where the values are.
        to_colour: OpenCV's conversion to blue, green, red; None where the values are.
        block: width and height must be multiples of these.
        rows: of values per row of pixels: 1.5 where colours follow in a plane of their own.
    """

    bits: int
    values: int
    to_grey: int | None
    to_colour: int | None
    block: tuple[int, int] = (1, 1)
    rows: float = 1.0

    def grey(self, values: NDArray[np.uint8] | NDArray[np.uint16]) -> NDArray[np.uint8]:
        """Grey pixels (H, W) of values (rows, W) or (rows, W, values); of YUV the luma as it is."""
        pixels = values if self.to_grey is None else cv2.cvtColor(values, self.to_grey)
        return np.ascontiguousarray(_eight_bits(pixels))

    def colour(self, values: NDArray[np.uint8] | NDArray[np.uint16]) -> NDArray[np.uint8]:
        """Pixels (H, W, 3), blue, green, red, of values (rows, W) or (rows, W, values); the caller's own."""
        if self.to_colour is None:
            return np.array(_eight_bits(values), order="C")
        return _eight_bits(cv2.cvtColor(values, self.to_colour))


def _eight_bits(values: NDArray[Any]) -> NDArray[np.uint8]:
    return np.asarray(values if values.dtype == np.uint8 else values >> 8, dtype=np.uint8)


def _encodings() -> dict[str, PixelEncoding]:
    known = {
        "8UC1": PixelEncoding(8, 1, None, cv2.COLOR_GRAY2BGR),
        "8UC3": PixelEncoding(8, 3, cv2.COLOR_BGR2GRAY, None),
    }
    for name, bits in _BITS.items():
        known["mono" + name] = PixelEncoding(bits, 1, None, cv2.COLOR_GRAY2BGR)
        known["bgr" + name] = PixelEncoding(bits, 3, cv2.COLOR_BGR2GRAY, None)
        known["rgb" + name] = PixelEncoding(bits, 3, cv2.COLOR_RGB2GRAY, cv2.COLOR_RGB2BGR)
        known["bgra" + name] = PixelEncoding(bits, 4, cv2.COLOR_BGRA2GRAY, cv2.COLOR_BGRA2BGR)
        known["rgba" + name] = PixelEncoding(bits, 4, cv2.COLOR_RGBA2GRAY, cv2.COLOR_RGBA2BGR)
        for mosaic, opencv in _MOSAICS.items():
            grey, colour = (getattr(cv2, f"COLOR_Bayer{opencv}2{kind}") for kind in ("GRAY", "BGR"))
            known[f"bayer_{mosaic}{name}"] = PixelEncoding(bits, 1, grey, colour, block=(2, 2))
    uyvy = PixelEncoding(8, 2, cv2.COLOR_YUV2GRAY_UYVY, cv2.COLOR_YUV2BGR_UYVY, block=(2, 1))
    yuyv = PixelEncoding(8, 2, cv2.COLOR_YUV2GRAY_YUY2, cv2.COLOR_YUV2BGR_YUY2, block=(2, 1))
    known |= {"yuv422": uyvy, "uyvy": uyvy, "yuv422_yuy2": yuyv, "yuyv": yuyv}
    for name, code in (("nv12", cv2.COLOR_YUV2BGR_NV12), ("nv21", cv2.COLOR_YUV2BGR_NV21)):
        known[name] = PixelEncoding(8, 1, cv2.COLOR_YUV2GRAY_NV12, code, block=(2, 2), rows=1.5)
    return known


ENCODINGS: Final = _encodings()
"""Name of an encoding, as in ``sensor_msgs/Image``, -> what it means."""
