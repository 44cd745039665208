"""The photographs of a reference folder, and the cameras that took them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.camera import CameraModel, camera_from_yaml
from bodycam_ros.errors import MapError

CAMERA_FILE = "camera.yaml"
BOARD_FILE = "board.yaml"
_SUFFIXES = {".jpg", ".jpeg", ".png"}


@dataclass(frozen=True)
class Photographs:
    """A reference folder.

    Attributes:
        folder: its path.
        name: of the folder, or of the recording that its photographs were taken from.
        paths: image files in order of name.
        camera_of_name: file name -> the camera that took it.
    """

    folder: Path
    name: str
    paths: tuple[Path, ...]
    camera_of_name: Mapping[str, CameraModel]

    @property
    def where(self) -> str:
        """For messages: the folder, or the recording if its frames are in a scratch folder."""
        return str(self.folder) if self.name == self.folder.resolve().name else self.name


def find_photographs(folder: Path, camera_path: Path | None = None) -> Photographs:
    """List a reference folder.

    Args:
        folder: with the photographs.
        camera_path: camera_info YAML; None: the folder's own.

    Raises:
        MapError: the folder, its photographs or its calibration are missing.
        LensError: the calibration is malformed.
    """
    if not folder.is_dir():
        raise MapError(f"{folder}: no such folder; expected one with photographs (jpg, png) and {CAMERA_FILE}")
    paths = tuple(sorted(p for p in folder.iterdir() if p.suffix.lower() in _SUFFIXES and p.is_file()))
    for path in paths:
        if not path.name.isprintable():
            raise MapError(f"{folder}: photograph {path.name!a} has a name that cannot be written; rename it")
    if len(paths) < 2:
        raise MapError(f"{folder}: {len(paths)} photographs (jpg, png); a map needs two or more, better 50 to 150")
    if camera_path is None and not (folder / CAMERA_FILE).is_file():
        raise MapError(
            f"{folder}: has no {CAMERA_FILE}; put the ROS camera_info YAML of the photographs' camera there, or give "
            "its path with --camera"
        )
    camera = camera_from_yaml(camera_path or folder / CAMERA_FILE)
    return Photographs(folder, folder.resolve().name, paths, {path.name: camera for path in paths})


def wrong_camera(*cameras: CameraModel) -> str:
    """The advice for photographs that contradict the intrinsics of the cameras that took them."""
    if len(cameras) > 1:
        given = ", ".join(f"{camera.name} {camera.distortion_model} {camera.fx:.0f} px" for camera in cameras)
        return (
            f"Check that the calibrations belong to the cameras: {given}. Each must be of the same lens, zoom and "
            "image size."
        )
    (camera,) = cameras
    return (
        f"Check that {CAMERA_FILE} belongs to the camera that took the photographs: "
        f"{camera.distortion_model}, focal lengths {camera.fx:.0f} and {camera.fy:.0f} px; it must be of the same "
        "lens, zoom and image size."
    )
