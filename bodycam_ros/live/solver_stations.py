"""Static cameras of the solver, and how they measure the body."""

from collections.abc import Mapping
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import StationError
from bodycam_ros.estimation.motion_model import MotionSettings
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.registration.reference_map import load_map
from bodycam_ros.static_cameras.static_measurement import ReportedMeasurement
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.static_cameras.stations_file import read_stations


def read_static_cameras(parameters: SolverParameters) -> dict[str, Station]:
    """Static cameras of the solver in the frame of its map, or of their file without one; empty without ``stations``.

    Raises:
        StationError, LensError, MapError: a file cannot be used, a body is to be calibrated, there is no initial
            estimate of the body, or a parameter of static cameras is given without any.
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
            f"{stations}: static cameras alone need an initial estimate of the body; place it by hand in a "
            "recording with 'bodycam view --place', and give that as the parameter 'start'"
        )
    reference_map = load_map(Path(parameters.map)) if parameters.map else None
    return read_stations(Path(stations), reference_map)


def static_measurement(
    parameters: SolverParameters, stations: Mapping[str, Station], body: BodyModel, motion: MotionSettings
) -> ReportedMeasurement | None:
    """The measurement of a body by what region trackers report; None without static cameras."""
    if not stations:
        return None
    start, placed = parameters.start, None
    if start:
        from bodycam_ros.formats.read_captured import read_start  # it loads SciPy, which few nodes need

        placed = read_start(Path(start), Path(parameters.stations), stations, body).world_T_segment
    return ReportedMeasurement(body, placed, motion)
