"""The photographs of a reference folder, and the cameras that took them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bodycam_ros.camera import CameraModel, camera_from_yaml
from bodycam_ros.camera.colmap_model import camera_from_colmap
from bodycam_ros.errors import LensError, MapError
from bodycam_ros.mapping import colmap

CAMERA_FILE = "camera.yaml"
BOARD_FILE = "board.yaml"
_SUFFIXES = {".jpg", ".jpeg", ".png"}
_SAME = 1e-6  # relative difference of parameters up to which two cameras of a model are one


@dataclass(frozen=True)
class FrameOrigin:
    """The body camera that took a photograph, and its stamp in the recording [s]."""

    camera: str
    seconds: float


@dataclass(frozen=True)
class Photographs:
    """A reference folder.

    Attributes:
        folder: its path.
        name: of the folder, or of the recording that its photographs were taken from.
        paths: image files in order of name.
        camera_of_name: file name -> the camera that took it.
        board_path: description of the board, if there is one.
        origins: file name -> origin, of frames of body cameras; else empty.
    """

    folder: Path
    name: str
    paths: tuple[Path, ...]
    camera_of_name: Mapping[str, CameraModel]
    board_path: Path | None
    origins: Mapping[str, FrameOrigin] = field(default_factory=dict)

    @property
    def where(self) -> str:
        """For messages: the folder, or the recording if its frames are in a scratch folder."""
        return str(self.folder) if self.name == self.folder.resolve().name else self.name


def find_photographs(folder: Path, camera_path: Path | None = None, model_folder: Path | None = None) -> Photographs:
    """List a reference folder.

    Args:
        folder: with the photographs.
        camera_path: camera_info YAML; None: the folder's own.
        model_folder: COLMAP model of them, whose camera is used where there is no camera_info YAML.

    Raises:
        MapError: the folder, its photographs or its calibration are missing.
        LensError: the calibration is malformed.
    """
    if not folder.is_dir():
        raise MapError(f"{folder}: no such folder; expected one with photographs (jpg, png) and {CAMERA_FILE}")
    paths = tuple(sorted(p for p in folder.iterdir() if p.suffix.lower() in _SUFFIXES and p.is_file()))
    if len(paths) < 2:
        raise MapError(f"{folder}: {len(paths)} photographs (jpg, png); a map needs two or more, better 50 to 150")
    if camera_path is None and (folder / CAMERA_FILE).is_file():
        camera_path = folder / CAMERA_FILE
    if camera_path is not None:
        camera = camera_from_yaml(camera_path)
    elif model_folder is not None:
        camera = camera_of_model(model_folder)
    else:
        raise MapError(
            f"{folder}: has no {CAMERA_FILE}; put the ROS camera_info YAML of the photographs' camera there, or give "
            "its path with --camera"
        )
    board_path = folder / BOARD_FILE
    return Photographs(
        folder,
        folder.resolve().name,
        paths,
        {path.name: camera for path in paths},
        board_path if board_path.is_file() else None,
    )


def camera_of_model(folder: Path) -> CameraModel:
    """The one camera that took all photographs of a COLMAP model.

    Raises:
        MapError: the model cannot be read, has no or several cameras, or one of an unknown lens model.
    """
    model = colmap.read_model(folder)
    used = {image.camera_id for image in model.images.values() if image.has_pose}
    cameras = [model.cameras[camera_id] for camera_id in sorted(used)]
    if not cameras:
        raise MapError(f"{folder}: the model registers no photograph; give the folder of one that does")
    first = cameras[0]
    for camera in cameras:
        if (camera.model_name, camera.width, camera.height) != (first.model_name, first.width, first.height) or (
            not np.allclose(camera.params, first.params, rtol=_SAME, atol=_SAME)
        ):
            raise MapError(
                f"{folder}: the model has {len(cameras)} cameras; a map is made of photographs of one. Let COLMAP "
                "share one camera among all (ImageReader.single_camera), or put the camera_info YAML of the one that "
                f"took the photographs into their folder as {CAMERA_FILE}"
            )
    try:
        return camera_from_colmap("photograph", first)
    except LensError as error:
        raise MapError(
            f"{folder}: {error}; make the model with one of these lens models, or put the camera_info YAML of the "
            f"camera into the photographs' folder as {CAMERA_FILE}"
        ) from error


def wrong_camera(*cameras: CameraModel) -> str:
    """The advice for photographs that contradict the intrinsics of the cameras that took them."""
    if len(cameras) > 1:
        given = ", ".join(f"{camera.name} {camera.distortion_model} {camera.fx:.0f} px" for camera in cameras)
        return (
            f"Do the intrinsics belong to the cameras? Given are: {given}. Another lens model, zoom or image size "
            "makes another camera."
        )
    (camera,) = cameras
    return (
        f"Does {CAMERA_FILE} belong to the camera that took the photographs? It gives {camera.distortion_model}, focal "
        f"lengths {camera.fx:.0f} and {camera.fy:.0f} px; another lens model, zoom or image size makes another camera."
    )
