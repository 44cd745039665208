"""The files from which a person places a body before static cameras, read and checked before the page is served."""

import logging
from collections.abc import Mapping
from pathlib import Path

from bodycam_ros.body.average_person import body_of_height, with_hands
from bodycam_ros.body.body_file import read_body
from bodycam_ros.camera.camera_image import decode_colour
from bodycam_ros.errors import RecordingError
from bodycam_ros.formats.read_captured import read_start
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.offline.static_input import read_recorded_stations
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.static_cameras.placement import Placement, standing_in_view
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import StaticCameraFiles, world_T_file, write_start
from bodycam_ros.static_cameras.station import Image, Station
from bodycam_ros.static_cameras.surface import BodySurface
from bodycam_ros.static_cameras.surface_folder import surfaces_of

logger = logging.getLogger(__name__)

_AT_ONCE_NS = 100_000_000  # as long a start is known; a camera that starts later shows the person elsewhere
_FITS = 3  # each moves a segment by some centimetres at most


class PlacingSources:
    """What a start is made of; without a start in ``files`` the body stands where the cameras look.

    Args:
        recording_path: bag with images of the static cameras.
        files: of the static cameras.
        body: its file, or the height [m] of an average person.
        map_path: map folder, where the static cameras are in a map.

    Attributes:
        images: camera -> its first image (H, W, 3) blue, green, red.
        tracker: of the body in these images; its body has hands, and limits at all joints of a person.
        surfaces: segment -> surface.
        placement: the body where it is at first.
        reference_map: the place; None without one.

    Raises:
        BodycamError: one of the files is missing or damaged, or they do not fit each other.
    """

    def __init__(self, recording_path: Path, files: StaticCameraFiles, body: Path | float, map_path: Path | None):
        body_path = body if isinstance(body, Path) else Path()
        person = with_hands(read_body(body)) if isinstance(body, Path) else body_of_height(body, "person")
        self.reference_map = None if map_path is None else ReferenceMap.load(map_path)
        with open_recording(recording_path) as recording:
            stations = read_recorded_stations(files, self.reference_map, recording, person)
            self.images = _first_images(recording, stations)
        self.surfaces = surfaces_of(person, body_path, files.surface)
        self.tracker = RegionTracker(person, BodySurface.of(person, self.surfaces), stations, RegionSettings())
        if files.start is None:
            poses = standing_in_view(self.tracker.body, [stations[name] for name in self.images])
        else:
            poses = read_start(files.start, files.stations, stations, person).world_T_segment
        self.placement = Placement(self.tracker.body, (poses,))
        self._file_T_world = inverse(world_T_file(files.stations, stations))

    def fit(self, poses: Array) -> tuple[Array, Array]:
        """Poses (S, 4, 4) of a body, moved onto its images from poses (S, 4, 4), and their support (S,) in these."""
        for _ in range(_FITS):
            poses = self.tracker.initialise(self.images, poses)
        return poses, self.tracker.support(self.images, poses)

    def write(self, output: Path, poses: Array) -> None:
        """Write the start with the body at poses (S, 4, 4); raises as ``write_start``."""
        segments = self.placement.body.segments
        write_start(output, dict(zip(segments, self._file_T_world @ poses, strict=True)))


def _first_images(recording: Recording, stations: Mapping[str, Station]) -> dict[str, Image]:
    """Camera -> its first image, of the cameras that have one at about the time of the very first.

    Raises:
        RecordingError: there is no image, or one cannot be decoded or has another size than the camera's lens is for.
    """
    first = {name: image for name in stations if (image := recording.first_image(name, 0)) is not None}
    if not first:
        raise RecordingError(f"{recording.path}: has no image of {', '.join(stations)}")
    start_ns = min(image.stamp_ns for image in first.values())
    images = {}
    for name, image in first.items():
        late_ns = image.stamp_ns - start_ns
        if late_ns > _AT_ONCE_NS:
            logger.warning("camera %s: its first image is %.1f s late; it is not shown", name, 1e-9 * late_ns)
        else:
            images[name] = decode_colour(image)
            stations[name].check_size(images[name])
    return images
