"""The photographs of a reference folder, the camera that took them, and work on many of them at once."""

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
    from bodycam_ros.mapping.model_camera import camera_of_model

    return camera_of_model(model_folder)
