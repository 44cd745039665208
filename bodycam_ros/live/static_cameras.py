"""What the parameters of a node name of static cameras, read and checked."""

from pathlib import Path

from bodycam_ros.errors import StationError
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.registration.reference_map import check_metric, load_map
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.static_cameras.stations_file import read_stations


def read_world(file: Path, map_path: str) -> dict[str, Station]:
    """The stations of a file, in the frame of a map, or in the file's own where the path is empty.

    Raises:
        StationError, LensError, MapError: as of ``read_stations``, or the map cannot be used.
    """
    if not map_path:
        return read_stations(file)
    reference_map = load_map(Path(map_path))
    check_metric(reference_map, Path(map_path))
    return read_stations(file, reference_map)


def stations_of_solver(of: SolverParameters) -> dict[str, Station]:
    """Those that the solver's parameters name; none if they name none.

    Raises:
        StationError: as above, a body is to be made, nobody knows where it is at first, or what only static cameras
            have is given without any.
    """
    if not of.stations and (of.start or not of.worn):
        given = f"start {of.start}" if of.start else "worn false"
        raise StationError(f"{given}: is for static cameras; name with the parameter 'stations' where they stand")
    if not of.stations:
        return {}
    if of.rig:
        raise StationError(
            f"{of.stations}: static cameras take no part in a range of motion; make the body first, then start "
            "again with 'stations' and without 'rig'"
        )
    if not of.worn and not of.start:
        raise StationError(
            f"{of.stations}: static cameras alone do not know where the body is at first; place it by hand in a "
            "file of segments, and give that as the parameter 'start'"
        )
    return read_world(Path(of.stations), of.map)
