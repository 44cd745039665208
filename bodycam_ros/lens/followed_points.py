"""Points followed through a camera's pictures, as the pairs of pictures that ``lens_match`` takes."""

from collections.abc import Iterable, Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.lens.lens_match import PointPair

Grey = NDArray[np.uint8]

_WIDTH = 640  # that pictures are brought to
_POINTS = 300
_LEAST_LEFT = 60
_FAR = 0.12  # of the width, by which points must have moved between the two pictures
_LONGEST = 30  # pictures from the first of a pair to the second
_RETURN_PX = 0.5


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


def followed_pairs(pictures: Iterable[Grey], most: int) -> Iterator[PointPair]:
    """Pairs of pictures that have many points in common and show them in different places.

    Args:
        pictures: grey (H, W), one after the other; taken until there are enough pairs.
        most: pairs.
    """
    found = 0
    points = FollowedPoints()
    for picture in pictures:
        if (pair := points.add(picture)) is not None:
            yield pair
            found += 1
            if found >= most:
                return


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
