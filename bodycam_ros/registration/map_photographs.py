"""The photographs of a reference map, small and grey: what a landmark looks like, for alignment by pixels.

A map of before has none; then landmarks are known by their descriptors alone.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import LensError, MapError
from bodycam_ros.registration.checked_npz import read_arrays, write_arrays
from bodycam_ros.registration.image_pyramid import pyramid_levels, pyramid_size, write_pyramid

PHOTOGRAPHS_FILE = "photographs.npz"

_DTYPES = {
    "jpegs": "u1",
    "jpeg_ends": "i8",
    "observation_landmark": "u4",
    "observation_view": "u2",
    "normals": "f4",
    "distortion_model": "U",
    "size": "i8",
    "intrinsics": "f8",
    "distortion": "f8",
}


@dataclass(frozen=True)
class MapPhotographs:
    """Photographs that a reference map was made from, and which landmarks they show.

    Attributes:
        jpegs: the K grey pictures, encoded.
        camera: that would have taken them at their size.
        world_T_camera: (K, 4, 4) their poses.
        observation_landmark: (O,) uint32 row of the landmark that is seen, ascending.
        observation_view: (O,) uint16 row of the photograph that sees it.
        normals: (L, 3) float32 unit normal of the surface that a landmark lies on, towards those who saw it.
    """

    jpegs: tuple[bytes, ...]
    camera: CameraModel
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
        arrays = read_arrays(path, _DTYPES)
        ends, seen, views = arrays["jpeg_ends"], arrays["observation_landmark"], arrays["observation_view"]
        count = len(world_T_camera)
        sound = (
            ends.shape == (count,)
            and count > 0
            and np.all(np.diff(ends, prepend=0) > 0)
            and ends[-1] == len(arrays["jpegs"])
            and seen.shape == views.shape == (len(seen),)
            and arrays["normals"].shape == (landmarks, 3)
            and bool(np.isfinite(arrays["normals"]).all())
            and int(seen.max(initial=0)) < landmarks
            and int(views.max(initial=0)) < count
            and not np.any(np.diff(seen.astype(np.int64)) < 0)
            and arrays["size"].shape == (2,)
            and arrays["intrinsics"].shape == (4,)
            and arrays["distortion_model"].size == 1
        )
        if not sound:
            raise MapError(f"{path}: damaged, or of another map; build the map again with 'bodycam map'")
        data = arrays["jpegs"].tobytes()
        starts = np.concatenate([[0], ends[:-1]])
        width, height = map(int, arrays["size"])
        fx, fy, cx, cy = map(float, arrays["intrinsics"])
        model = str(arrays["distortion_model"].ravel()[0])
        k = (fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
        try:
            camera = camera_from_info("photograph", width, height, model, arrays["distortion"], k)
        except LensError as error:
            raise MapError(f"{path}: damaged: {error}; build the map again with 'bodycam map'") from error
        return cls(
            jpegs=tuple(data[start:end] for start, end in zip(starts, ends, strict=True)),
            camera=camera,
            world_T_camera=world_T_camera,
            observation_landmark=seen,
            observation_view=views,
            normals=arrays["normals"],
        )

    def save(self, folder: Path) -> None:
        """Write them into a map folder."""
        camera = self.camera
        arrays: dict[str, NDArray[Any]] = dict(
            jpegs=np.frombuffer(b"".join(self.jpegs), np.uint8),
            jpeg_ends=np.cumsum([len(jpeg) for jpeg in self.jpegs], dtype=np.int64),
            observation_landmark=self.observation_landmark,
            observation_view=self.observation_view,
            normals=self.normals,
            distortion_model=np.array(camera.distortion_model),
            size=np.array([camera.width, camera.height], np.int64),
            intrinsics=np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
            distortion=np.array(camera.distortion, np.float64),
        )
        write_arrays(folder / PHOTOGRAPHS_FILE, arrays)

    @cached_property
    def levels(self) -> NDArray[np.int64]:
        """(levels, 3) of every pyramid: see ``pyramid_levels``."""
        return pyramid_levels(self.camera.height, self.camera.width)

    @cached_property
    def pyramids(self) -> NDArray[np.uint8]:
        """(K, bytes) pyramids, of which those that were asked for have been written: see ``develop``."""
        return np.empty((len(self.jpegs), pyramid_size(self.levels)), np.uint8)

    @cached_property
    def _developed(self) -> NDArray[np.bool_]:
        return np.zeros(len(self.jpegs), bool)

    @cached_property
    def first_observation(self) -> NDArray[np.int64]:
        """(L + 1,) where in the observations those of each landmark begin."""
        return np.searchsorted(self.observation_landmark, np.arange(len(self.normals) + 1))

    @cached_property
    def centres(self) -> NDArray[np.float64]:
        """(K, 3) where the photographs were taken [m]."""
        return np.ascontiguousarray(self.world_T_camera[:, :3, 3])

    def develop(self, views: NDArray[np.integer]) -> None:
        """Make sure that the pyramids of these photographs are there.

        Raises:
            MapError: one of them is no picture, or of another size.
        """
        for view in np.unique(views[~self._developed[views]]):
            picture = cv2.imdecode(np.frombuffer(self.jpegs[view], np.uint8), cv2.IMREAD_GRAYSCALE)
            if picture is None or picture.shape != (self.camera.height, self.camera.width):
                raise MapError(f"photograph {view} of the map is damaged; build the map again with 'bodycam map'")
            write_pyramid(picture, self.levels, self.pyramids[view])
            self._developed[view] = True
