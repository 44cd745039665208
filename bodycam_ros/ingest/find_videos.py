"""Which files are which camera's: a camera is a file's name, or that of the folder with its chapters."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.video.video_file import SUFFIXES

_GOPRO_FIRST = re.compile(r"(?P<kind>G[HXL])(?P<chapter>\d\d)(?P<number>\d{4})", re.IGNORECASE)
_GOPRO_OLD = re.compile(r"(?P<kind>GOPR|GP(?P<chapter>\d\d))(?P<number>\d{4})", re.IGNORECASE)
_NUMBERED = re.compile(r"(?P<name>.+?)_(?P<chapter>\d{1,3})")


@dataclass(frozen=True)
class CameraFiles:
    """The files of one camera.

    Attributes:
        camera: its name.
        paths: its chapters, in order.
        lens_stem: the file's name without ending that its lens YAML has, too.
    """

    camera: str
    paths: tuple[Path, ...]


def find_videos(given: Sequence[Path]) -> tuple[list[CameraFiles], list[str]]:
    """Sort files, and the videos in folders, into cameras.

    A folder with videos gives a camera per file; a folder with folders of videos one per folder. Chapters are joined:
    GoPro's GH010123, GH020123 and GOPR0123, GP010123, and others' ``head_1``, ``head_2``.

    Returns:
        The cameras by name, and what is wrong with those that are left out: several recordings of one name.

    Raises:
        RecordingError: something given does not exist, or holds no video.
    """
    by_camera: dict[str, list[list[Path]]] = {}
    for path in given:
        for camera, recordings in _in(path).items():
            by_camera.setdefault(camera, []).extend(recordings)
    found, faults = [], []
    for camera, recordings in sorted(by_camera.items()):
        distinct = list({tuple(path.resolve() for path in paths): tuple(paths) for paths in recordings}.values())
        if len(distinct) == 1:
            found.append(CameraFiles(camera, distinct[0]))
            continue
        names = " and ".join(str(paths[0]) for paths in distinct)
        faults.append(
            f"camera {camera}: left out, for {names} are several recordings of it, which overlap in time; give one of "
            "them, or name cameras apart"
        )
    return found, faults


def _in(path: Path) -> dict[str, list[list[Path]]]:
    """Camera -> its recordings, each a list of chapters, in a file or folder."""
    if not path.exists():
        raise RecordingError(f"{path}: does not exist; give video files, or folders with them")
    if not path.is_dir():
        return _recordings([path])
    if videos := _videos_in(path):
        return _recordings(videos)
    inner = {folder.name: _videos_in(folder) for folder in sorted(path.iterdir()) if folder.is_dir()}
    cameras = {name: list(_recordings(videos).values()) for name, videos in inner.items() if videos}
    if not cameras:
        raise RecordingError(f"{path}: holds no video; expected files such as head.mp4, or a folder for each camera")
    return {name: [paths for recording in recordings for paths in recording] for name, recordings in cameras.items()}


def _videos_in(folder: Path) -> list[Path]:
    return sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in SUFFIXES and not path.name.startswith(".") and not path.is_dir()
    )


def _recordings(videos: Iterable[Path]) -> dict[str, list[list[Path]]]:
    """Camera -> its recordings among files of one folder."""
    videos = list(videos)
    numbered = _numbered_names([path.stem for path in videos])
    groups: dict[tuple[str, str], list[tuple[int, Path]]] = {}
    for path in videos:
        recording, chapter = _chapter(path.stem, numbered)
        groups.setdefault((recording, path.suffix.lower()), []).append((chapter, path))
    cameras: dict[str, list[list[Path]]] = {}
    for (recording, _), chapters in sorted(groups.items()):
        paths = [path for _, path in sorted(chapters)]
        name = recording if recording in numbered else paths[0].stem
        cameras.setdefault(name, []).append(paths)
    return cameras


def _chapter(stem: str, numbered: set[str]) -> tuple[str, int]:
    """What tells a recording from others, and which chapter of it a file is."""
    if found := _GOPRO_FIRST.fullmatch(stem):
        return f"{found['kind'].upper()}{found['number']}", int(found["chapter"])
    if found := _GOPRO_OLD.fullmatch(stem):
        return f"GOPR{found['number']}", int(found["chapter"] or 0)
    if (found := _NUMBERED.fullmatch(stem)) and found["name"] in numbered:
        return found["name"], int(found["chapter"])
    return (stem, 0)


def _numbered_names(stems: Iterable[str]) -> set[str]:
    """Names whose files are numbered without a gap from 1 on, or from 2 on behind one that has no number."""
    stems = set(stems)
    numbers: dict[str, set[int]] = {}
    for stem in stems:
        if found := _NUMBERED.fullmatch(stem):
            numbers.setdefault(found["name"], set()).add(int(found["chapter"]))
    names = set()
    for name, present in numbers.items():
        start = 2 if name in stems else 1
        if len(present) + (name in stems) > 1 and present == set(range(start, start + len(present))):
            names.add(name)
    return names
