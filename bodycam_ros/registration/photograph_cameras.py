"""The cameras of a map's photographs, as arrays of its file.

Those of a single camera have no leading axis, and ``camera_of_view`` and ``distortion_ends`` are left out.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import LensError

CAMERA_DTYPES = {"distortion_model": "U", "size": "i8", "intrinsics": "f8", "distortion": "f8"}
SEVERAL_CAMERAS_DTYPES = {"camera_of_view": "u2", "distortion_ends": "i8"}


def camera_arrays(cameras: Sequence[CameraModel], camera_of_view: NDArray[np.uint16]) -> dict[str, NDArray[Any]]:
    """The arrays of cameras and of which of them took each photograph."""
    arrays: dict[str, NDArray[Any]] = dict(
        distortion_model=np.array([camera.distortion_model for camera in cameras]),
        size=np.array([[camera.width, camera.height] for camera in cameras], np.int64),
        intrinsics=np.array([[camera.fx, camera.fy, camera.cx, camera.cy] for camera in cameras]),
        distortion=np.concatenate([np.array(camera.distortion, np.float64) for camera in cameras]),
    )
    if len(cameras) == 1:
        return arrays | {name: arrays[name][0] for name in ("distortion_model", "size", "intrinsics")}
    counts = [len(camera.distortion) for camera in cameras]
    return arrays | dict(distortion_ends=np.cumsum(counts, dtype=np.int64), camera_of_view=camera_of_view)


def cameras_from(
    arrays: Mapping[str, NDArray[Any]], photographs: int
) -> tuple[tuple[CameraModel, ...], NDArray[np.uint16]]:
    """The cameras, and which of them took each photograph (K,).

    Raises:
        LensError: the arrays do not fit together, or a lens is none.
    """
    models = arrays["distortion_model"].ravel()
    of_view = arrays.get("camera_of_view", np.zeros(photographs, np.uint16))
    ends = arrays.get("distortion_ends", np.array([arrays["distortion"].size]))
    several = (len(models),) if "camera_of_view" in arrays else ()
    sound = (
        arrays["distortion_model"].shape == several != (0,)
        and arrays["size"].shape == (*several, 2)
        and arrays["intrinsics"].shape == (*several, 4)
        and arrays["distortion"].ndim == 1
        and ends.shape == (len(models),)
        and bool(np.all(np.diff(ends, prepend=0) >= 0))
        and ends[-1] == len(arrays["distortion"])
        and of_view.shape == (photographs,)
        and int(of_view.max(initial=0)) < len(models)
    )
    if not sound:
        raise LensError("its cameras do not fit together")
    coefficients = np.split(arrays["distortion"], ends[:-1])
    rows = zip(models, arrays["size"].reshape(-1, 2), arrays["intrinsics"].reshape(-1, 4), coefficients, strict=True)
    cameras = []
    for model, (width, height), (fx, fy, cx, cy), distortion in rows:
        k = (fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
        cameras.append(camera_from_info("photograph", int(width), int(height), str(model), distortion.tolist(), k))
    return tuple(cameras), of_view
