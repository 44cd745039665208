"""Where the cameras were at the sampled instants: each image registered by itself, as that of a lost camera."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.doctor.doctor_settings import DoctorGroups
from bodycam_ros.doctor.sampled_recording import Grey, SampledCamera, SampledRecording
from bodycam_ros.geometry import Array
from bodycam_ros.registration.image_registration import ImageRegistration, ImageRegistrationSettings
from bodycam_ros.registration.reference_map import ReferenceMap

_HOPELESS = 2
"""Instants at which no camera finds itself; the others are not asked: a wrong map would cost the most."""


@dataclass(frozen=True, eq=False)
class RegisteredSamples:
    """Of one recording.

    Attributes:
        instants_s: (K,) the recording's sampled instants [s].
        poses: camera -> number of an instant -> (4, 4) world_T_camera, or None where the image cannot be registered.
    """

    instants_s: Array
    poses: Mapping[str, Mapping[int, Array | None]]

    def share(self, camera: str) -> float:
        """Of a camera's images that were registered; NaN if none was asked."""
        found = [pose is not None for pose in self.poses.get(camera, {}).values()]
        return float(np.mean(found)) if found else float("nan")

    def known(self, camera: str) -> dict[int, Array]:
        """Number of an instant -> world_T_camera (4, 4) where it is known."""
        return {number: pose for number, pose in self.poses.get(camera, {}).items() if pose is not None}


def register_samples(
    recording: SampledRecording,
    cameras: Sequence[str],
    instants: Sequence[int],
    reference_map: ReferenceMap,
    settings: DoctorGroups,
    jobs: int,
    on_instant: Callable[[], None],
) -> RegisteredSamples:
    """Register the images of some cameras at some instants.

    Args:
        recording: samples.
        cameras: names of those to ask.
        instants: numbers of instants, in the order in which to ask.
        reference_map: the map.
        settings: of the registration.
        jobs: threads.
        on_instant: called after each instant at which there is an image to ask.
    """
    asked = [camera for camera in recording.cameras if camera.name in cameras and camera.lens is not None]
    registrations = {camera.name: _registration(camera, reference_map, settings) for camera in asked}
    poses: dict[str, dict[int, Array | None]] = {camera.name: {} for camera in asked}
    lit = {camera.name: camera.lit for camera in asked}

    def register(work: tuple[str, int, Grey]) -> None:
        name, number, grey = work
        poses[name][number] = registrations[name].register(grey, lit[name]).world_T_camera

    with ThreadPoolExecutor(jobs) as pool:
        seen = [number for number in instants if any(_fits(camera, camera.images.get(number)) for camera in asked)]
        for count, number in enumerate(seen):
            work = [(c.name, number, c.images[number]) for c in asked if _fits(c, c.images.get(number))]
            if count == 0:
                register(work.pop())  # what the map learns for a search, it learns once
            list(pool.map(register, work))
            on_instant()
            if count + 1 == _HOPELESS and not any(pose is not None for of in poses.values() for pose in of.values()):
                break
    return RegisteredSamples(recording.instants_s, poses)


def _registration(camera: SampledCamera, reference_map: ReferenceMap, settings: DoctorGroups) -> ImageRegistration:
    assert camera.lens is not None
    return ImageRegistration(
        camera.lens,
        reference_map,
        ImageRegistrationSettings(),
        settings.registrar,
        settings.matching,
        settings.absolute_pose,
        settings.pose_fit,
    )


def _fits(camera: SampledCamera, grey: NDArray[np.uint8] | None) -> bool:
    return grey is not None and camera.lens is not None and grey.shape == (camera.lens.height, camera.lens.width)
