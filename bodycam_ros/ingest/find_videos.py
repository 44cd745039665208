"""Which files belong to which camera: a camera is named after its file, or after the folder with its files."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.recording.image_folder import IMAGE_SUFFIXES
from bodycam_ros.recording.video_file import SUFFIXES

_GOPRO = re.compile(r"(?P<kind>G[HXL])(?P<chapter>\d\d)(?P<number>\d{4})", re.IGNORECASE)
_GOPRO_OLD = re.compile(r"(?P<kind>GOPR|GP(?P<chapter>\d\d))(?P<number>\d{4})", re.IGNORECASE)
_NUMBERED = re.compile(r"(?P<name>.+?)_(?P<chapter>\d{1,3})")

Recordings = dict[str, list[tuple[Path, ...]]]
"""Camera -> its recordings, each by its chapters."""


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


def find_videos(given: Sequence[Path], lens_folder: Path | None = None) -> tuple[list[CameraFiles], list[str]]:
    """Sort files, and those in folders, into cameras.

    A folder with videos gives a camera per file, one with images a camera, one with folders of these a camera per
    folder. Chapters are joined: GoPro's GH010123, GH020123 and GOPR0123, GP010123, and others' ``head_1``, ``head_2``,
    unless these have a lens YAML each, and so are cameras of their own.

    Returns:
        The cameras by name, and what is wrong with those that are left out: several recordings of one name.

    Raises:
        RecordingError: something given does not exist, or has no video.
    """
    cameras: Recordings = {}
    files = [path for path in given if not path.is_dir()]
    for folder in dict.fromkeys(path.parent for path in files):
        _add(cameras, _recordings([path for path in files if path.parent == folder], lens_folder))
    for path in given:
        if path.is_dir():
            _add(cameras, _in_folder(path, lens_folder))
        elif not path.exists():
            raise RecordingError(f"{path}: does not exist; give video files, or folders with them")
    found, faults = [], []
    for camera, recordings in sorted(cameras.items()):
        distinct = list({tuple(path.resolve() for path in paths): paths for paths in recordings}.values())
        if len(distinct) == 1:
            found.append(CameraFiles(camera, distinct[0]))
            continue
        names = " and ".join(str(paths[0]) for paths in distinct)
        faults.append(
            f"camera {camera}: left out: {names} are several recordings of one camera, which overlap in time; give one "
            "of them, or name cameras apart"
        )
    return found, faults


def _add(cameras: Recordings, more: Recordings) -> None:
    for camera, recordings in more.items():
        cameras.setdefault(camera, []).extend(recordings)


def _in_folder(folder: Path, lens_folder: Path | None) -> Recordings:
    if videos := _files_in(folder, SUFFIXES):
        return _recordings(videos, lens_folder)
    if images := _files_in(folder, IMAGE_SUFFIXES):
        return {folder.resolve().name: [tuple(images)]}
    cameras: Recordings = {}
    for inner in sorted(path for path in folder.iterdir() if path.is_dir()):
        if videos := _files_in(inner, SUFFIXES):
            cameras[inner.name] = [paths for each in _recordings(videos, None).values() for paths in each]
        elif images := _files_in(inner, IMAGE_SUFFIXES):
            cameras[inner.name] = [tuple(images)]
    if not cameras:
        raise RecordingError(f"{folder}: has no video; expected files such as head.mp4, or a folder for each camera")
    return cameras


def _files_in(folder: Path, suffixes: frozenset[str]) -> list[Path]:
    return sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in suffixes and not path.name.startswith(".") and not path.is_dir()
    )


def _recordings(videos: Sequence[Path], lens_folder: Path | None) -> Recordings:
    """Camera -> its recordings among the videos of one folder."""
    with_lens = {path.stem for path in videos if ((lens_folder or path.parent) / f"{path.stem}.yaml").exists()}
    numbered = _numbered_names({path.stem for path in videos}, with_lens)
    groups: dict[tuple[str, str], list[tuple[int, Path]]] = {}
    for path in videos:
        recording, chapter = _chapter(path.stem, numbered)
        groups.setdefault((recording, path.suffix.lower()), []).append((chapter, path))
    cameras: Recordings = {}
    for (recording, _), chapters in sorted(groups.items()):
        paths = tuple(path for _, path in sorted(chapters))
        cameras.setdefault(recording if recording in numbered else paths[0].stem, []).append(paths)
    return cameras


def _chapter(stem: str, numbered: set[str]) -> tuple[str, int]:
    """What a recording's files have in common, and which chapter of it a file is."""
    if found := _GOPRO.fullmatch(stem):
        return f"{found['kind'].upper()}{found['number']}", int(found["chapter"])
    if found := _GOPRO_OLD.fullmatch(stem):
        return f"GOPR{found['number']}", int(found["chapter"] or 0)
    if (found := _NUMBERED.fullmatch(stem)) and found["name"] in numbered:
        return found["name"], int(found["chapter"])
    return (stem, 0)


def _numbered_names(stems: set[str], with_lens: set[str]) -> set[str]:
    """Names whose files are numbered without a gap from 1 on, or from 2 on behind one that has no number."""
    numbers: dict[str, set[int]] = {}
    apart = set()
    for stem in stems:
        if found := _NUMBERED.fullmatch(stem):
            name, chapter = found["name"], int(found["chapter"])
            numbers.setdefault(name, set()).add(chapter)
            if chapter > 1 and stem in with_lens:
                apart.add(name)
    names = set()
    for name, present in numbers.items():
        start = 2 if name in stems else 1
        if len(present) + (name in stems) > 1 and present == set(range(start, start + len(present))):
            names.add(name)
    return names - apart
