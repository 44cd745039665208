"""Rounds of registration and map extension over a recording (A 4.1)."""

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import gettempdir

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import RecordingError
from bodycam_ros.mapping.body_keyframe import BodyKeyframe, make_keyframe
from bodycam_ros.mapping.extendable_map import make_extendable
from bodycam_ros.mapping.local_mapper import KeptImage, LocalMapper
from bodycam_ros.offline.camera_worker import RegistrationTask
from bodycam_ros.offline.extension_record import ExtensionRecord, ExtensionRound
from bodycam_ros.offline.front_end import register_matches
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.progress import in_parallel
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.matching import RADIUS_PX, match_near_prediction
from bodycam_ros.registration.pose_fit import steady_pixels
from bodycam_ros.registration.reference_map import ReferenceMap, load_map
from bodycam_ros.tracking.feature_tracker import view_mask
from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings
from bodycam_ros.tracking.track_frame import NO_LANDMARK
from bodycam_ros.whole_file import scratch_folder

logger = logging.getLogger(__name__)

_MIN_GAIN = 0.001  # share of all images that a round must add for another to follow
_KEYPOINTS = KeypointSettings(image_scale=1.0, max_keypoints=1200)  # at full size features are twice as exact
_CAPACITY = 40000  # most landmarks that are added to the map
_PARTNERS = 12  # images that each is matched with
_JPEG_QUALITY = 75  # of images that the map keeps

OnProgress = Callable[[str, float], None]
"""Called with the name of a step and the share of it that is done, 0 to 1."""


@dataclass(frozen=True)
class Extension:
    """An extended map, the rounds that it took, and their time [s]."""

    reference_map: ReferenceMap
    rounds: tuple[ExtensionRound, ...]
    elapsed_s: float


def extend_map(
    recording_path: Path,
    map_path: Path,
    settings: PipelineSettings,
    jobs: int,
    cameras: Sequence[str] | None = None,
    readouts: Mapping[str, Readout] | None = None,
    on_progress: OnProgress = lambda step, share: None,
) -> Extension:
    """Extend a map by what the cameras of a recording observe.

    Args:
        recording_path: the recording.
        map_path: folder of the map.
        settings: of all stages.
        jobs: processes.
        cameras: that are used; all by default.
        readouts: camera -> read-out time, where it is known from elsewhere than the recording.
        on_progress: called with the progress.

    Raises:
        BodycamError: what is wrong with recording or map.
    """
    started_s = time.monotonic()
    reference_map = extended = load_map(map_path)
    with open_recording(recording_path) as recording:
        names = recording.cameras if cameras is None else cameras
        models = {name: recording.camera_model(name) for name in names}
    record = ExtensionRecord(models, settings.registrar.min_inliers)
    rounds: list[ExtensionRound] = []
    with scratch_folder(Path(gettempdir())) as scratch:
        while len(rounds) < settings.extend.rounds:
            step = f"round {len(rounds) + 1}"
            # Absolute and relative registration, by photographs and by added landmarks (A 4.1).
            task = RegistrationTask(recording_path, map_path, settings, with_messages=False, readouts=readouts or {})
            for matches in register_matches(task, models, jobs, partial(on_progress, step)):
                record.add(matches)
            rounds.append(record.summary())
            logger.info("%s: %.1f %% of all images registered", step, 100 * rounds[-1].share)
            if _is_complete([each.share for each in rounds]):
                break
            # 2D-2D matches between all registered images, triangulated (A 4.1).
            mapper = LocalMapper(make_extendable(reference_map, _CAPACITY), partners=_PARTNERS)
            chosen, images = record.choose_keyframes(), []
            for keyframe, jpeg in _keyframes(recording_path, reference_map, models, chosen, jobs):
                mapper.add_keyframe(keyframe)
                images.append(KeptImage(keyframe.camera, keyframe.stamp_ns, keyframe.world_T_camera, jpeg))
                on_progress(f"triangulation {len(rounds)}", len(images) / len(chosen))
            mapper.take_changes()
            extended = mapper.extended_map(images, models)
            map_path = scratch / f"round_{len(rounds)}"
            extended.save(map_path)
    return Extension(extended, tuple(rounds), time.monotonic() - started_s)


def _is_complete(shares: Sequence[float]) -> bool:
    """Whether all is registered, or a round added nothing."""
    return len(shares) > 1 and (shares[-1] == 1.0 or shares[-1] - shares[-2] < _MIN_GAIN)


def _keyframes(
    recording_path: Path,
    reference_map: ReferenceMap,
    cameras: Mapping[str, CameraModel],
    chosen: Mapping[tuple[str, int], LandmarkMatches],
    jobs: int,
) -> Iterator[tuple[BodyKeyframe, bytes]]:
    """Chosen images in order of time, with their features, and as JPEG."""
    masks = {name: view_mask(camera) for name, camera in cameras.items()}

    def process(image: CameraImage) -> tuple[BodyKeyframe, bytes] | None:
        try:
            grey = decode_grey(image)
        except RecordingError:
            return None
        matches = chosen[image.camera, image.stamp_ns]
        keyframe = _keyframe(reference_map, cameras[image.camera], matches, grey, masks[image.camera])
        done, jpeg = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        return (keyframe, bytes(jpeg.tobytes())) if done else None

    with open_recording(recording_path) as recording:
        images = (i for i in recording.images(list(cameras)) if (i.camera, i.stamp_ns) in chosen)
        for processed in in_parallel(process, images, jobs):
            if processed is not None:
                yield processed


def _keyframe(
    reference_map: ReferenceMap,
    camera: CameraModel,
    matches: LandmarkMatches,
    grey: NDArray[np.uint8],
    mask: NDArray[np.uint8],
) -> BodyKeyframe:
    assert matches.world_T_camera is not None
    found = KeypointDetector(_KEYPOINTS).detect(grey, mask)
    pixels = steady_pixels(camera, found.pixels, matches.turning, matches.readout_in_use)
    features, landmarks = match_near_prediction(
        reference_map, camera, matches.world_T_camera, pixels, found.descriptors, found.scales, RADIUS_PX
    )
    ids = np.full(len(pixels), NO_LANDMARK, np.uint32)
    ids[features] = reference_map.landmark_ids[landmarks]
    return make_keyframe(camera, matches, pixels, found.descriptors, found.scales, ids)
