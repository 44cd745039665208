"""Landmarks in images as quadratic forms: gradients against numeric ones, and landmarks that the map has wrong."""

import numpy as np
import pytest
from helpers.range_of_motion import known_body, range_of_motion, registrations, wide_cameras

from bodycam_ros.calibration.camera_motion import CameraLog, CameraMotion, camera_motion
from bodycam_ros.calibration.image_evidence import ImageEvidence, image_evidence
from bodycam_ros.estimation.mounted_cameras import EvidenceSettings
from bodycam_ros.geometry import exp_se3, inverse, transform_points
from bodycam_ros.registration.pose_fit import PoseFitSettings

NO_FLOOR = EvidenceSettings(mount_rotation_sigma=0.0, mount_translation_sigma=0.0)
CAMERAS = ("waist_front", "chest")


@pytest.fixture(scope="module")
def motion() -> CameraMotion:
    body = known_body()
    logs = {camera: CameraLog(camera) for camera in CAMERAS}
    for matches in registrations(range_of_motion(body, duration_s=4.0, rate_hz=5.0)):
        if matches.camera in logs:
            logs[matches.camera].add(matches)
    return camera_motion(list(logs.values()))


def evidence_of(motion: CameraMotion, floor: EvidenceSettings) -> ImageEvidence:
    rows = np.arange(len(motion.stamps_ns))
    return image_evidence(motion, rows, wide_cameras(CAMERAS), PoseFitSettings(), floor)


def cost(images: ImageEvidence, world_T_camera: np.ndarray) -> float:
    """Half the Geman-McClure cost whose derivative the weights are."""
    total, scale = 0.0, images.pose_fit.inlier_px**2
    for c, view in enumerate(images.views):
        image_T_world = inverse((world_T_camera[:, c] @ images.frame_T_image[:, c])[view.frames])
        points_camera = transform_points(image_T_world, images.points_world[view.landmarks][:, None])[:, 0]
        pixels, visible = view.camera.project(points_camera)
        squared = np.sum((pixels - view.pixels)[visible] ** 2, axis=1)
        total += float((squared / (1.0 + squared / scale)).sum())
    return 0.5 * total / images.pose_fit.pixel_sigma**2


def test_gradients_are_numeric_ones(motion: CameraMotion) -> None:
    images = evidence_of(motion, NO_FLOOR)
    away = motion.world_T_camera @ exp_se3(0.003 * np.random.default_rng(0).normal(size=(*motion.known.shape, 6)))
    _, gradients = images.linearised(away)
    for column in range(6):
        step = np.zeros((*motion.known.shape, 6))
        step[3, 1, column] = 1e-6
        slope = (cost(images, away @ exp_se3(step)) - cost(images, away @ exp_se3(-step))) / 2e-6
        assert gradients[3, 1, column] == pytest.approx(slope, rel=1e-4, abs=1e-2)
