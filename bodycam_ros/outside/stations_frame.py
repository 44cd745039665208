"""Whether a file of stations is in the frame that a recording was solved in."""

from pathlib import Path

from bodycam_ros.errors import StationError
from bodycam_ros.outside.stations_file import IN_BOARD
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.yaml_file import read_yaml

_MAP_POINTS = "/map/points"


def check_stations_frame(stations: Path, solved: Path, map_path: Path | None) -> None:
    """Refuse stations on a board where the map, which knows where the board is, is not given, or another is the world.

    Args:
        stations: a file that ``read_stations`` takes.
        solved: the bag that a replay wrote.
        map_path: the map that it should have been solved in; None for none.

    Raises:
        StationError: so it is.
        RecordingError: not a bag.
    """
    entries = read_yaml(stations, "file of static cameras", StationError).values()
    if not any(IN_BOARD in entry for entry in entries):
        return
    with BagFile(solved) as bag:
        in_map = bag.topics.get(_MAP_POINTS) is not None
    if in_map and map_path is None:
        raise StationError(
            f"{stations}: says by {IN_BOARD} where cameras stand, but {solved} was solved in a map; say with --map in "
            "which"
        )
    if map_path is not None and not in_map:
        raise StationError(f"{solved} was solved without a map, in the frame of {stations}: omit --map")
