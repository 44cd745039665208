"""A folder of recordings, laid out as ``LAYOUT`` says, and what of it is there."""

from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.errors import RecordingError

_BAG_FILE, _BAG_SUFFIXES = "metadata.yaml", (".mcap", ".db3")

LAYOUT = """\
    reference/      photographs of the place, camera.yaml, board.yaml
    map/            instead of these, a map that is ready
    rig.yaml        which camera is on which segment
    rom/            the range of motion: a ros2 bag, or videos
    body.yaml       instead of these, a body that is ready
    takes/NAME/     what is to be solved: ros2 bags, or folders of videos
    lenses/         lens YAMLs of the videos, where they are not beside them
    settings.yaml   ROS parameter file for ingest, body and replay
    equipment.yaml  what the person rides, holds or stands on
    solved/         all that is made of it: map, body, takes/NAME

A map, a body, what they are made of, and one take at least; all else may be left
out. Any of it may be a link to somewhere else.
"""
"""What a folder should look like, for help and messages."""


@dataclass(frozen=True)
class Source:
    """A recording as it was made.

    Attributes:
        name: of it.
        path: bag, or folder of videos.
        is_bag: so it needs no ingest.
    """

    name: str
    path: Path
    is_bag: bool


@dataclass(frozen=True)
class RecordingFolder:
    """What is there; None for what is not.

    Attributes:
        path: of the folder.
        rom: the range of motion.
        takes: by name.
    """

    path: Path
    reference: Path | None
    map: Path | None
    rig: Path | None
    rom: Source | None
    body: Path | None
    takes: tuple[Source, ...]
    lenses: Path | None
    settings: Path | None
    equipment: Path | None

    @property
    def solved(self) -> Path:
        """Where everything goes that is made."""
        return self.path / "solved"

    @classmethod
    def look_into(cls, path: Path) -> "RecordingFolder":
        """Find out what is there.

        Raises:
            RecordingError: it is no folder, holds nothing of what it should, or two takes of the same name.
        """
        if not path.is_dir():
            raise RecordingError(f"{path}: is no folder; expected one with\n{LAYOUT}")
        takes = path / "takes"
        found = cls(
            path,
            reference=_there(path / "reference"),
            map=_there(path / "map"),
            rig=_there(path / "rig.yaml"),
            rom=source_at(path / "rom"),
            body=_there(path / "body.yaml"),
            takes=tuple(s for each in sorted(takes.iterdir()) if (s := source_at(each))) if takes.is_dir() else (),
            lenses=_there(path / "lenses"),
            settings=_there(path / "settings.yaml"),
            equipment=_there(path / "equipment.yaml"),
        )
        by_name: dict[str, Path] = {}
        for take in found.takes:
            if (other := by_name.setdefault(take.name, take.path)) != take.path:
                raise RecordingError(f"{take.path}: is a take of the same name as {other}; rename one of the two")
        if found.rom is None and not found.takes and found.reference is None:
            raise RecordingError(f"{path}: holds nothing that could be solved; expected\n{LAYOUT}")
        return found

    def missing(self) -> list[str]:
        """What lacks for the way to its end, in sentences."""
        lacks = []
        if self.map is None and self.reference is None:
            lacks.append("reference/ with photographs of the place (or map/): without a map nothing can be solved")
        if self.body is None and self.rom is None:
            lacks.append("rom/ with a range of motion (or body.yaml): without a body no take can be solved")
        if self.body is None and self.rom is not None and self.rig is None:
            lacks.append("rig.yaml, which says on which segment each camera is: without it no body can be made")
        if not self.takes:
            lacks.append("takes/NAME/ with what is to be solved")
        return lacks


def _there(path: Path) -> Path | None:
    return path if path.exists() else None


def source_at(path: Path) -> Source | None:
    """A recording; None if there is none of that name, or it is hidden."""
    if not path.exists() or path.name.startswith("."):
        return None
    is_bag = path.suffix in _BAG_SUFFIXES or (path / _BAG_FILE).is_file()
    return Source(path.stem if path.is_file() else path.name, path, is_bag) if is_bag or path.is_dir() else None
