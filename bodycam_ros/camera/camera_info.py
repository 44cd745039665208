"""Cameras from sensor_msgs/CameraInfo and from the YAML file that ROS calibration tools write for it."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from bodycam_ros.camera.model import MODELS, CameraModel
from bodycam_ros.camera.readout import LONGEST_READOUT_S
from bodycam_ros.errors import LensError
from bodycam_ros.files.bounded_inputs import MOST_PIXELS
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.files.yaml_file import read_yaml

# Lengths of d beside the model's own: what a shorter list leaves out is zero, what a longer one adds must be zero
# (OpenCV's thin prism and tilted sensor).
_OTHER_LENGTHS = {"plumb_bob": (0, 4), "rational_polynomial": (12, 14)}
_SIZE, _MATRICES = ("image_width", "image_height"), ("distortion_coefficients", "camera_matrix")
_MOST_OF_PLUMB_BOB = 5  # coefficients; OpenCV has 8, 12 or 14 for its rational model
_K_FORM = "[fx, 0, cx, 0, fy, cy, 0, 0, 1]"
_LARGEST = 1e6  # of k [px] and d; their powers must be finite


def camera_from_info(
    name: str,
    width: int,
    height: int,
    distortion_model: str,
    d: Iterable[float],
    k: Iterable[float],
) -> CameraModel:
    """Camera of the fields of a sensor_msgs/CameraInfo.

    Args:
        name: the camera, for messages.
        width, height: image size [px].
        distortion_model: plumb_bob, rational_polynomial, equidistant or fov.
        d: distortion coefficients in the model's order; none with plumb_bob means no distortion.
        k: 3x3 intrinsic matrix by rows [px].

    Raises:
        LensError: a field is missing, malformed or of an unsupported model.
    """
    if not distortion_model:
        raise _error(
            name,
            "there is no distortion model, as where a driver has no calibration; measure the lens, and give it that",
        )
    if distortion_model not in MODELS:
        known = other_than(distortion_model, sorted(MODELS))
        raise _error(name, f"distortion model {shown(distortion_model)} is unknown; {known}")
    if not (width > 0 and height > 0):
        raise _error(name, f"the image size must be positive, not {width} x {height}")
    if width * height > MOST_PIXELS:
        raise _error(name, f"an image of {width} x {height} pixels is more than any camera has")
    fx, fy, cx, cy = _intrinsics(name, _numbers(name, "k", k))
    distortion = _distortion(name, distortion_model, _numbers(name, "d", d))
    return CameraModel(name, int(width), int(height), fx, fy, cx, cy, distortion, distortion_model)


def camera_from_yaml(path: Path, name: str | None = None) -> CameraModel:
    """Camera of a ROS camera_info YAML file, or of what OpenCV's calibration writes.

    Args:
        path: the file, as camera_calibration and image_proc write it, or OpenCV's sample (``out_camera_data.yml``).
        name: the camera; else ``camera_name`` of the file; else the file's name.

    Raises:
        LensError: the file is missing, not YAML, lacks a field, or ``camera_from_info`` refuses it.
    """
    document = read_yaml(path, "camera_info YAML", LensError)
    if not isinstance(document, Mapping):
        raise LensError(f"{path}: expected a camera_info YAML with image_width, camera_matrix and so on")
    document = _as_of_ros(document)
    for field in (*_SIZE, *_MATRICES, "distortion_model"):
        if field not in document:
            raise LensError(f"{path}: the field '{field}' is missing")
    (width, height), matrices = ([document[field] for field in fields] for fields in (_SIZE, _MATRICES))
    for field, side in zip(_SIZE, (width, height), strict=True):
        if type(side) is not int:
            raise LensError(f"{path}: '{field}' must be a whole number of pixels, not {shown(side)}")
    for field, matrix in zip(_MATRICES, matrices, strict=True):
        if not isinstance(matrix, Mapping) or "data" not in matrix:
            raise LensError(f"{path}: '{field}' must have rows, cols and data, not {shown(matrix)}")
    called, (d, k) = name or str(document.get("camera_name") or Path(path).stem), matrices
    try:
        return camera_from_info(called, width, height, str(document["distortion_model"]), d["data"], k["data"])
    except LensError as error:
        raise LensError(f"{path}: {error}") from error


def _as_of_ros(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """The fields of a file of OpenCV by ROS' names, with a model by the number of coefficients; others as they are."""
    lower = {str(key).lower(): value for key, value in document.items()}
    matrix, d = (lower.get(field) for field in reversed(_MATRICES))
    if not (isinstance(matrix, Mapping) and "dt" in matrix and isinstance(d, Mapping)) or "distortion_model" in lower:
        return document
    count = len(d["data"]) if isinstance(d.get("data"), list) else 0
    model = "plumb_bob" if count <= _MOST_OF_PLUMB_BOB else "rational_polynomial"
    return {**lower, "distortion_model": "equidistant" if lower.get("fisheye_model") else model}


def scaled_camera(camera: CameraModel, scale: float) -> CameraModel:
    """The camera of images that are reduced to a share of their size, in even numbers of pixels as video has them."""
    width, height = (max(2, 2 * round(0.5 * scale * side)) for side in (camera.width, camera.height))
    across, down = width / camera.width, height / camera.height
    return replace(
        camera,
        width=width,
        height=height,
        fx=camera.fx * across,
        fy=camera.fy * down,
        cx=(camera.cx + 0.5) * across - 0.5,
        cy=(camera.cy + 0.5) * down - 0.5,
    )


def part_of_image(
    camera: CameraModel, offset: tuple[int, int], size: tuple[int, int], binning: tuple[int, int]
) -> CameraModel:
    """The camera of images that are a part of its own, several pixels of which are one.

    Args:
        camera: of the full images.
        offset: column and row of the part's first pixel [px].
        size: width and height of the part [px], before binning.
        binning: columns and rows that are one.
    """
    across, down = binning
    return replace(
        camera,
        width=size[0] // across,
        height=size[1] // down,
        fx=camera.fx / across,
        fy=camera.fy / down,
        # The middle of a pixel is a whole number, so its left edge is half a pixel before.
        cx=(camera.cx - offset[0] + 0.5) / across - 0.5,
        cy=(camera.cy - offset[1] + 0.5) / down - 0.5,
    )


def readout_time_from_yaml(path: Path) -> float | None:
    """``readout_time`` of a camera_info YAML: from the middle of the exposure of the first row to that of the last [s].

    Our own addition to the file; None if it is not there.

    Raises:
        LensError: the file cannot be read, or the time is none that a camera has.
    """
    document = read_yaml(path, "camera_info YAML", LensError)
    given = document.get("readout_time") if isinstance(document, Mapping) else None
    if given is None:
        return None
    if isinstance(given, bool) or not isinstance(given, (int, float)) or not 0.0 <= given <= LONGEST_READOUT_S:
        raise LensError(
            f"{path}: readout_time must be from 0 to {LONGEST_READOUT_S:g} s, the time from the first row to the "
            f"last, not {shown(given)}"
        )
    return float(given)


def _intrinsics(name: str, k: tuple[float, ...]) -> tuple[float, float, float, float]:
    if len(k) != 9:
        raise _error(name, f"k must have 9 entries {_K_FORM}, not {len(k)}")
    if not any(k):
        raise _error(name, "k is all zero: this camera is not calibrated; calibrate it and publish its camera_info")
    fx, skew, cx, zero_a, fy, cy, zero_b, zero_c, one = k
    if fx <= 0.0 or fy <= 0.0:
        raise _error(name, f"the focal lengths must be positive, not fx = {fx:g} and fy = {fy:g}")
    if skew != 0.0:
        raise _error(name, f"k has the skew {skew:g}; only cameras without skew are supported: calibrate without it")
    if (zero_a, zero_b, zero_c, one) != (0.0, 0.0, 0.0, 1.0):
        raise _error(name, f"k must have the form {_K_FORM}, not {shown(list(k))}")
    return fx, fy, cx, cy


def _distortion(name: str, model: str, d: tuple[float, ...]) -> tuple[float, ...]:
    coefficients = MODELS[model][1]
    count = len(coefficients)
    lengths = sorted({count, *_OTHER_LENGTHS.get(model, ())})
    if len(d) not in lengths:
        expected = " or ".join(str(length) for length in lengths)
        order = ", ".join(coefficients)
        raise _error(name, f"{model} needs {expected} coefficients d ({order}), not {len(d)}")
    if any(d[count:]):
        raise _error(name, f"thin prism and tilt coefficients are not supported: d[{count}:] must be zero")
    if model == "fov" and not 0.0 <= d[0] < math.pi:
        raise _error(name, f"omega of the fov model must be from 0 to below pi [rad], not {d[0]:g}")
    return (*d[:count], *[0.0] * (count - len(d)))


def _numbers(name: str, field: str, values: Iterable[float]) -> tuple[float, ...]:
    try:
        numbers = tuple(float(value) for value in values)
    except (TypeError, ValueError, OverflowError) as error:
        raise _error(name, f"{field} must be a list of numbers, not {shown(values)}") from error
    if not all(math.isfinite(number) for number in numbers):
        raise _error(name, f"{field} must be finite, not {shown(list(numbers))}: calibrate the camera again")
    if any(abs(number) > _LARGEST for number in numbers):
        raise _error(name, f"{field} has {shown(max(numbers, key=abs))}, which no lens has: calibrate the camera again")
    return numbers


def _error(name: str, message: str) -> LensError:
    return LensError(message, name)


def camera_info_yaml(camera: CameraModel) -> str:
    """The text of a camera_info YAML, which ``camera_from_yaml`` reads back as the same camera."""
    p = [camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    document = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": camera.name,
        "camera_matrix": {"rows": 3, "cols": 3, "data": list(map(float, camera.k))},
        "distortion_model": camera.distortion_model,
        "distortion_coefficients": {
            "rows": 1,
            "cols": len(camera.distortion),
            "data": list(map(float, camera.distortion)),
        },
        "rectification_matrix": {"rows": 3, "cols": 3, "data": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]},
        "projection_matrix": {"rows": 3, "cols": 4, "data": list(map(float, p))},
    }
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)
