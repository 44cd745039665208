"""Static cameras as the solver meets them live: what they say of the body, and where it tells them that the body is."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Self

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import StationError
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.segment_poses import SEGMENT_POSES, SEGMENT_POSES_TYPE, segment_poses
from bodycam_ros.messages.segments_now import SEGMENTS_NOW, SEGMENTS_NOW_TYPE, segments_now_message
from bodycam_ros.nodes.qos import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.outside.placed_body import placed_body
from bodycam_ros.outside.station import Station
from bodycam_ros.outside.station_reports import StationReports
from bodycam_ros.outside.stations_file import read_stations
from bodycam_ros.registration.loaded_map import load_map
from bodycam_ros.registration.reference_map import check_metric
from bodycam_ros.solving.body_now import BodyNow
from bodycam_ros.solving.said_segments import SaidSegments


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


class Stations:
    """Hears stations, and tells them of the body.

    Args:
        stage: the solver.
        file: of the stations.
        map_path: folder of the map whose frame is the world; empty: the file's own is.
        start: file of where the body is at first; empty where worn cameras tell.
        on_said: called with what a station says.

    Attributes:
        stations: by name.

    Raises:
        StationError, LensError, MapError: the stations cannot be read.
    """

    def __init__(
        self, stage: Stage[Any], file: Path, map_path: str, start: str, on_said: Callable[[SaidSegments], None]
    ) -> None:
        self._stage, self._file, self._start = stage, file, start
        self._on_said = on_said
        self.stations: Mapping[str, Station] = read_world(file, map_path)
        self._told_ns: int | None = None
        # Who starts again must hear both instants.
        self._now = stage.publisher(SEGMENTS_NOW_TYPE, SEGMENTS_NOW, latched(2))
        for station in self.stations:
            topic = f"{station}{SEGMENT_POSES}"
            stage.subscription(SEGMENT_POSES_TYPE, topic, partial(self._hear, station), reliable(STAGE_DEPTH))

    @classmethod
    def of(cls, stage: Stage[SolverParameters], on_said: Callable[[SaidSegments], None]) -> Self | None:
        """Those that the solver's parameters name; None if they name none.

        Raises:
            StationError: as above, a body is to be made, nobody says where it is at first, or what only static cameras
                have is said of none.
        """
        of = stage.parameters
        if not of.stations and (of.start or not of.worn):
            said = f"start {of.start}" if of.start else "worn false"
            raise StationError(f"{said}: is for static cameras; say with the parameter 'stations' where they stand")
        if not of.stations:
            return None
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
        return cls(stage, Path(of.stations), of.map, of.start, on_said)

    def reports(self, body: BodyModel) -> StationReports:
        """What puts together what they say of a body.

        Raises:
            BodyError: the start cannot be used.
        """
        of = self._stage.settings
        placed = placed_body(Path(self._start), self._file, self.stations, body, of.region) if self._start else None
        return StationReports(body, placed, of.region, of.motion)

    def tell(self, lately: Sequence[BodyNow], body: BodyModel) -> None:
        """Where the body is at the latest instant, once; and at the one before, of which more is known by now.

        What a limb did in between is its velocity. What was said at the time would not do: that the body is found to be
        elsewhere than it was expected is no motion.
        """
        if lately and lately[-1].stamp_ns != self._told_ns:
            self._told_ns = lately[-1].stamp_ns
            for now in lately:
                self._now.publish(segments_now_message(self._stage.make, now, body))

    def _hear(self, station: str, message: Message) -> None:
        try:
            said = segment_poses(message)
            if said.station != station:
                raise ValueError(f"it is from {said.station}")
        except ValueError as error:
            reason = f"{station}{SEGMENT_POSES}: malformed message ({error})"
            self._stage.skipped.add("stations' words skipped", reason)
            return
        self._on_said(said)
