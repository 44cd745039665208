"""Cameras as the doctor's checks know them, made up."""

import cv2
import numpy as np

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.quality.sampled_recording import Grey, SampledCamera, SampledRecording

WIDTH, HEIGHT = 320, 240
INTERVAL_S = 1 / 30
DURATION_S = 10.0


def lens(name: str = "head", width: int = WIDTH, height: int = HEIGHT) -> CameraModel:
    k = [150.0, 0.0, width / 2, 0.0, 150.0, height / 2, 0.0, 0.0, 1.0]
    return camera_from_info(name, width, height, "equidistant", [0.0] * 4, k)


def textured(brightness: float = 1.0) -> Grey:
    noise = np.random.default_rng(3).integers(20, 200, (HEIGHT // 4, WIDTH // 4), np.uint8)
    picture = cv2.resize(noise, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
    return np.clip(brightness * picture.astype(float), 0, 255).astype(np.uint8)


def sampled(name: str = "head", **changes: object) -> SampledCamera:
    """A camera that nothing is wrong with, with some fields changed."""
    stamps_s = np.arange(0.0, DURATION_S, INTERVAL_S)
    fields: dict[str, object] = {
        "name": name,
        "lens": lens(name),
        "lens_fault": "",
        "stamps_s": stamps_s,
        "recorded_s": changes.get("stamps_s", stamps_s),
        "images": {number: textured() for number in range(4)},
    }
    return SampledCamera(**(fields | changes))  # type: ignore[arg-type]


def recording(*cameras: SampledCamera, **changes: object) -> SampledRecording:
    times_s = np.linspace(1.0, DURATION_S - 1.0, 4)
    fields: dict[str, object] = {"is_synchronous": True} | changes
    return SampledRecording(cameras, DURATION_S, times_s, **fields)  # type: ignore[arg-type]
