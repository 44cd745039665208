"""The one reader of other systems' motions, whatever their format."""

from collections.abc import Callable
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.formats.bvh import captured_bvh
from bodycam_ros.formats.c3d import captured_c3d
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.trc import captured_trc
from bodycam_ros.formats.tum import captured_tum

FORMATS: dict[str, Callable[[Path], CapturedMotion]] = {
    ".bvh": captured_bvh,
    ".c3d": captured_c3d,
    ".trc": captured_trc,
    ".tum": captured_tum,
    ".txt": captured_tum,
}
"""End of a file's name -> reads it."""


def is_captured(path: Path) -> bool:
    """Whether a path is another system's: a file, or a folder with files of trajectories right in it."""
    return not path.is_dir() or (any(path.glob("*.tum")) and not (path / "segments").is_dir())


def read_captured(path: Path) -> CapturedMotion:
    """Read a motion, by the end of its name.

    Raises:
        RecordingError: it is not there, of no format that is known, or damaged.
    """
    if not path.exists():
        raise RecordingError(f"{path}: does not exist")
    if path.is_dir():
        return captured_tum(path)
    read = FORMATS.get(path.suffix.lower())
    if read is None:
        raise RecordingError(
            f"{path}: of no format that is known by its name; known are {', '.join(FORMATS)} (.txt: TUM), a folder of "
            "*.tum, and a recording's folder with ground truth"
        )
    return read(path)
