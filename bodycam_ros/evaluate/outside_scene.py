"""A solved body as static cameras should have seen it: its surface, where they stand, and what their images say."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf_reader import body_from_urdf
from bodycam_ros.camera.camera_image import CameraImage, decode_colour
from bodycam_ros.drawing.picture_style import EQUIPMENT, side_colour
from bodycam_ros.errors import StationError
from bodycam_ros.geometry import Array
from bodycam_ros.outside.body_surface import BodySurface
from bodycam_ros.outside.chosen_surface import surfaces_of
from bodycam_ros.outside.region_settings import RegionSettings
from bodycam_ros.outside.region_tracker import RegionTracker
from bodycam_ros.outside.seen_contour import SeenContour
from bodycam_ros.outside.station import Station
from bodycam_ros.outside.station_view import Image
from bodycam_ros.outside.stations_file import read_stations
from bodycam_ros.outside.stations_frame import check_stations_frame
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.solved.solved_recording import SolvedRecording
from bodycam_ros.solved.topics import published_robot
from bodycam_ros.solved.trajectory import interpolated

_SETTINGS = replace(RegionSettings(), line_spacing=4.0)
"""More lines than the tracker needs: a contour is to be seen."""


@dataclass(frozen=True)
class OutsideFiles:
    """What a user says of static cameras.

    Attributes:
        stations: file that says where they stand.
        surface: folder of the segments' meshes; None for capsules along the bones.
        map: that the recording was solved in; None where the stations' own frame is the world.
    """

    stations: Path
    surface: Path | None = None
    map: Path | None = None


class OutsideScene:
    """Asks the stations' images about a body that is solved; their colours are learned at its poses.

    Attributes:
        stations: that the recording has images of, by name.
        body: as it was published, with its equipment.
        colours: of the segments' surfaces, as ``#rrggbb``.
    """

    def __init__(
        self, solved: SolvedRecording, body: BodyModel, surface: BodySurface, stations: Mapping[str, Station]
    ) -> None:
        self.stations, self.body = stations, body
        self.colours = [EQUIPMENT if s in body.equipment_segments else side_colour(s) for s in body.segments]
        self._solved, self._surface = solved, surface
        self._poses = np.stack([solved.world_T_link[segment] for segment in body.segments])
        self._tracker = RegionTracker(body, surface, stations, _SETTINGS)
        self._learned = dict.fromkeys(stations, 0)

    @classmethod
    def read(cls, solved: SolvedRecording, recording: Path, files: OutsideFiles) -> "OutsideScene":
        """Read what a user gave.

        Raises:
            StationError: the stations cannot be used, the recording has none of them, or their frame is not known.
            BodyError: the surface cannot be used, or what was published is no body.
            RecordingError: not a recording.
            MapError, LensError: the map, or a lens, cannot be used.
        """
        with BagFile(solved.path) as bag:
            body = body_from_urdf(published_robot(bag))
        stations = read_stations(files.stations, None if files.map is None else ReferenceMap.load(files.map))
        check_stations_frame(files.stations, solved.path, files.map)
        with open_recording(recording) as images:
            there = {name: station for name, station in stations.items() if name in images.cameras}
            if not there:
                raise StationError(
                    f"{recording} has no images of the static cameras of {files.stations} ({', '.join(stations)}); it "
                    f"has {', '.join(images.cameras)}"
                )
        surface = BodySurface.of(body, surfaces_of(body, solved.path, files.surface))
        return cls(solved, body, surface, there)

    def unlearned(self) -> "OutsideScene":
        """The same, whose colours nobody has learned yet."""
        return OutsideScene(self._solved, self.body, self._surface, self.stations)

    def poses_at(self, at_ns: int) -> Array:
        """(S, 4, 4) the solved segments at a time; before the first instant and after the last one as they are then."""
        stamps_ns = self._solved.stamps_ns
        if len(stamps_ns) == 1:
            return np.asarray(self._poses[:, 0])
        inside = np.clip(np.array([at_ns]), stamps_ns[0], stamps_ns[-1])
        return np.stack([interpolated(stamps_ns, poses, inside)[0] for poses in self._poses])

    def decoded(self, image: CameraImage) -> Image:
        """Pixels (H, W, 3) of a station's image: blue, green, red.

        Raises:
            RecordingError: it cannot be decoded, or has another size than the station's lens is for.
        """
        pixels = decode_colour(image)
        self._tracker.check_size(image.camera, pixels)
        return pixels

    def learn(self, station: str, pixels: Image, poses: Array) -> None:
        """Learn a station's colours in an image (H, W, 3) of the body at poses (S, 4, 4); at first all count alike."""
        self._learned[station] += 1
        rate = max(1.0 / self._learned[station], _SETTINGS.learning_rate)
        self._tracker.views[station].learn(
            pixels, self._tracker.views[station].contour(poses), rate, np.ones(len(poses), bool)
        )

    def contour(self, station: str, pixels: Image, poses: Array) -> SeenContour:
        """The contour of the body at poses (S, 4, 4) in a station's image (H, W, 3), and where it would have it."""
        return self._tracker.views[station].seen_contour(pixels, self._tracker.views[station].contour(poses))
