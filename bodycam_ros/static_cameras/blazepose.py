"""Keypoints of people in an image, by the two networks of BlazePose that are in the wheel of mediapipe.

One finds people (a box detector of 224 x 224 pixels), the other 33 landmarks of each (256 x 256 pixels of an upright
square around the person). What their numbers mean is in MediaPipe's graphs (Apache-2.0, google-ai-edge/mediapipe
v0.10.21): ``modules/pose_detection/pose_detection_cpu.pbtxt``, ``modules/pose_landmark/tensors_to_pose_landmarks_and_
segmentation.pbtxt``, ``pose_detection_to_roi.pbtxt``, ``pose_landmarks_to_roi.pbtxt``; Bazarevsky et al. 2020.

The detector knows people who take about half of its image, so an image is searched whole and in overlapping squares.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array

Image = NDArray[np.uint8]

INSTALL = 'pip install "bodycam_ros[pose]" && pip install --no-deps mediapipe==0.10.21'
"""What installs the detector; mediapipe's own requirements are of an older NumPy, and none of its code is run."""

LANDMARKS = (11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28)
"""Rows of BlazePose's landmarks that are shoulders, elbows, wrists, hips, knees and ankles, left before right."""

_DETECTOR = Path("modules/pose_detection/pose_detection.tflite")
_LANDMARKER = Path("modules/pose_landmark/pose_landmark_full.tflite")
_DETECTOR_PX, _LANDMARK_PX = 224, 256
_GRIDS = ((28, 2), (14, 2), (7, 6))
"""Cells along a side of the detector's image, and anchors in each: strides of 8, 16 and three times 32."""

_LEAST_BOX_SCORE = 0.3
_LEAST_PERSON_SCORE = 0.5
_ROI_SCALE = 1.25  # of the circle around a person that both networks give
_HIPS, _CIRCLE = 33, 34  # rows of two landmarks more: the middle of the hips, a point on that circle
_JOINTS_OF_SHOULDERS, _JOINTS_OF_HIPS = slice(0, 2), slice(6, 8)  # of ``LANDMARKS``
_BEYOND_JOINTS, _HEAD = 1.1, 1.7  # radius of that circle, over the farthest joint and over the trunk's length
_SAME_BOX = 0.3  # share of their union that two boxes have in common
_SAME_PERSON = 0.15  # of the larger one's extent: mean distance of landmarks of one person found twice
_WHOLE = (1.0, 1.5)  # of the image's larger side: somebody who fills the image is not found without a margin
_TILES = (1.0, 0.6)  # of the image's smaller side: squares that are searched besides the whole image
_TILE_STEP = 0.5
_MOST_PEOPLE = 8
_REFINEMENTS = 2  # times that landmarks are found: in the square of the detector, then in that of the landmarks


class Network(Protocol):
    """A network: an image (1, H, W, 3) float32 to its outputs, by their shape."""

    def __call__(self, image: NDArray[np.float32]) -> Mapping[tuple[int, ...], Array]:
        """Outputs of an image."""


@dataclass(frozen=True)
class Square:
    """A square around a person in an image.

    Attributes:
        centre: (2,) [px].
        up: (2,) from the centre to the middle of its upper side, along the person [px].
    """

    centre: Array
    up: Array

    @staticmethod
    def about(hips: Array, on_circle: Array) -> "Square":
        """The square about the middle of the hips (2,) and the circle through a point (2,) above it [px]."""
        return Square(hips, _ROI_SCALE * (on_circle - hips))

    @staticmethod
    def of_joints(joints: Array) -> "Square | None":
        """The square around a person with joints (12, 2) at the pixels of ``LANDMARKS``; None where hips have none."""
        hips, shoulders = joints[_JOINTS_OF_HIPS].mean(axis=0), joints[_JOINTS_OF_SHOULDERS].mean(axis=0)
        upward = shoulders - hips
        length = float(np.linalg.norm(upward))
        if not length > 0.0:
            return None
        farthest = float(np.nanmax(np.linalg.norm(joints - hips, axis=1)))
        # Hands and feet go on beyond wrists and ankles, and the head beyond the shoulders.
        radius = max(_BEYOND_JOINTS * farthest, _HEAD * length)
        return Square.about(hips, hips + radius / length * upward)

    @property
    def pixels_of_crop(self) -> Array:
        """(2, 3) that takes pixels of the landmarks' image to those of the whole one, both from the first's centre."""
        right = np.array([-self.up[1], self.up[0]])
        step = 2.0 / _LANDMARK_PX
        axes = step * np.stack([right, -self.up], axis=1)
        return np.column_stack([axes, self.centre - axes @ np.full(2, 0.5 * _LANDMARK_PX - 0.5)])


class PoseDetector:
    """Detects people, and twelve joints of each."""

    def __init__(self, detector: Network, landmarker: Network) -> None:
        self._detector = detector
        self._landmarker = landmarker

    @staticmethod
    def installed() -> "PoseDetector":
        """The detector of the packages that are installed.

        Raises:
            BodyError: they are not.
        """
        found = find_spec("mediapipe")
        folders = [] if found is None else [Path(place) for place in found.submodule_search_locations or ()]
        has_files = [folder for folder in folders if all((folder / f).is_file() for f in (_DETECTOR, _LANDMARKER))]
        if find_spec("ai_edge_litert") is None or not has_files:
            without = "" if not folders or has_files else " (this mediapipe has no networks in it)"
            raise BodyError(f"no detector of people is installed{without}; install it with: {INSTALL}")
        return PoseDetector(_tflite(has_files[0] / _DETECTOR), _tflite(has_files[0] / _LANDMARKER))

    def detect(self, image: Image) -> list[Array]:
        """People in an image.

        Args:
            image: (H, W, 3) blue, green, red.

        Returns:
            (12, 3) of each, pixel and score of ``LANDMARKS``, the most certain person first.
        """
        found = [person for square in self._squares(image) if (person := self.detect_in(image, square)) is not None]
        # The score of a person saturates; how many joints are in the image tells more.
        found.sort(key=lambda person: -float(person[:, 2].sum()))
        people: list[Array] = []
        for person in found:
            if not any(_is_same(person, other) for other in people):
                people.append(person)
        return people[:_MOST_PEOPLE]

    def detect_in(self, image: Image, square: Square) -> Array | None:
        """The person in about a square of an image (H, W, 3), as ``detect`` has each; None where there is none."""
        landmarks = np.empty(0)
        for _ in range(_REFINEMENTS):
            score, landmarks = self._landmarks(image, square)
            if score < _LEAST_PERSON_SCORE:
                return None
            square = Square.about(landmarks[_HIPS, :2], landmarks[_CIRCLE, :2])
        return landmarks[list(LANDMARKS)]

    def _squares(self, image: Image) -> list[Square]:
        """Squares around people, the most certain ones first, each person once."""
        boxes = [self._boxes(image, tile) for tile in _tiles(image.shape[1], image.shape[0])]
        rows = np.concatenate(boxes)
        return [Square.about(row[5:7], row[7:9]) for row in suppress_boxes(rows)]

    def _boxes(self, image: Image, tile: tuple[float, float, float]) -> Array:
        """Boxes (N, 9) in a square (left, above, side) of an image: score, two corners, hips, circle [px]."""
        left, above, side = tile
        scale = side / _DETECTOR_PX
        pixels = np.array([[scale, 0.0, left + 0.5 * scale - 0.5], [0.0, scale, above + 0.5 * scale - 0.5]])
        crop = _crop(image, pixels, _DETECTOR_PX)
        outputs = self._detector((crop / 127.5 - 1.0)[None].astype(np.float32))
        rows = decode_boxes(outputs[1, 2254, 12][0], outputs[1, 2254, 1][0, :, 0])
        rows[:, 1:] = rows[:, 1:] * side + np.tile([left - 0.5, above - 0.5], 4)
        return rows

    def _landmarks(self, image: Image, square: Square) -> tuple[float, Array]:
        """Score of a person in a square, and its landmarks (39, 3): pixel and score."""
        to_image = square.pixels_of_crop
        crop = _crop(image, to_image, _LANDMARK_PX)
        outputs = self._landmarker((crop / 255.0)[None].astype(np.float32))
        values = outputs[1, 195].reshape(39, 5)
        pixels = (values[:, :2] - 0.5) @ to_image[:, :2].T + to_image[:, 2]
        scores = 1.0 / (1.0 + np.exp(-np.clip(np.minimum(values[:, 3], values[:, 4]), -50.0, 50.0)))
        return float(outputs[1, 1].squeeze()), np.column_stack([pixels, scores])


def decode_boxes(values: Array, scores: Array) -> Array:
    """Boxes (N, 9) of the detector's outputs that are likely to be people.

    Args:
        values: (2254, 12) of its anchors: centre and size of the box, then four points, each x and y [px of 224], from
            the anchor.
        scores: (2254,) logits.

    Returns:
        score, left, above, right, below, middle of the hips, point on the circle about the person; in sides of the
        detector's image.
    """
    likely = scores > np.log(_LEAST_BOX_SCORE / (1.0 - _LEAST_BOX_SCORE))
    centres = _anchors()[likely]
    numbers = values[likely].astype(np.float64) / _DETECTOR_PX
    middle, half = centres + numbers[:, :2], 0.5 * numbers[:, 2:4]
    probability = 1.0 / (1.0 + np.exp(-np.clip(scores[likely].astype(np.float64), -100.0, 100.0)))
    hips, circle = centres + numbers[:, 4:6], centres + numbers[:, 6:8]
    return np.column_stack([probability, middle - half, middle + half, hips, circle])


def suppress_boxes(boxes: Array) -> Array:
    """Boxes (M, 9) of (N, 9), the most certain first, without those that are mostly another's."""
    left = boxes[np.argsort(-boxes[:, 0])]
    kept: list[Array] = []
    while len(left):
        first, left = left[0], left[1:]
        kept.append(first)
        sides = np.minimum(first[3:5], left[:, 3:5]) - np.maximum(first[1:3], left[:, 1:3])
        common = np.maximum(0.0, sides).prod(axis=1)
        both = (first[3:5] - first[1:3]).prod() + (left[:, 3:5] - left[:, 1:3]).prod(axis=1) - common
        left = left[common < _SAME_BOX * both]
    return np.array(kept).reshape(-1, 9)


def _anchors() -> Array:
    """Centres (2254, 2) of the detector's anchors, in sides of its image."""
    grids = []
    for cells, count in _GRIDS:
        along = (np.arange(cells) + 0.5) / cells
        x, y = np.meshgrid(along, along)
        grids.append(np.repeat(np.stack([x.ravel(), y.ravel()], axis=1), count, axis=0))
    return np.concatenate(grids)


def _tiles(width: int, height: int) -> Iterator[tuple[float, float, float]]:
    """Squares (left, above, side) that are searched [px]: two about the whole image, then some that overlap."""
    longer, shorter = max(width, height), min(width, height)
    for share in _WHOLE:
        side = share * longer
        yield 0.5 * (width - side), 0.5 * (height - side), side
    for share in _TILES:
        side = share * shorter
        counts = [1 + int(np.ceil((length - side) / (_TILE_STEP * side) - 1e-9)) for length in (width, height)]
        if counts == [1, 1]:
            continue
        for above in np.linspace(0.0, height - side, counts[1]).tolist():
            for left in np.linspace(0.0, width - side, counts[0]).tolist():
                yield left, above, side


def _crop(image: Image, pixels_of_crop: Array, side: int) -> Image:
    """The square (side, side, 3) of an image, red, green, blue; black beyond it."""
    # Linear interpolation of a crop that is much smaller than the image aliases.
    shrinks = float(np.linalg.norm(pixels_of_crop[:, 0]))
    if shrinks > 2.0:
        size = (max(1, round(image.shape[1] * 2.0 / shrinks)), max(1, round(image.shape[0] * 2.0 / shrinks)))
        scale = np.array([size[0] / image.shape[1], size[1] / image.shape[0]])
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        pixels_of_crop = np.column_stack(
            [scale[:, None] * pixels_of_crop[:, :2], scale * (pixels_of_crop[:, 2] + 0.5) - 0.5]
        )
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    crop = cv2.warpAffine(image, pixels_of_crop, (side, side), flags=flags, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(crop[:, :, ::-1], np.uint8)


def _is_same(one: Array, other: Array) -> bool:
    """Whether landmarks (12, 3) are those of a person that was found already."""
    extent = max(float(np.ptp(points[:, :2], axis=0).max()) for points in (one, other))
    return float(np.linalg.norm(one[:, :2] - other[:, :2], axis=1).mean()) < _SAME_PERSON * extent


def _tflite(path: Path) -> Network:
    """A network's file, ready to run."""
    from ai_edge_litert.interpreter import Interpreter

    interpreter = Interpreter(str(path), num_threads=1)
    interpreter.allocate_tensors()
    [into] = interpreter.get_input_details()
    outputs: Sequence[Mapping[str, object]] = interpreter.get_output_details()

    def run(image: NDArray[np.float32]) -> Mapping[tuple[int, ...], Array]:
        interpreter.set_tensor(into["index"], image)
        interpreter.invoke()
        values = [interpreter.get_tensor(output["index"]) for output in outputs]
        return {value.shape: value.astype(np.float64) for value in values}

    return run
