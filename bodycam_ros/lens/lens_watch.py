"""A check of a camera's calibration against its own images: of a recording, or image by image while it runs."""

from collections import deque
from collections.abc import Iterable
from itertools import islice

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array
from bodycam_ros.lens.lens_match import SCALES, LensMatch, PointPair, epipolar_error, judge_lens, lens_match, shows_lens

Grey = NDArray[np.uint8]

_WIDTH = 640  # that pictures are brought to
_POINTS = 300
_LEAST_LEFT = 60
_FAR = 0.12  # of the width, by which points must have moved between the two pictures
_LONGEST = 30  # pictures from the first of a pair to the second
_RETURN_PX = 0.5

_PAIRS = 8
_STEPS = 3  # scales of the lens that are tried at an image: some 8 ms
_SPAN = 60  # images whose registration shows whether a check is needed
_REGISTERED = 0.5  # share of them; a camera that is registered more often has its lens


class FollowedPoints:
    """Follows points from picture to picture until they have moved far enough."""

    def __init__(self) -> None:
        self._before: Grey | None = None
        self._start = self._now = np.zeros((0, 2), np.float32)
        self._age = 0

    def add(self, picture: Grey) -> PointPair | None:
        """A pair of pictures that have many points in common and show them in different places, if this completes one.

        Args:
            picture: grey (H, W), of the size of those before.
        """
        scale = min(1.0, _WIDTH / picture.shape[1])
        small = np.asarray(cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        pair: PointPair | None = None
        if self._before is not None and len(self._now):
            ahead, kept = _followed(self._before, small, self._now)
            self._start, self._now = self._start[kept], ahead[kept]
            self._age += 1
            moved = float(np.median(np.linalg.norm(self._now - self._start, axis=1))) if len(self._now) else 0.0
            if len(self._now) >= _LEAST_LEFT and moved >= _FAR * small.shape[1]:
                pair = _whole(self._start, scale), _whole(self._now, scale)
                self._now = self._now[:0]
        if len(self._now) < _LEAST_LEFT or self._age >= _LONGEST:
            corners = cv2.goodFeaturesToTrack(small, _POINTS, 0.01, 7.0)
            none = np.zeros((0, 2), np.float32)
            self._now = none if corners is None else np.asarray(corners, np.float32).reshape(-1, 2)
            self._start, self._age = self._now, 0
        self._before = small
        return pair


def match_images(camera: CameraModel, images: Iterable[Grey], most_images: int) -> LensMatch:
    """Compare a lens with images, grey (H, W), one after the other; taken until there are enough pairs of them."""
    points, pairs = FollowedPoints(), []
    for image in islice(images, most_images):
        if (pair := points.add(image)) is not None:
            pairs.append(pair)
            if len(pairs) == _PAIRS:
                break
    return lens_match(camera, pairs)


def _followed(before: Grey, after: Grey, points: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    window = {"winSize": (15, 15), "maxLevel": 4}
    ahead, found, _ = cv2.calcOpticalFlowPyrLK(before, after, points[:, None], None, **window)
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(after, before, ahead, None, **window)
    returned = np.linalg.norm(back[:, 0] - points, axis=1) < _RETURN_PX
    return ahead[:, 0], returned & (found.ravel() > 0) & (found_back.ravel() > 0)


def _whole(pixels: NDArray[np.float32], scale: float) -> Array:
    """Pixels of the picture as it was; centres are integers in both."""
    whole: Array = (pixels.astype(np.float64) + 0.5) / scale - 0.5
    return whole


class LensWatch:
    """Compares the lens of a camera with its images where the camera is hardly ever registered.

    Args:
        camera: of its camera_info.

    Attributes:
        match: the result, once enough images have been compared; None until then.
    """

    def __init__(self, camera: CameraModel) -> None:
        self._camera = camera
        self._registered: deque[bool] = deque(maxlen=_SPAN)
        self._points = FollowedPoints()
        self._waiting: PointPair | None = None
        self._errors: list[list[float]] = []
        self._row: list[float] = []
        self.match: LensMatch | None = None

    @property
    def is_doubted(self) -> bool:
        """Whether the camera was hardly registered of late."""
        return len(self._registered) == _SPAN and sum(self._registered) < _REGISTERED * _SPAN

    @property
    def remark(self) -> str:
        """What contradicts the lens; empty if nothing does."""
        return "" if self.match is None or self.match.matches else self.match.text

    @property
    def state(self) -> str:
        """Result of the comparison, in a word or two."""
        if self.match is None:
            return "being compared" if self.is_doubted else "not compared"
        return "another one" if self.remark else "fits"

    def note_registration(self, is_registered: bool) -> None:
        """Count an image that was registered, or not."""
        self._registered.append(is_registered)

    def add_image(self, image: Grey) -> bool:
        """Take the next image, grey (H, W), and do a step of the comparison; whether it has just ended.

        A step takes some milliseconds; while the camera is registered, nothing is done.
        """
        if self.match is not None or not self.is_doubted:
            return False
        if self._waiting is None:
            self._waiting = self._points.add(image)
            if self._waiting is not None and not shows_lens(self._camera, self._waiting):
                self._waiting = None
            return False
        for scale in SCALES[len(self._row) :][:_STEPS]:
            self._row.append(epipolar_error(self._camera, float(scale), self._waiting))
        if len(self._row) < len(SCALES):
            return False
        self._errors.append(self._row)
        # The points are followed anew: images have passed meanwhile.
        self._row, self._waiting, self._points = [], None, FollowedPoints()
        if len(self._errors) < _PAIRS:
            return False
        self.match = judge_lens(self._camera, self._errors)
        return True
