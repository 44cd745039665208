"""Whether a camera that does not find itself has the lens that it is said to have: a little work at each image."""

from collections import deque

from bodycam_ros.camera import CameraModel
from bodycam_ros.lens.followed_points import FollowedPoints, Grey
from bodycam_ros.lens.lens_match import SCALES, LensMatch, PointPair, error_at, judged, tells

_PAIRS = 8
_STEPS = 3
"""Scales of the lens that are tried at an image: some 8 ms."""

_SPAN = 60
"""Images whose registration tells whether there is cause to ask."""

_REGISTERED = 0.5
"""Share of them: below it there is. Who finds itself in the map more often has its lens."""


class LensWatch:
    """Compares the lens of a camera with its images where the camera hardly finds itself in the map.

    Args:
        camera: as its camera_info says.

    Attributes:
        match: what its images say, once enough of them have been compared; None until then.
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
        """Whether the camera has hardly found itself of late."""
        return len(self._registered) == _SPAN and sum(self._registered) < _REGISTERED * _SPAN

    @property
    def remark(self) -> str:
        """What speaks against the lens; empty if nothing does."""
        return "" if self.match is None or self.match.matches else self.match.text

    @property
    def said(self) -> str:
        """What is known of it, in a word."""
        if self.match is None:
            return "is compared" if self.is_doubted else "no cause for doubt"
        return "another one" if self.remark else "fits"

    def hear(self, is_registered: bool) -> None:
        """Whether an image was registered."""
        self._registered.append(is_registered)

    def look(self, picture: Grey) -> bool:
        """Take the next image, grey (H, W), and do a step of what is to be compared; whether it has just been judged.

        A step takes some milliseconds; while the camera finds itself, nothing is done.
        """
        if self.match is not None or not self.is_doubted:
            return False
        if self._waiting is None:
            self._waiting = self._points.add(picture)
            if self._waiting is not None and not tells(self._camera, self._waiting):
                self._waiting = None
            return False
        for scale in SCALES[len(self._row) :][:_STEPS]:
            self._row.append(error_at(self._camera, float(scale), self._waiting))
        if len(self._row) < len(SCALES):
            return False
        self._errors.append(self._row)
        # The points are followed anew: images have passed meanwhile.
        self._row, self._waiting, self._points = [], None, FollowedPoints()
        if len(self._errors) < _PAIRS:
            return False
        self.match = judged(self._camera, self._errors)
        return True
