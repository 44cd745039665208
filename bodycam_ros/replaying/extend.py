"""A recording registered in a map: in rounds that extend it (A 4.1), or once, for scale and vertical of a new one."""

import logging
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import gettempdir

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.camera.readout import Readout
from bodycam_ros.files.whole_file import scratch_folder
from bodycam_ros.inertial.map_alignment import RegisteredPoses
from bodycam_ros.mapping.body_keyframe import BodyKeyframe, KeyframeDensity
from bodycam_ros.mapping.extendable_map import make_extendable
from bodycam_ros.mapping.local_mapper import KeptImage, LocalMapper
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap, load_map
from bodycam_ros.replaying.camera_worker import RegistrationTask
from bodycam_ros.replaying.front_end import registered_images
from bodycam_ros.tracking.keypoints import KeypointSettings
from bodycam_ros.tracking.track_frame import NO_LANDMARK

logger = logging.getLogger(__name__)

_MIN_GAIN = 0.001  # share of all images that a round must add for another to follow
_KEYPOINTS = KeypointSettings(image_scale=1.0, max_keypoints=1200)  # at full size features are twice as exact
_CAPACITY = 40000  # most landmarks that are added to the map
_PARTNERS = 12  # images that each is matched with
_MAX_COVERED = 0.8  # of the view: a keyframe adds landmarks between those of the photographs, too
_MAX_KEYFRAMES = 300  # of all cameras: each costs 30 kB in the map and a tenth of a second in a round
_JPEG_QUALITY = 75  # of images that the map keeps


@dataclass(frozen=True)
class ExtensionRound:
    """One round.

    Attributes:
        shares: camera -> share of its images that are registered, 0 to 1.
        share: the same of all images.
        absolute: share of all images with enough landmarks of the photographs to be registered by these alone.
    """

    shares: Mapping[str, float]
    share: float
    absolute: float


def extend_map(
    recording_path: Path,
    map_path: Path,
    settings: PipelineSettings,
    jobs: int,
    cameras: Sequence[str] | None = None,
    readouts: Mapping[str, Readout] | None = None,
    on_progress: Callable[[str, float], None] = lambda step, share: None,
    names: TopicNames = AS_RECORDED,
) -> tuple[ReferenceMap, tuple[ExtensionRound, ...]]:
    """Extend a map by what the cameras of a recording observe; the extended map, and the rounds that it took.

    Each round registers the recording in the map of the round before, and triangulates anew from its poses.

    Args:
        recording_path: the recording.
        map_path: folder of the map.
        settings: of all stages.
        jobs: processes.
        cameras: that are used; all by default.
        readouts: camera -> read-out time, where it is known from elsewhere than the recording.
        on_progress: called with the name of a step, and the share of it that is done.
        names: of the recording's topics.

    Raises:
        BodycamError: what is wrong with recording or map.
    """
    reference_map = extended = load_map(map_path)
    with open_recording(recording_path, names) as recording:
        models = {name: recording.camera_model(name) for name in cameras or recording.cameras}
        gap_s = recording.duration_s * len(models) / _MAX_KEYFRAMES
    density = KeyframeDensity(_MAX_COVERED, max(KeyframeDensity().min_gap_ns, round(1e9 * gap_s)))
    task = RegistrationTask(
        recording_path,
        map_path,
        replace(settings, keypoints=_KEYPOINTS),
        with_messages=False,
        readouts=readouts or {},
        keyframes=density,
        names=names,
    )
    rounds: list[ExtensionRound] = []
    with scratch_folder(Path(gettempdir())) as scratch:
        while len(rounds) < settings.extension.rounds:
            step = f"round {len(rounds) + 1}"
            mapper = LocalMapper(make_extendable(reference_map, _CAPACITY), partners=_PARTNERS)
            images = Counter[str]()
            registered = Counter[str]()
            absolute = 0
            # Absolute and relative registration, by photographs and by added landmarks (A 4.1).
            for image in registered_images(task, models, jobs, partial(on_progress, step)):
                images[image.camera] += 1
                registered[image.camera] += image.matches.world_T_camera is not None
                absolute += len(image.matches.landmark_ids) - image.matches.grown >= settings.registrar.min_inliers
                if image.keyframe is not None:
                    mapper.wait_for_turn(_anew(image.keyframe, mapper.map.first_id))
            total = max(1, images.total())
            shares = {camera: registered[camera] / max(1, images[camera]) for camera in models}
            rounds.append(ExtensionRound(shares, registered.total() / total, absolute / total))
            logger.info("%s: %.1f %% of all images registered", step, 100 * rounds[-1].share)
            # 2D-2D matches between all registered images, triangulated; poses and points adjusted together (A 4.1).
            mapper.add_waiting()
            mapper.adjust()
            mapper.take_changes()
            extended = mapper.extended_map(list(_kept_images(recording_path, names, mapper.image_poses())), models)
            if _is_complete([each.share for each in rounds]):
                break
            task = replace(task, map_path=scratch / f"round_{len(rounds)}")
            extended.save(task.map_path)
    return extended, tuple(rounds)


def _is_complete(shares: Sequence[float]) -> bool:
    """Whether all is registered, or a round added nothing."""
    return len(shares) > 1 and (shares[-1] == 1.0 or shares[-1] - shares[-2] < _MIN_GAIN)


def _anew(keyframe: BodyKeyframe, first_added_id: int) -> BodyKeyframe:
    """The keyframe with the landmarks of the photographs alone; those of earlier rounds are triangulated anew."""
    ids = keyframe.landmark_ids
    return replace(keyframe, landmark_ids=np.where(ids >= first_added_id, np.uint32(NO_LANDMARK), ids))


def _kept_images(
    recording_path: Path, names: TopicNames, world_T_camera: Mapping[tuple[str, int], NDArray[np.float64]]
) -> Iterator[KeptImage]:
    """The images (camera, stamp [ns]) with these poses (4, 4)."""
    with open_recording(recording_path, names) as recording:
        for image in recording.images(sorted({camera for camera, _ in world_T_camera})):
            if (pose := world_T_camera.get((image.camera, image.stamp_ns))) is not None:
                quality = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
                jpeg = cv2.imencode(".jpg", decode_grey(image), quality)[1]
                yield KeptImage(image.camera, image.stamp_ns, pose, jpeg.tobytes())


def registered_poses(
    reference_map: ReferenceMap, cameras: Collection[str], recording_path: Path, jobs: int
) -> dict[str, RegisteredPoses]:
    """Camera -> its images that are registered in a map, whose unit may be wrong by a third.

    Args:
        reference_map: the map.
        cameras: of the recording.
        recording_path: with the images.
        jobs: processes.

    Raises:
        RecordingError: the recording cannot be read.
    """
    found: dict[str, list[LandmarkMatches]] = {camera: [] for camera in cameras}
    with scratch_folder(Path(gettempdir())) as scratch:
        reference_map.save(scratch / "map")
        task = RegistrationTask(recording_path, scratch / "map", PipelineSettings(), with_messages=False)
        for image in registered_images(task, cameras, jobs):
            if image.matches.world_T_camera is not None:
                found[image.camera].append(image.matches)
    return {
        camera: (
            np.array([each.stamp_ns for each in own], np.int64),
            np.array([each.world_T_camera for each in own], np.float64).reshape(-1, 4, 4),
        )
        for camera, own in found.items()
    }
