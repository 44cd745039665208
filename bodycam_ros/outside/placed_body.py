"""Where a body begins in the world, of a start file in the frame of a file of stations."""

from collections.abc import Mapping
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.outside.region_settings import RegionSettings
from bodycam_ros.outside.start_file import read_start, start_poses
from bodycam_ros.outside.station import Station
from bodycam_ros.outside.stations_file import read_stations


def placed_body(
    start: Path, file: Path, stations: Mapping[str, Station], body: BodyModel, settings: RegionSettings
) -> Array:
    """Poses (S, 4, 4) in the world, joints closed.

    Args:
        start: file of the segments that a person placed.
        file: of the stations, whose frame it has.
        stations: of that file, in the world; one or more.
        body: segments and joints.
        settings: how far what was placed by hand is off.

    Raises:
        BodyError: the start cannot be used.
        StationError: the stations cannot be read any more.
    """
    name, station = next(iter(stations.items()))
    world_T_file = station.world_T_camera @ inverse(read_stations(file)[name].world_T_camera)
    placed = {segment: world_T_file @ pose for segment, pose in read_start(start, body).items()}
    return start_poses(body, placed, settings)
