"""Static cameras of a node, in the frame of its map."""

from pathlib import Path

from bodycam_ros.errors import StationError
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.registration.reference_map import check_metric, load_map
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.static_cameras.stations_file import read_stations


def read_world(file: Path, map_path: str) -> dict[str, Station]:
    """Static cameras of a file, in the frame of a map, or in the file's own if the path is empty.

    Raises:
        StationError, LensError, MapError: as of ``read_stations``, or the map cannot be used.
    """
    if not map_path:
        return read_stations(file)
    reference_map = load_map(Path(map_path))
    check_metric(reference_map, Path(map_path))
    return read_stations(file, reference_map)


def read_static_cameras(parameters: SolverParameters) -> dict[str, Station]:
    """Static cameras of the solver; empty without the parameter ``stations``.

    Raises:
        StationError: as above, a body is to be calibrated, there is no initial estimate of the body, or a parameter of
            static cameras is given without any.
    """
    stations, start, worn = parameters.stations, parameters.start, parameters.worn
    if not stations:
        if start or not worn:
            given = f"start {start}" if start else "worn false"
            raise StationError(f"{given}: is for static cameras; give their file as the parameter 'stations'")
        return {}
    if parameters.rig:
        raise StationError(
            f"{stations}: static cameras are not used in a range of motion; make the body first, then start again "
            "with 'stations' and without 'rig'"
        )
    if not worn and not start:
        raise StationError(
            f"{stations}: static cameras alone need an initial estimate of the body; place it by hand in a file of "
            "segments, and give that as the parameter 'start'"
        )
    return read_world(Path(stations), parameters.map)
