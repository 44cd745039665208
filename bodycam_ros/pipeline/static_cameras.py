"""Static cameras wired together once, for the offline replay and for the live solver alike.

images of one time --RegionTracker--> StaticMeasurement --> BodyEstimator
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.surface import BodySurface
from bodycam_ros.body.surface_folder import surfaces_of
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.static_cameras.static_camera import StaticCamera
from bodycam_ros.static_cameras.static_measurement import ImageMeasurement


def image_measurement(
    given: StaticCameraFiles,
    stations: Mapping[str, StaticCamera],
    body: BodyModel,
    body_path: Path,
    settings: PipelineSettings,
    on_seen: Callable[[Mapping[str, int], StaticMeasurement], None],
    live: bool = False,
    people: Mapping[str, Sequence[Sequence[Array]]] | None = None,
) -> ImageMeasurement:
    """The measurement of a body by images of static cameras.

    Args:
        given: files of their poses, of the start and of the surface.
        stations: the cameras, by name.
        body: with its equipment, if any.
        body_path: its file.
        settings: of all stages.
        on_seen: called with the stamp of each camera's image [ns], and the measurement.
        live: whether images go on meanwhile, so that there is no time to search for limbs that are lost.
        people: camera -> people in its first images, where the start is detected.

    Raises:
        BodyError: the body's surface, or the start, cannot be used.
    """
    # Here, as formats of others take a tenth of a second to load, and body cameras do without.
    from bodycam_ros.formats.read_captured import read_start

    surface = BodySurface.of(body, surfaces_of(body, body_path, given.surface))
    tracker = RegionTracker(body, surface, stations, settings.region, searches_again=not live)
    placed = None
    if given.start is not None:
        placed = read_start(given.start, given.stations, stations, body, given.person, people)
    return ImageMeasurement(tracker, placed, settings.motion, on_seen)
