"""Which files belong to which camera: a camera is named after its file, or after the folder with its files."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.recording.bag_file import is_bag
from bodycam_ros.recording.image_folder import IMAGE_SUFFIXES
from bodycam_ros.recording.video_file import SUFFIXES

_CHAPTER = re.compile(r"G[HXL](?P<hero>\d\d)\d{4}|GP(?P<old>\d\d)\d{4}|.+?(?P<number>_\d{1,3})", re.IGNORECASE)
_TOPIC_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_FIRST_OLD = re.compile(r"GOPR(?=\d{4}$)", re.IGNORECASE)

Recordings = list[tuple[str, tuple[Path, ...]]]
"""Camera and chapters of each."""


@dataclass(frozen=True)
class CameraFiles:
    """The files of one camera.

    Attributes:
        camera: its name.
        paths: its chapters, or its images, in order.
    """

    camera: str
    paths: tuple[Path, ...]

    @property
    def are_images(self) -> bool:
        """Whether these are images and not videos."""
        return self.paths[0].suffix.lower() in IMAGE_SUFFIXES

    def lens_path(self, folder: Path | None) -> Path:
        """Where the lens YAML is: named after the camera, in the folder given, or else beside its files.

        Raises:
            LensError: there is none; the message names the places that were searched.
        """
        beside = self.paths[0].parent
        names = dict.fromkeys((self.camera, *(() if self.are_images else (self.paths[0].stem,))))
        folders = [folder] if folder else [beside, *([beside.parent] if beside.name == self.camera else [])]
        searched = [place / f"{name}.yaml" for place in folders for name in names]
        for path in searched:
            if path.exists():
                return path
        raise LensError(
            f"there is no lens YAML for {self.paths[0]}; expected {' or '.join(map(str, searched))} (camera_info "
            "YAML, as ROS calibration tools write it), or another folder with --lenses"
        )


def find_videos(given: Sequence[Path], lens_folder: Path | None = None) -> tuple[list[CameraFiles], dict[str, str]]:
    """Sort files, and those in folders, into cameras.

    A folder with videos gives a camera per file, one with images a camera, one with folders of these a camera per
    folder. Beside videos a folder is a camera if there is a lens YAML of its name. Chapters are joined: GoPro's
    GH010123, GH020123 and GOPR0123, GP010123, and others' ``head_1``, ``head_2``, unless these have a lens YAML each,
    and so are cameras of their own.

    Returns:
        The cameras by name, and camera that is left out -> why: several recordings of one name, or a name that a topic
        cannot have.

    Raises:
        RecordingError: something given does not exist, is a bag, or has no video.
    """
    for path in given:
        if is_bag(path):
            raise RecordingError(f"{path}: is a bag already, which needs no ingest")
    recordings: Recordings = []
    files = [path for path in given if not path.is_dir()]
    for folder in dict.fromkeys(path.parent for path in files):
        recordings += _recordings([path for path in files if path.parent == folder], lens_folder)
    for path in given:
        if path.is_dir():
            recordings += _in_folder(path, lens_folder)
        elif not path.exists():
            raise RecordingError(f"{path}: does not exist; give video files, or folders with them")
    cameras: dict[str, dict[tuple[Path, ...], tuple[Path, ...]]] = {}
    for camera, paths in recordings:
        cameras.setdefault(camera, {})[tuple(path.resolve() for path in paths)] = paths
    found: list[CameraFiles] = []
    causes: dict[str, str] = {}
    for camera, by_place in sorted(cameras.items()):
        names = " and ".join(str(paths[0]) for paths in by_place.values())
        if not _TOPIC_NAME.fullmatch(camera):
            causes[camera] = (
                f"{names}: no topic can have this name; rename it (letters, digits, underscores; a letter first)"
            )
        elif len(by_place) > 1:
            causes[camera] = (
                f"{names} are several recordings of one camera, which overlap in time; give one of them, or give each "
                "camera its own name"
            )
        else:
            found.append(CameraFiles(camera, *by_place.values()))
    return found, causes


def _in_folder(folder: Path, lens_folder: Path | None) -> Recordings:
    if videos := _files_in(folder, SUFFIXES):
        inner = [files for files in _in_inner_folders(folder) if _has_lens(CameraFiles(*files), lens_folder)]
        return [*_recordings(videos, lens_folder), *inner]
    if images := _files_in(folder, IMAGE_SUFFIXES):
        return [(folder.resolve().name, tuple(images))]
    recordings = _in_inner_folders(folder)
    if not recordings:
        raise RecordingError(f"{folder}: has no video; expected files such as head.mp4, or a folder for each camera")
    return recordings


def _in_inner_folders(folder: Path) -> Recordings:
    recordings: Recordings = []
    for inner in sorted(path for path in folder.iterdir() if path.is_dir()):
        if videos := _files_in(inner, SUFFIXES):
            recordings += [(inner.name, paths) for _, paths in _recordings(videos, None)]
        elif images := _files_in(inner, IMAGE_SUFFIXES):
            recordings.append((inner.name, tuple(images)))
    return recordings


def _has_lens(files: CameraFiles, lens_folder: Path | None) -> bool:
    """Whether there is a lens YAML that is named after the camera."""
    try:
        return files.lens_path(lens_folder).stem == files.camera
    except LensError:
        return False


def _files_in(folder: Path, suffixes: frozenset[str]) -> list[Path]:
    return sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in suffixes and not path.name.startswith(".") and not path.is_dir()
    )


def _recordings(videos: Sequence[Path], lens_folder: Path | None) -> Recordings:
    """Cameras and their recordings among the videos of one folder."""
    groups: dict[tuple[str, str], list[tuple[int, Path, bool]]] = {}
    for path in videos:
        name, chapter, is_numbered = _chapter(path.stem)
        groups.setdefault((name, path.suffix.lower()), []).append((chapter, path, is_numbered))
    recordings: Recordings = []
    for (name, _), chapters in sorted(groups.items()):
        numbers, paths, numbered = zip(*sorted(chapters), strict=True)
        lenses = [((lens_folder or path.parent) / f"{path.stem}.yaml").exists() for path in paths]
        if any(numbered) and (numbers != tuple(range(1, 1 + len(paths))) or any(lenses[1:]) or len(paths) == 1):
            recordings += [(path.stem, (path,)) for path in paths]
        else:
            recordings.append((name if any(numbered) else paths[0].stem, paths))
    return recordings


def _chapter(stem: str) -> tuple[str, int, bool]:
    """What a recording's files have in common, which chapter of it a file may be, and whether it is named by ``_1``."""
    found = _CHAPTER.fullmatch(stem)
    if found is None:
        return _FIRST_OLD.sub("GP", stem), 1, False
    kind = found.lastgroup or ""
    name, chapter = stem[: found.start(kind)] + stem[found.end(kind) :], int(found[kind].lstrip("_"))
    return name, chapter + 1 if kind == "old" else chapter, kind == "number"
