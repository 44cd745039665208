"""The photographs of a reference folder, the camera that took them, and work on many of them at once."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bodycam_ros.camera import CameraModel, camera_from_yaml
from bodycam_ros.camera.colmap_model import camera_from_colmap
from bodycam_ros.errors import LensError, MapError
from bodycam_ros.mapping import colmap

_SAME = 1e-6
"""Relative difference of parameters up to which two cameras of a model are one."""


def camera_of_model(folder: Path) -> CameraModel:
    """The one camera that took all photographs of a model.

    Raises:
        MapError: the model cannot be read, has none or several cameras, or one of a lens model that is not known.
    """
    model = colmap.read_model(folder)
    used = {image.camera_id for image in model.images.values() if image.has_pose}
    cameras = [model.cameras[camera_id] for camera_id in sorted(used)]
    if not cameras:
        raise MapError(f"{folder}: the model registers no photograph; give the folder of one that does")
    first = cameras[0]
    apart = [
        camera
        for camera in cameras
        if (camera.model_name, camera.width, camera.height) != (first.model_name, first.width, first.height)
        or not np.allclose(camera.params, first.params, rtol=_SAME, atol=_SAME)
    ]
    if apart:
        raise MapError(
            f"{folder}: the model has {len(cameras)} cameras; a map is made of photographs of one. Let COLMAP share "
            "one camera among all (ImageReader.single_camera), or put the camera_info YAML of the one that took the "
            "photographs into their folder as camera.yaml"
        )
    try:
        return camera_from_colmap("photograph", first)
    except LensError as error:
        raise MapError(
            f"{folder}: {error}; make the model with one of these lens models, or put the camera_info YAML of the "
            "camera into the photographs' folder as camera.yaml"
        ) from error


CAMERA_FILE = "camera.yaml"
BOARD_FILE = "board.yaml"
_SUFFIXES = {".jpg", ".jpeg", ".png"}


@dataclass(frozen=True)
class Photographs:
    """What a reference folder holds.

    Attributes:
        folder: where it is.
        name: of the folder, or of the recording that its photographs were taken from.
        paths: image files in order of name.
        camera_of_name: file name -> the camera that took it.
        board_path: description of the board, if the folder has one.
    """

    folder: Path
    name: str
    paths: tuple[Path, ...]
    camera_of_name: Mapping[str, CameraModel]
    board_path: Path | None

    @property
    def where(self) -> str:
        """For messages: the folder, or the recording, whose frames may be in a folder that nobody knows."""
        return str(self.folder) if self.name == self.folder.resolve().name else self.name


def wrong_camera(*cameras: CameraModel) -> str:
    """What to tell a user whose photographs contradict the intrinsics of the cameras that took them."""
    if len(cameras) > 1:
        said = ", ".join(f"{camera.name} {camera.distortion_model} {camera.fx:.0f} px" for camera in cameras)
        return (
            f"Do the intrinsics belong to the cameras? They say: {said}. Another lens model, zoom or image size makes "
            "another camera."
        )
    (camera,) = cameras
    return (
        f"Does {CAMERA_FILE} belong to the camera that took the photographs? It says {camera.distortion_model}, focal "
        f"lengths {camera.fx:.0f} and {camera.fy:.0f} px; another lens model, zoom or image size makes another camera."
    )


def find_photographs(
    folder: Path,
    camera_path: Path | None = None,
    model_folder: Path | None = None,
    name: str | None = None,
    board_path: Path | None = None,
) -> Photographs:
    """List a reference folder.

    Args:
        folder: with the photographs.
        camera_path: camera_info YAML; None: the folder's own.
        model_folder: COLMAP model of them, whose camera counts where there is no camera_info YAML.
        name: of what the photographs were taken from; None: the folder's.
        board_path: description of the board; None: the folder's own, if it has one.

    Raises:
        MapError: the folder, its photographs or its calibration are missing.
        LensError: the calibration is malformed.
    """
    if not folder.is_dir():
        raise MapError(f"{folder}: no such folder; expected one with photographs (jpg, png) and {CAMERA_FILE}")
    paths = tuple(sorted(p for p in folder.iterdir() if p.suffix.lower() in _SUFFIXES and p.is_file()))
    if len(paths) < 2:
        raise MapError(f"{folder}: {len(paths)} photographs (jpg, png); a map needs two or more, better 50 to 150")
    if board_path is None and (folder / BOARD_FILE).is_file():
        board_path = folder / BOARD_FILE
    camera = _camera(folder, camera_path, model_folder)
    camera_of_name = {path.name: camera for path in paths}
    return Photographs(folder, name or folder.resolve().name, paths, camera_of_name, board_path)


def _camera(folder: Path, camera_path: Path | None, model_folder: Path | None) -> CameraModel:
    if camera_path is not None:
        return camera_from_yaml(camera_path)
    if (folder / CAMERA_FILE).is_file():
        return camera_from_yaml(folder / CAMERA_FILE)
    if model_folder is None:
        raise MapError(
            f"{folder}: has no {CAMERA_FILE}; put the ROS camera_info YAML of the photographs' camera there, or say "
            "with --camera where it is"
        )
    # COLMAP takes a second to load.

    return camera_of_model(model_folder)
