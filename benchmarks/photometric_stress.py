"""Damage a bag's light: python -m benchmarks.photometric_stress BAG OUT --seed 0.

Every camera gets a gamma of its own, a gain that ramps up and down over time, and a shadow over half of the picture,
whose border stands still in half of the cameras and sweeps through the picture in the others. Geometry, stamps and all
other messages stay as they are, so poses can be scored against the truth of the recording.
"""

import argparse
import zlib
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording

IMAGES = "/image_raw/compressed"
GAMMA = (0.6, 1.6)
GAIN = (0.7, 1.4)
SHADOW = 0.45
"""Times the light of where no shadow is."""

_RAMP_S = (2.0, 5.0)
_SWEEP_S = (1.5, 4.0)
_SWEEP = 0.3
"""How far a moving border goes to either side of the middle, times half of the picture's diagonal."""

_PENUMBRA_PX = 6.0
_JPEG_QUALITY = 95


@dataclass(frozen=True)
class Light:
    """How one camera's images are damaged.

    Attributes:
        gamma: exponent of intensities in 0..1.
        ramp_s: period of the gain, which goes up and down in straight lines [s].
        ramp_phase: at the first image, in periods.
        shadow_angle: direction from the light half of the picture to the dark one [rad].
        sweep_s: period of the border's way there and back [s]; 0 if it stands still.
    """

    gamma: float
    ramp_s: float
    ramp_phase: float
    shadow_angle: float
    sweep_s: float

    @classmethod
    def of_camera(cls, camera: str, seed: int) -> "Light":
        """What befalls a camera: by its name, so that it does not depend on the others."""
        rng = np.random.default_rng([seed, zlib.crc32(camera.encode())])
        return cls(
            gamma=float(np.exp(rng.uniform(*np.log(GAMMA)))),
            ramp_s=float(rng.uniform(*_RAMP_S)),
            ramp_phase=float(rng.uniform()),
            shadow_angle=float(rng.uniform(0.0, 2 * np.pi)),
            sweep_s=float(rng.uniform(*_SWEEP_S)) if rng.uniform() < 0.5 else 0.0,
        )

    def gain(self, seconds: float) -> float:
        """The gain at a time since the first image."""
        turn = (seconds / self.ramp_s + self.ramp_phase) % 1.0
        return GAIN[0] + (GAIN[1] - GAIN[0]) * abs(2.0 * turn - 1.0)

    def shadow(self, height: int, width: int, seconds: float) -> NDArray[np.float32]:
        """(H, W) light of every pixel, 1 or in the shadow ``SHADOW``."""
        way = _SWEEP * 0.5 * np.hypot(height, width)
        offset = way * np.sin(2 * np.pi * seconds / self.sweep_s) if self.sweep_s else 0.0
        columns = (np.arange(width, dtype=np.float32) - 0.5 * (width - 1)) * np.float32(np.cos(self.shadow_angle))
        rows = (np.arange(height, dtype=np.float32) - 0.5 * (height - 1)) * np.float32(np.sin(self.shadow_angle))
        depth = (rows[:, None] + columns[None, :] - np.float32(offset)) / np.float32(_PENUMBRA_PX)
        return np.float32(1.0) - np.float32(1.0 - SHADOW) * np.clip(depth + np.float32(0.5), 0.0, 1.0)

    def on(self, image: NDArray[np.uint8], seconds: float) -> NDArray[np.uint8]:
        """The image (H, W) or (H, W, C) in this light, at a time since the first image."""
        curve = 255.0 * (np.arange(256) / 255.0) ** self.gamma * self.gain(seconds)
        shadow = self.shadow(*image.shape[:2], seconds)
        light = curve.astype(np.float32)[image] * (shadow if image.ndim == 2 else shadow[..., None])
        return np.rint(np.clip(light, 0.0, 255.0)).astype(np.uint8)


def stress_bag(source: Path, target: Path, seed: int) -> None:
    """Write the bag anew with damaged images; all else as it is."""
    lights: dict[str, Light] = {}
    with BagFile(source) as bag, write_recording(target) as writer:
        for topic, recorded_ns, message in bag.messages(bag.topics):
            if topic.endswith(IMAGES):
                light = lights.setdefault(topic, Light.of_camera(topic.removesuffix(IMAGES).strip("/"), seed))
                image = cv2.imdecode(np.asarray(message.data), cv2.IMREAD_UNCHANGED)
                image = light.on(image, 1e-9 * (recorded_ns - bag.start_ns))
                message.data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].ravel()
            writer.write(topic, recorded_ns, message)


def main() -> None:
    """Parse the command line and damage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag", type=Path)
    parser.add_argument("out", type=Path, help="bag folder to be")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    stress_bag(arguments.bag, arguments.out, arguments.seed)


if __name__ == "__main__":
    main()
