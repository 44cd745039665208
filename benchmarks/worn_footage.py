"""Disturb a recording as body cameras do: python -m benchmarks.worn_footage BAG OUT [--seed 0].

Each camera gets cloth or skin that swings over a third of its pictures, auto exposure in jumps, a smear on the lens,
noise, and the compression of a phone at a low bit rate. Geometry, stamps and all other messages stay as they are, so
poses can be scored against the truth of the recording.
"""

import argparse
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording

IMAGES = "/image_raw/compressed"

Grey = NDArray[np.uint8]
COVERED = 0.30  # share of a picture behind cloth, on average
EXPOSURE_STOPS = 0.8  # between two levels of the exposure
NOISE = 6.0  # standard deviation [grey levels]
JPEG_QUALITY = 28
SMEAR_RADIUS, SMEAR_BLUR, SMEAR_VEIL = 0.16, 0.02, 25.0  # of the width, of the width, grey levels

_SWING = 0.12  # of the diagonal, by which the border of the cloth goes to either side
_SWING_S, _EXPOSURE_S = (0.7, 1.6), (0.6, 1.8)
_WEAVE_PX = 5.0


class WornFootage:
    """Disturbances of one camera's pictures, by its name and a seed, so that they do not depend on the others.

    Args:
        camera: its name.
        height, width: of its pictures [px].
        seed: of all cameras.
    """

    def __init__(self, camera: str, height: int, width: int, seed: int) -> None:
        self._seed = zlib.crc32(f"{seed} {camera}".encode())
        rng = np.random.default_rng(self._seed)
        self._side = float(rng.uniform(0.0, 2.0 * np.pi))
        self._swing_s, self._exposure_s = float(rng.uniform(*_SWING_S)), float(rng.uniform(*_EXPOSURE_S))
        self._diagonal = float(np.hypot(height, width))
        columns, rows = np.meshgrid(np.arange(width) - 0.5 * (width - 1), np.arange(height) - 0.5 * (height - 1))
        along = columns * np.cos(self._side) + rows * np.sin(self._side)
        across = rows * np.cos(self._side) - columns * np.sin(self._side)
        self._depth = (along - np.quantile(along[::8, ::8], 1.0 - COVERED)).astype(np.float32)
        weave = np.sin(along / _WEAVE_PX) * np.sin(across / _WEAVE_PX)
        folds = np.sin(along / (0.06 * self._diagonal) + np.sin(across / (0.1 * self._diagonal)))
        self._cloth = (75.0 + 18.0 * weave + 28.0 * folds).astype(np.float32)
        middle = rng.uniform(-0.25, 0.25, 2) * [width, height]
        distance = np.hypot(columns - middle[0], rows - middle[1])
        self._smear = np.exp(-0.5 * (distance / (SMEAR_RADIUS * width)) ** 4).astype(np.float32)
        self._noise = rng.normal(0.0, NOISE, (height, width, 3)).astype(np.float32)

    def disturbed(self, image: Grey, seconds: float, number: int) -> Grey:
        """The picture (H, W) or (H, W, 3) at a time since the first image [s]; ``number`` of it varies the noise."""
        width = image.shape[1]
        blurred = cv2.GaussianBlur(image, (0, 0), SMEAR_BLUR * width).astype(np.float32) + np.float32(SMEAR_VEIL)
        shift = _SWING * self._diagonal * np.sin(2.0 * np.pi * seconds / self._swing_s)
        share = np.clip((self._depth - np.float32(shift)) / np.float32(4.0) + np.float32(0.5), 0.0, 1.0)
        move = np.array([[1.0, 0.0, shift * np.cos(self._side)], [0.0, 1.0, shift * np.sin(self._side)]])
        size = (width, image.shape[0])
        cloth = np.asarray(cv2.warpAffine(self._cloth, move, size, borderMode=cv2.BORDER_REFLECT), np.float32)
        rng = np.random.default_rng([self._seed, number])
        noise = np.roll(self._noise, rng.integers(0, min(size), 2), axis=(0, 1))
        smear = self._smear
        if image.ndim == 3:
            cloth = cloth[..., None]
            share = share[..., None]
            smear = smear[..., None]
        else:
            noise = noise[..., 0]
        pixels = image.astype(np.float32)
        pixels += smear * (blurred - pixels)
        pixels += share * (cloth - pixels)
        pixels = pixels * np.float32(self._exposure(seconds)) + noise
        return np.rint(np.clip(pixels, 0.0, 255.0)).astype(np.uint8)

    def _exposure(self, seconds: float) -> float:
        """Gain of the exposure, which jumps between two levels."""
        rng = np.random.default_rng([self._seed, int(seconds / self._exposure_s)])
        return float(2.0 ** rng.choice([-0.5 * EXPOSURE_STOPS, 0.5 * EXPOSURE_STOPS]))


def write_worn_footage(source: Path, target: Path, seed: int = 0) -> Path:
    """Write the bag anew with disturbed images, all else as it is; return it."""
    footage: dict[str, WornFootage] = {}
    numbers: dict[str, int] = {}
    with BagFile(source) as bag, write_recording(target, command="benchmarks.worn_footage") as writer:
        for topic, recorded_ns, message in bag.messages(bag.topics):
            if topic.endswith(IMAGES):
                camera = topic.removesuffix(IMAGES).strip("/")
                image = np.asarray(cv2.imdecode(np.asarray(message.data), cv2.IMREAD_UNCHANGED), np.uint8)
                if topic not in footage:
                    footage[topic] = WornFootage(camera, image.shape[0], image.shape[1], seed)
                numbers[topic] = numbers.get(topic, -1) + 1
                image = footage[topic].disturbed(image, 1e-9 * (recorded_ns - bag.start_ns), numbers[topic])
                message.data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].ravel()
            writer.write(topic, recorded_ns, message)
    return target


def main() -> None:
    """Parse the command line and disturb."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag", type=Path)
    parser.add_argument("out", type=Path, help="bag folder to be")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    write_worn_footage(arguments.bag, arguments.out, arguments.seed)


if __name__ == "__main__":
    main()
