"""What a view shows, read and checked before a browser is asked to show it."""

import logging
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from functools import partial
from io import StringIO
from pathlib import Path

import viser
from websockets.asyncio import server as websockets_server

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anthropometry import SegmentName
from bodycam_ros.errors import RecordingError, ViewError
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.topics import ROBOT, published_robot
from bodycam_ros.results.urdf_tree import UrdfTree
from bodycam_ros.static_cameras.person_model import with_hands
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.static_cameras.stations_file import check_stations_frame, read_stations
from bodycam_ros.viewer.correction import BodyFile
from bodycam_ros.viewer.other_motion import OtherMotion, read_other_motion
from bodycam_ros.viewer.timeline import Motion, read_motion


@dataclass(frozen=True, eq=False)
class Sources:
    """What is looked at.

    Attributes:
        body_file: where the body comes from and is written to.
        body: as it was read.
        reference_map: the place; None where static cameras are all that is known of it.
        motion: of the body.
        solved: the bag that the motion is from.
        recording: the bag with images.
        cameras: of the body, and static ones, that have images.
        stations: static cameras.
        surface: folder of the body's meshes, if another is wanted than the body's own.
        other: another solution of the recording, to be compared with.
    """

    body_file: BodyFile
    body: BodyModel
    reference_map: ReferenceMap | None
    motion: Motion
    solved: Path | None
    recording: Path | None
    cameras: tuple[str, ...]
    stations: Mapping[str, Station] = field(default_factory=dict)
    surface: Path | None = None
    other: OtherMotion | None = None

    @classmethod
    def read(
        cls,
        solved: Path | None,
        map_path: Path | None,
        body_path: Path,
        recording: Path | None,
        stations_path: Path | None = None,
        surface: Path | None = None,
        compare: Path | None = None,
    ) -> "Sources":
        """Read them all.

        Raises:
            BodycamError: one of them is missing or damaged, or they do not fit each other.
        """
        if recording is not None and solved is None:
            place = f"--stations {stations_path}" if map_path is None else f"--map {map_path}"
            raise ViewError(
                f"{recording}: without OUT nobody knows where the body was in these images; solve them first with "
                f"'bodycam replay {recording} {place} --body {body_path} -o OUT', then name OUT here too"
            )
        if compare is not None and solved is None:
            raise ViewError(f"--compare {compare}: name OUT too, the bag that it is compared with")
        if map_path is None and stations_path is None:
            raise ViewError("nothing to stand in: give the place's reference map with --map, or --stations")
        body_file = BodyFile(body_path)
        body = body_file.read(with_hands if _has_hands(solved, stations_path) else lambda body: body)
        reference_map = None if map_path is None else ReferenceMap.load(map_path)
        stations = {} if stations_path is None else read_stations(stations_path, reference_map)
        if stations_path is not None and solved is not None:
            check_stations_frame(stations_path, solved, map_path)
        motion = Motion.standing(body) if solved is None else read_motion(solved, body)
        cameras: tuple[str, ...] = ()
        if recording is not None:
            with open_recording(recording) as bag:
                cameras = tuple(camera for camera in (*body.mounts, *stations) if camera in bag.cameras)
                if not cameras:
                    raise RecordingError(
                        f"{recording}: has none of the body's cameras; it has {', '.join(bag.cameras)}, the body "
                        f"{', '.join(body.mounts) or 'none'}"
                        + (f", {stations_path} {', '.join(stations)}" if stations else "")
                    )
        other = None if compare is None else read_other_motion(compare, motion)
        return cls(body_file, body, reference_map, motion, solved, recording, cameras, stations, surface, other)


def _has_hands(solved: Path | None, stations: Path | None) -> bool:
    """Whether the replay gave the body hands, as it does for static cameras; before it, whether it would."""
    if solved is None:
        return stations is not None
    with BagFile(solved) as bag:
        text = published_robot(bag)
    return bool(text) and any(
        SegmentName(segment).kind == "hand" for segment in UrdfTree.parse(text, f"{solved}: {ROBOT}").segments
    )


HOST = "127.0.0.1"

_OUR_PAGES = re.compile(r"http://(127\.0\.0\.1|localhost)(:\d+)?")
"""Origins that may connect: any page of the web that the user has open could reach a server on this machine too."""

_HIGHEST_PORT = 65535


class LocalServer(viser.ViserServer):
    """viser's server, bound to this machine.

    viser itself takes the next port when one is in use, offers to share the scene through a server of its authors, and
    lets any page connect. All three are off here.

    Raises:
        ViewError: the port cannot be used.
    """

    def __init__(self, port: int, label: str) -> None:
        if not 0 <= port <= _HIGHEST_PORT:
            raise ViewError(f"port {port}: expected 0 (any free port) to {_HIGHEST_PORT}")
        # A page that is closed while it connects is no news, and would be a traceback.
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
        with redirect_stdout(StringIO()), _only_our_pages():
            super().__init__(HOST, port, label, verbose=False)
        self.gui.configure_theme(show_logo=False, show_share_button=False)
        self.gui.main_panel.dock_right()
        if port not in (0, self.get_port()):
            self.stop()
            raise ViewError(
                f"port {port} of this machine is in use or not allowed; is another 'bodycam view' running? Choose "
                "another one with --port, or any free one with --port 0"
            )

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{HOST}:{self.get_port()}"

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Share nothing; a page that asks for it is not answered."""
        return None

    def stop(self) -> None:
        """Stop serving."""
        with redirect_stdout(StringIO()):
            super().stop()


@contextmanager
def _only_our_pages() -> Iterator[None]:
    """Servers that are started meanwhile refuse other pages: viser does not hand this setting through."""
    serve = websockets_server.serve
    websockets_server.serve = partial(serve, origins=[_OUR_PAGES])  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets_server.serve = serve  # type: ignore[misc]
