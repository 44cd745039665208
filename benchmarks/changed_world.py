"""A map of a world that has changed since: python -m benchmarks.changed_world MAP OUT --replace-share 0.2 --seed 0.

In every photograph of the map rectangles are painted over with what other photographs show elsewhere, until so much of
its area is replaced. Landmarks and their descriptors stay: what was there when the map was made is asked for still.
"""

import argparse
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.reference_map import ReferenceMap

_SIDES = (0.08, 0.25)
"""Sides of a rectangle, in shares of the picture's."""

_JPEG_QUALITY = 95


def replaced_content(
    pictures: list[NDArray[np.uint8]], share: float, rng: np.random.Generator
) -> list[NDArray[np.uint8]]:
    """The pictures (H, W), at least a share of the area of each of them replaced by rectangles of the others."""
    changed = []
    for number, picture in enumerate(pictures):
        mended, painted = picture.copy(), np.zeros(picture.shape, bool)
        while painted.mean() < share:
            other = pictures[(number + rng.integers(1, len(pictures))) % len(pictures)]
            ends = np.stack([picture.shape, other.shape])
            rows, columns = (round(side * rng.uniform(*_SIDES)) for side in ends.min(axis=0))
            row, from_row = rng.integers(0, ends[:, 0] - rows + 1)
            column, from_column = rng.integers(0, ends[:, 1] - columns + 1)
            there = np.s_[row : row + rows, column : column + columns]
            # Upside down: a neighbour's view of the same place is no change.
            mended[there] = other[from_row : from_row + rows, from_column : from_column + columns][::-1, ::-1]
            painted[there] = True
        changed.append(mended)
    return changed


def change_world(source: Path, target: Path, share: float, seed: int) -> None:
    """Copy a map folder, with changed photographs."""
    photographs = ReferenceMap.load(source).photographs
    if photographs is None:
        raise SystemExit(f"{source}: a map without photographs; build it again with 'bodycam map'")
    changed = replaced_content(decoded(photographs), share, np.random.default_rng(seed))
    shutil.copytree(source, target)
    replace(photographs, jpegs=tuple(map(_encoded, changed))).save(target)


def decoded(photographs: MapPhotographs) -> list[NDArray[np.uint8]]:
    """The photographs as pictures (H, W)."""
    data = (np.frombuffer(jpeg, np.uint8) for jpeg in photographs.jpegs)
    return [np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE), np.uint8) for jpeg in data]


def _encoded(picture: NDArray[np.uint8]) -> bytes:
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1])


def main() -> None:
    """Parse the command line and change."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("map", type=Path)
    parser.add_argument("out", type=Path, help="map folder to be")
    parser.add_argument("--replace-share", type=float, default=0.2, help="of each photograph's area")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    change_world(arguments.map, arguments.out, arguments.replace_share, arguments.seed)


if __name__ == "__main__":
    main()
