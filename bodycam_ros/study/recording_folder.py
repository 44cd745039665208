"""A folder of recordings of one person in one place, which ``bodycam run`` solves."""

from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.study.study import Place, Recording, Study, Subject, find_source

LAYOUT = """\
    reference/      photographs of the place, camera.yaml, board.yaml
    map/            instead of these: an existing map
    rig.yaml        which camera is on which segment
    rom/            the range of motion: a ros2 bag, or videos
    body.yaml       instead of these: an existing body
    takes/NAME/     what is to be solved: ros2 bags, or folders of videos
    lenses/         lens YAMLs of the videos, where they are not beside them
    settings.yaml   ROS parameter file for body and replay
    equipment.yaml  what the person rides, holds or stands on
    solved/         all results: map, body, takes/NAME

Needed are a map, a body, or what they are made of, and one take. Any of it may
be a link to another place.
"""
"""The layout, for help and messages."""

SOLVED = "solved"


def read_recording_folder(path: Path) -> Study:
    """The study of a folder that is laid out as ``LAYOUT`` says.

    Raises:
        RecordingError: no folder, nothing in it that could be solved, or two takes of the same name.
    """
    if not path.is_dir():
        raise RecordingError(f"{path}: is no folder; expected one with\n{LAYOUT}")
    there = {name: path / name for name in ("reference", "map", "rig.yaml", "body.yaml", "lenses", "settings.yaml")}
    there = {name: each for name, each in there.items() if each.exists()}
    equipment = path / "equipment.yaml"
    takes = sorted((path / "takes").iterdir()) if (path / "takes").is_dir() else []
    sources = [source for take in takes if (source := find_source(take)) is not None]
    by_name: dict[str, Path] = {}
    for source in sources:
        if (other := by_name.setdefault(source.name, source.path)) != source.path:
            raise RecordingError(f"{source.path}: is a take of the same name as {other}; rename one of the two")
    rom = find_source(path / "rom")
    if rom is None and not sources and "reference" not in there:
        raise RecordingError(f"{path}: holds nothing that could be solved; expected\n{LAYOUT}")
    place = Place("", there.get("map"), there.get("reference"), Path())
    subject = Subject("", there.get("body.yaml"), there.get("rig.yaml"), rom, "", Path())
    recordings = (Recording(source, "", "", None, equipment if equipment.exists() else None) for source in sources)
    return Study(path, {"": place}, {"": subject}, tuple(recordings), there.get("settings.yaml"), there.get("lenses"))


def list_missing(study: Study) -> list[str]:
    """What a folder lacks to be solved, in sentences."""
    place, subject = study.places[""], study.subjects[""]
    lacks = []
    if place.map is None and place.reference is None:
        lacks.append("reference/ with photographs of the place (or map/): without a map nothing can be solved")
    if subject.body is None and subject.rom is None:
        lacks.append("rom/ with a range of motion (or body.yaml): without a body no take can be solved")
    if subject.body is None and subject.rom is not None and subject.rig is None:
        lacks.append("rig.yaml, which says on which segment each camera is: without it no body can be made")
    if not study.recordings:
        lacks.append("takes/NAME/ with what is to be solved")
    return lacks
