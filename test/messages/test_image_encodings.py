"""Raw and compressed images in every encoding, of a scene whose colours are known, laid out by NumPy alone."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.naming import naming
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import ENCODINGS, decode_colour, decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.messages.images import compressed_image, raw_image

HEIGHT, WIDTH = 48, 64
_LUMA = np.array([0.114, 0.587, 0.299])
"""Weights of blue, green and red (BT.601)."""

_CHROMA = np.array([[0.5, -0.331264, -0.168736], [-0.081312, -0.418688, 0.5]])
"""What U and V are of blue, green and red."""

_HEADER = SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=5))


def scene() -> NDArray[np.uint8]:
    """Pixels (H, W, 3), blue, green, red: slopes that differ, so that no colour can be taken for another."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    slopes = (60 + 2 * x, 200 - 2 * y - x, 90 + 3 * y)
    return np.stack(slopes, axis=2).astype(np.uint8)


def mosaic(order: str) -> NDArray[np.uint8]:
    """One colour a pixel, as the sensor has them in its first two rows."""
    values, seen = np.zeros((HEIGHT, WIDTH), np.uint8), scene()
    for place, colour in enumerate(order):
        rows, columns = slice(place // 2, None, 2), slice(place % 2, None, 2)
        values[rows, columns] = seen[rows, columns, "bgr".index(colour)]
    return values


def yuv(half_rows: bool) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8]]:
    """Y (H, W), U and V of two pixels in a row, or of two by two; studio levels, as cameras have them."""
    pixels = scene().astype(float)
    luma = 16 + pixels @ _LUMA * 219 / 255
    u, v = np.moveaxis(128 + pixels @ _CHROMA.T * 224 / 255, 2, 0)
    halves = [0.5 * (plane[:, ::2] + plane[:, 1::2]) for plane in (u, v)]
    if half_rows:
        halves = [0.5 * (plane[::2] + plane[1::2]) for plane in halves]
    return tuple(np.rint(plane).astype(np.uint8) for plane in (luma, *halves))  # type: ignore[return-value]


def packed(luma_first: bool) -> NDArray[np.uint8]:
    luma, u, v = yuv(half_rows=False)
    values = np.zeros((HEIGHT, WIDTH, 2), np.uint8)
    values[..., 0 if luma_first else 1] = luma
    values[:, ::2, 1 if luma_first else 0], values[:, 1::2, 1 if luma_first else 0] = u, v
    return values


def in_planes(v_first: bool) -> NDArray[np.uint8]:
    luma, u, v = yuv(half_rows=True)
    colours = np.stack((v, u) if v_first else (u, v), axis=2).reshape(HEIGHT // 2, WIDTH)
    return np.concatenate((luma, colours))


def laid_out(encoding: str) -> NDArray[Any]:
    """The scene as a driver lays it out: (rows, W) or (rows, W, values) uint8 or uint16."""
    bgr = scene()
    full = np.full((HEIGHT, WIDTH, 1), 255, np.uint8)
    grey = np.rint(bgr @ _LUMA).astype(np.uint8)
    eight_bits = {
        "mono": grey,
        "8UC": bgr if encoding == "8UC3" else grey,
        "bgr": bgr,
        "rgb": bgr[..., ::-1],
        "bgra": np.dstack([bgr, full]),
        "rgba": np.dstack([bgr[..., ::-1], full]),
        "nv": in_planes(v_first=encoding == "nv21"),
    } | {f"bayer_{order}": mosaic(order) for order in ("rggb", "bggr", "gbrg", "grbg")}
    if encoding in ("yuv422", "uyvy", "yuv422_yuy2", "yuyv"):
        return packed(luma_first=encoding in ("yuv422_yuy2", "yuyv"))
    values = eight_bits[encoding.rstrip("0123456789")]
    # As many bits as there are: the lower ones are not the upper ones again.
    return values.astype(np.uint16) * 256 + 77 if encoding.endswith("16") else values


def message(encoding: str, values: NDArray[Any], padding: int = 0, big: bool = False) -> Any:
    of_values = values.astype(values.dtype.newbyteorder(">" if big else "<"))
    rows = np.frombuffer(of_values.tobytes(), np.uint8).reshape(len(values), -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=201)
    return SimpleNamespace(
        header=_HEADER,
        height=HEIGHT,
        width=WIDTH,
        encoding=encoding,
        is_bigendian=int(big),
        step=rows.shape[1],
        data=rows.tobytes(),
    )


def _is_grey(encoding: str) -> bool:
    return encoding.startswith("mono") or encoding == "8UC1"


def _assert_is_the_scene(image: Any, encoding: str, off: float, border: int = 0) -> None:
    """Within what the encoding can hold; what is interpolated from the nearest pixels not at the border."""
    inner = (slice(border, HEIGHT - border), slice(border, WIDTH - border))
    luma = scene() @ _LUMA
    is_yuv = encoding.startswith(("yu", "uy", "nv"))
    grey, colour = decode_grey(image), decode_colour(image)
    assert grey.shape == (HEIGHT, WIDTH) and colour.shape == (HEIGHT, WIDTH, 3)
    for pixels in (grey, colour):
        assert pixels.dtype == np.uint8 and pixels.flags.c_contiguous
    assert colour.flags.writeable
    expected = 16 + luma * 219 / 255 if is_yuv else luma
    np.testing.assert_allclose(grey[inner], expected[inner], atol=off)
    wanted = np.dstack([luma] * 3) if _is_grey(encoding) else scene()
    np.testing.assert_allclose(colour[inner], wanted[inner], atol=off)


@pytest.mark.parametrize("padding", [0, 7], ids=["", "padded"])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_each_encoding_shows_the_scene(encoding: str, padding: int) -> None:
    image = raw_image(message(encoding, laid_out(encoding), padding), "head")
    # Half a level of each number that was rounded, of YUV enlarged by what turns it into colours.
    off = {"y": 3.0, "u": 3.0, "n": 4.0}.get(encoding[0], 1.0)
    _assert_is_the_scene(image, encoding, off, border=1 if encoding.startswith("bayer") else 0)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"encoding": "32FC1"}, "32FC1"),
        ({"encoding": "\x1b[31mred"}, "\\x1b[31mred"),
        ({"encoding": "nv12"}, "nv12"),
        ({"encoding": "mono16"}, "mono16"),
    ],
)
def test_what_cannot_be_is_named(change: dict[str, Any], named: str) -> None:
    wrong = message("mono8", laid_out("mono8"))
    vars(wrong).update(change)
    with naming(RecordingError, "camera head", named):
        raw_image(wrong, "head")


def _file(suffix: str, values: NDArray[Any]) -> bytes:
    return cv2.imencode(suffix, values)[1].tobytes()


def _compressed(format_text: str, file: bytes) -> Any:
    return compressed_image(SimpleNamespace(header=_HEADER, format=format_text, data=file), "head")


@pytest.mark.parametrize("decode", [decode_grey, decode_colour])
@pytest.mark.parametrize(("file", "named"), [(b"no picture", "1000000005 ns"), (_file(".png", scene()), "bayer_rggb8")])
def test_a_file_that_is_not_what_is_said(file: bytes, named: str, decode: Callable[[Any], Any]) -> None:
    with naming(RecordingError, "camera head", named):
        decode(_compressed("bayer_rggb8; png compressed ", file))
