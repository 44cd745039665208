"""Static cameras wired together once, for the offline replay and for the live solver alike.

images of one time --RegionTracker--> StaticMeasurement --> BodyEstimator
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.surface import BodySurface
from bodycam_ros.body.surface_folder import surfaces_of
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import AUTO, StaticCameraFiles
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
    stamps_ns: Mapping[str, NDArray[np.int64]] | None = None,
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
        stamps_ns: camera -> (N,) stamps of all its images [ns], by which keypoints are theirs; None where they are not
            recorded.
        people: camera -> people in its first images, where the start is detected.

    Raises:
        BodyError: the body's surface, the start or the keypoints cannot be used.
    """
    # Here, as formats of others take a tenth of a second to load, and body cameras do without.
    from bodycam_ros.formats.keypoints import JOINTS
    from bodycam_ros.formats.read_captured import read_start
    from bodycam_ros.formats.recorded_keypoints import read_recorded_keypoints
    from bodycam_ros.static_cameras.blazepose import PoseDetector
    from bodycam_ros.static_cameras.detected_people import DetectedPeople
    from bodycam_ros.static_cameras.keypoint_evidence import KeypointEvidence

    surface = BodySurface.of(body, surfaces_of(body, body_path, given.surface))
    tracker = RegionTracker(body, surface, stations, settings.region, searches_again=not live)
    placed = None
    if given.start is not None:
        placed = read_start(given.start, given.stations, stations, body, given.person, people)
    keypoints: KeypointEvidence | None = None
    if given.evidence == AUTO:
        source = DetectedPeople(PoseDetector.installed())
        keypoints = KeypointEvidence(tracker.body, stations, JOINTS, source)
    elif given.evidence is not None:
        if stamps_ns is None:
            raise BodyError(f"{given.evidence}: keypoints are those of a bag's images; give the bag")
        keypoints = read_recorded_keypoints(given.evidence, stations, tracker.body, stamps_ns)
    return ImageMeasurement(tracker, placed, settings.motion, on_seen, keypoints)
