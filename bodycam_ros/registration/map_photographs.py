"""The photographs of a reference map, small and grey, for alignment by pixels.

A map without them registers cameras by descriptors alone. Files of older versions have arrays of a single camera
without ``camera_of_view`` and ``distortion_ends``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.camera.lens_kernels import PROJECTION
from bodycam_ros.camera.local_scale import local_scales
from bodycam_ros.errors import LensError, MapError
from bodycam_ros.files.checked_npz import read_arrays


def camera_arrays(cameras: Sequence[CameraModel], camera_of_view: NDArray[np.uint16]) -> dict[str, NDArray[Any]]:
    """The arrays of cameras and of which of them took each photograph."""
    return dict(
        distortion_model=np.array([camera.distortion_model for camera in cameras]),
        size=np.array([[camera.width, camera.height] for camera in cameras], np.int64),
        intrinsics=np.array([[camera.fx, camera.fy, camera.cx, camera.cy] for camera in cameras]),
        distortion=np.concatenate([np.array(camera.distortion, np.float64) for camera in cameras]),
        distortion_ends=np.cumsum([len(camera.distortion) for camera in cameras], dtype=np.int64),
        camera_of_view=camera_of_view,
    )


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
    sound = (
        len(models) > 0
        and arrays["size"].size == 2 * len(models)
        and arrays["intrinsics"].size == 4 * len(models)
        and ends.shape == (len(models),)
        and bool(np.all(np.diff(ends, prepend=0) >= 0))
        and ends[-1] == len(arrays["distortion"])
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


LEVELS: Final = 4
"""Levels of a pyramid, down to 1/8: patches of a coarse level reach into photographs of twice the scale.

Level k is smoothed (Burt and Adelson 1983), and its pixel (u, v) lies at (2^k u, 2^k v) of the image. All levels are in
one array of bytes, as kernels read it.
"""


def pyramid_levels(height: int, width: int) -> NDArray[np.int64]:
    """(LEVELS, 3) where each level begins in the bytes, its height and its width."""
    levels, start = [], 0
    for _ in range(LEVELS):
        levels.append((start, height, width))
        start += height * width
        height, width = (height + 1) // 2, (width + 1) // 2
    return np.array(levels, np.int64)


def pyramid_size(levels: NDArray[np.int64]) -> int:
    """Bytes of a pyramid."""
    return int(levels[-1, 0] + levels[-1, 1] * levels[-1, 2])


def write_pyramid(image: NDArray[np.uint8], levels: NDArray[np.int64], into: NDArray[np.uint8]) -> None:
    """Fill ``into`` (bytes,) with the pyramid of a grey image (H, W)."""
    start, height, width = levels[0]
    into[: height * width] = image.ravel()
    for start, height, width in levels[1:]:
        smaller = into[start : start + height * width].reshape(height, width)
        image = np.asarray(cv2.pyrDown(image, dst=smaller), np.uint8)


PHOTOGRAPHS_FILE = "photographs.npz"

_ARRAYS = {
    "jpegs": "u1 B",
    "jpeg_ends": "i8 K",
    "observation_landmark": "u4 O",
    "observation_view": "u2 O",
    "normals": "f4 L 3",
    "distortion_model": "U",
    "size": "i8",
    "intrinsics": "f8",
    "distortion": "f8 N",
}
_SEVERAL_CAMERAS = {"camera_of_view": "u2 K", "distortion_ends": "i8 C"}


@dataclass(frozen=True)
class MapPhotographs:
    """Photographs that a reference map was made from, and which landmarks they show.

    Attributes:
        jpegs: the K grey pictures, encoded; of a map that was read, pages of its file that processes share.
        cameras: that would have taken them at their size.
        camera_of_view: (K,) uint16 which of the cameras took each.
        world_T_camera: (K, 4, 4) their poses.
        observation_landmark: (O,) uint32 row of the landmark that is seen, ascending.
        observation_view: (O,) uint16 row of the photograph that sees it.
        normals: (L, 3) float32 unit normal of the surface that a landmark lies on, towards those who saw it.
    """

    jpegs: tuple[bytes | memoryview, ...]
    cameras: tuple[CameraModel, ...]
    camera_of_view: NDArray[np.uint16]
    world_T_camera: NDArray[np.float64]
    observation_landmark: NDArray[np.uint32]
    observation_view: NDArray[np.uint16]
    normals: NDArray[np.float32]

    @classmethod
    def load(cls, folder: Path, world_T_camera: NDArray[np.float64], landmarks: int) -> "MapPhotographs | None":
        """Read the photographs of a map folder; None if it has none.

        Args:
            folder: of the map.
            world_T_camera: (K, 4, 4) poses of its photographs.
            landmarks: how many it has.

        Raises:
            MapError: the file is damaged, or belongs to another map.
        """
        path = folder / PHOTOGRAPHS_FILE
        if not path.exists():
            return None
        count = len(world_T_camera)
        arrays = read_arrays(path, _ARRAYS, _SEVERAL_CAMERAS, {"K": count, "L": landmarks})
        ends, seen, views = arrays["jpeg_ends"], arrays["observation_landmark"], arrays["observation_view"]
        sound = (
            count > 0
            and np.all(np.diff(ends, prepend=0) > 0)
            and ends[-1] == len(arrays["jpegs"])
            and int(seen.max(initial=0)) < landmarks
            and int(views.max(initial=0)) < count
            and not np.any(np.diff(seen.astype(np.int64)) < 0)
        )
        if not sound:
            raise MapError(f"{path}: damaged, or of another map; build the map again with 'bodycam map'")
        data = arrays["jpegs"].data
        starts = np.concatenate([[0], ends[:-1]])
        try:
            cameras, camera_of_view = cameras_from(arrays, count)
        except LensError as error:
            raise MapError(f"{path}: damaged: {error}; build the map again with 'bodycam map'") from error
        return cls(
            jpegs=tuple(data[start:end] for start, end in zip(starts, ends, strict=True)),
            cameras=cameras,
            camera_of_view=camera_of_view,
            world_T_camera=world_T_camera,
            observation_landmark=seen,
            observation_view=views,
            normals=arrays["normals"],
        )

    def save(self, folder: Path) -> None:
        """Write them into a map folder."""
        arrays: dict[str, Any] = dict(
            jpegs=np.frombuffer(b"".join(self.jpegs), np.uint8),
            jpeg_ends=np.cumsum([len(jpeg) for jpeg in self.jpegs], dtype=np.int64),
            observation_landmark=self.observation_landmark,
            observation_view=self.observation_view,
            normals=self.normals,
            **camera_arrays(self.cameras, self.camera_of_view),
        )
        np.savez(folder / PHOTOGRAPHS_FILE, **arrays)

    @cached_property
    def lenses(self) -> NDArray[np.float64]:
        """(C, PROJECTION) of the cameras, as kernels take what they project by."""
        return np.stack([camera.parameters[:PROJECTION] for camera in self.cameras])

    @cached_property
    def local_scales(self) -> NDArray[np.float64]:
        """(C, N) of the cameras: see ``local_scales``."""
        return np.stack([local_scales(camera) for camera in self.cameras])

    @cached_property
    def levels(self) -> NDArray[np.int64]:
        """(C, levels, 3) of the pyramids of each camera: see ``pyramid_levels``."""
        return np.stack([pyramid_levels(camera.height, camera.width) for camera in self.cameras])

    @cached_property
    def pyramids(self) -> NDArray[np.uint8]:
        """(K, bytes of the largest) pyramids, of which those that were asked for have been written: see ``develop``."""
        return np.empty((len(self.jpegs), max(map(pyramid_size, self.levels))), np.uint8)

    @cached_property
    def _developed(self) -> NDArray[np.bool_]:
        return np.zeros(len(self.jpegs), bool)

    @cached_property
    def first_observation(self) -> NDArray[np.int64]:
        """(L + 1,) where in the observations those of each landmark begin."""
        return np.searchsorted(self.observation_landmark, np.arange(len(self.normals) + 1))

    def develop(self, views: NDArray[np.integer]) -> None:
        """Make sure that the pyramids of these photographs are there; -1 stands for none.

        Raises:
            MapError: one of them is no picture, or of another size.
        """
        missing = views[~self._developed[views]]
        for view in np.unique(missing[missing >= 0]) if len(missing) else ():
            write_pyramid(self.picture(view), self.levels[self.camera_of_view[view]], self.pyramids[view])
            self._developed[view] = True

    def camera(self, view: int) -> CameraModel:
        """The camera that would have taken a photograph at its size."""
        return self.cameras[int(self.camera_of_view[view])]

    def picture(self, view: int, name: str = "") -> NDArray[np.uint8]:
        """A photograph (H, W), grey.

        Args:
            view: its row.
            name: of its file, for the message, where that is known.

        Raises:
            MapError: it is no picture, or of another size.
        """
        camera = self.camera(view)
        try:
            picture = cv2.imdecode(np.frombuffer(self.jpegs[view], np.uint8), cv2.IMREAD_GRAYSCALE)
        except cv2.error:  # nothing at all, or a header that claims an absurd size
            picture = None
        if picture is None or picture.shape != (camera.height, camera.width):
            raise MapError(f"photograph {name or view} of the map is damaged; build the map again with 'bodycam map'")
        return np.asarray(picture, np.uint8)
