"""Following points from one image to the next: pyramidal Lucas-Kanade with a forward-backward check.

Gain and exposure drift; two images are brought to one brightness where they differ.

Lucas-Kanade takes a change of brightness for motion: 3 % are 0.15 px, and 20 % lose three tracks of four.
"""

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.settings import setting

_REMEMBERED = 15
"""Images whose distance in time tells the camera's rate."""

_EMPTY = 0.25
"""Times the longest wait: who waits for less hardly waits."""


class EverySecondImage:
    """Decides, image by image, whether it is left out.

    It begins when an image has waited for too long, and ends when for a while none has waited to speak of. Which of two
    images goes is told by their stamps, not by turns: cameras that trigger together leave out the same ones, and the
    instants that are left have all of them.

    Args:
        longest_wait_s: that an image may have waited; 0: nothing is ever left out.
        recovery_s: how long nothing may have waited before all images are taken again.

    Attributes:
        longest_wait_s, recovery_s: as given; they may be replaced.
        active: whether every second image is left out.
    """

    def __init__(self, longest_wait_s: float, recovery_s: float) -> None:
        self.longest_wait_s = longest_wait_s
        self.recovery_s = recovery_s
        self._calm_since_s: float | None = None
        self._stamps_ns: deque[int] = deque(maxlen=_REMEMBERED)
        self._slot: int | None = None
        self.active = False

    def leaves_out(self, stamp_ns: int, waited_s: float, now_s: float) -> bool:
        """Whether an image is left out; ask about every image, in order.

        Args:
            stamp_ns: of the image.
            waited_s: how long it waited because others were worked on.
            now_s: on the steady clock.
        """
        self._judge(waited_s, now_s)
        if self._stamps_ns and stamp_ns <= self._stamps_ns[-1]:
            self.forget()
        self._stamps_ns.append(stamp_ns)
        if not self.active or len(self._stamps_ns) < 3:
            self._slot = None
            return False
        # A whole number of images a second: two cameras must not differ by what they measure of their rate.
        rate_hz = max(1, round(1e9 / float(np.median(np.diff(self._stamps_ns)))))
        # Stamps that are whole multiples of the interval, but for their rounding, must not lie where slots meet.
        slot = (stamp_ns * rate_hz + 500_000_000) // 2_000_000_000
        second = slot == self._slot
        self._slot = slot
        return second

    def forget(self) -> None:
        """Time begins anew."""
        self._stamps_ns.clear()
        self._slot = None

    def _judge(self, waited_s: float, now_s: float) -> None:
        if self.longest_wait_s <= 0.0:
            return
        if waited_s > self.longest_wait_s:
            self.active = True
        if not self.active or waited_s > _EMPTY * self.longest_wait_s:
            self._calm_since_s = None
            return
        self._calm_since_s = now_s if self._calm_since_s is None else self._calm_since_s
        if now_s - self._calm_since_s >= self.recovery_s:
            self.active, self._calm_since_s = False, None


_STEPS = np.arange(-5.0, 6.0, 2.0, dtype=np.float32)  # [px] of the samples around a point, each way
_DARK = 8.0  # [grey levels] below it noise and black level are most of what is seen
_BRIGHT = 250.0  # above it the sensor is saturated
_LEAST_TRACKS = 20
_SIGMA_OF_MAD = 1.86  # standard deviation of a median over the median deviation, times the root of the count
_SURE = 6.0


def brightness_ratio(
    previous: NDArray[np.uint8],
    current: NDArray[np.uint8],
    pixels_previous: NDArray[np.float32],
    pixels_current: NDArray[np.float32],
) -> float:
    """Brightness of the current image over that of the previous one: the median over what surrounds points.

    Args:
        previous, current: (H, W) grey images.
        pixels_previous, pixels_current: (N, 2) the same points in both.

    Returns:
        The ratio, or 1 where too few points are neither black nor saturated, or where they do not agree: light that
        changes does so everywhere.
    """
    if len(pixels_previous) < _LEAST_TRACKS:
        return 1.0
    before, after = _surroundings(previous, pixels_previous), _surroundings(current, pixels_current)
    usable = (np.minimum(before, after) > _DARK) & (np.maximum(before, after) < _BRIGHT)
    if usable.sum() < _LEAST_TRACKS:
        return 1.0
    change = np.log(after[usable] / before[usable])
    middle = float(np.median(change))
    spread = _SIGMA_OF_MAD * float(np.median(np.abs(change - middle))) / np.sqrt(len(change))
    return float(np.exp(middle)) if abs(middle) > _SURE * spread else 1.0


def evened(
    previous: NDArray[np.uint8], current: NDArray[np.uint8], ratio: float
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Both images (H, W) at one brightness; the brighter one is darkened, so that nothing saturates."""
    if ratio > 1.0:
        return previous, np.asarray(cv2.convertScaleAbs(current, alpha=1.0 / ratio), np.uint8)
    return np.asarray(cv2.convertScaleAbs(previous, alpha=ratio), np.uint8), current


def _surroundings(image: NDArray[np.uint8], pixels: NDArray[np.float32]) -> NDArray[np.float64]:
    """Mean grey levels (N,) around pixels (N, 2), between pixels too: beside an edge half a pixel is some per cent."""
    columns = pixels[:, 0, None, None] + _STEPS + np.zeros_like(_STEPS)[:, None]
    rows = pixels[:, 1, None, None] + _STEPS[:, None] + np.zeros_like(_STEPS)
    shape = (len(pixels), len(_STEPS) ** 2)
    samples = cv2.remap(
        image, columns.reshape(shape), rows.reshape(shape), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    means: NDArray[np.float64] = samples.mean(axis=1)
    return means


_MOST_COMPARISONS = 3
"""Of a drift one is enough; of a jump by a fifth, which loses most points at first, two more find the rest."""


@dataclass(frozen=True)
class OpticalFlowSettings:
    """Window, depth of the pyramid and tolerance of the check."""

    window_px: int = setting(
        11,
        unit="px",
        limits=(5, 41),
        reason="side of the matched patch; larger is steadier, slower and blurs depth edges",
    )
    pyramid_levels: int = setting(
        3, limits=(0, 6), reason="3 reach 60 px from the prediction, more than a limb's surprise in 1/30 s"
    )
    forward_backward_px: float = setting(
        0.8, unit="px", limits=(0.05, 5.0), reason="a point that does not come back to within this is lost"
    )
    brightness_tolerance: float = setting(
        0.01,
        limits=(0.001, 1.0),
        reason="images whose brightness differs by more are evened and compared again; 1 % is 0.06 px",
    )


def follow(
    previous: NDArray[np.uint8],
    current: NDArray[np.uint8],
    pixels: NDArray[np.float32],
    predicted: NDArray[np.float32],
    settings: OpticalFlowSettings,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Follow points into the current image.

    Args:
        previous: (H, W) grey image in which ``pixels`` (N, 2) lie.
        current: (H, W) grey image.
        pixels: (N, 2) points in the previous image.
        predicted: (N, 2) where they are expected in the current image.
        settings: window and tolerance.

    Returns:
        (N, 2) points in the current image and (N,) whether each survived the check: found both ways, back within
        tolerance, inside the image.
    """
    if len(pixels) == 0:
        return pixels.reshape(-1, 2), np.zeros(0, bool)
    ratio, start = 1.0, predicted
    for _ in range(_MOST_COMPARISONS):
        images = (previous, current) if ratio == 1.0 else evened(previous, current, ratio)
        found, alive = _compare(*images, pixels, start, settings)
        step = brightness_ratio(*images, pixels[alive], found[alive])
        if abs(step - 1.0) <= settings.brightness_tolerance:
            break
        ratio *= step
        start = np.where(alive[:, None], found, predicted).astype(np.float32)
    return found, alive


def _compare(
    previous: NDArray[np.uint8],
    current: NDArray[np.uint8],
    pixels: NDArray[np.float32],
    predicted: NDArray[np.float32],
    settings: OpticalFlowSettings,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Points in the current image and whether each survived, of two images of one brightness."""
    window = (settings.window_px, settings.window_px)
    forward, found, _ = cv2.calcOpticalFlowPyrLK(
        previous,
        current,
        pixels.reshape(-1, 1, 2),
        predicted.reshape(-1, 1, 2).copy(),
        winSize=window,
        maxLevel=settings.pyramid_levels,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    # The way back starts at the answer it should find, so the coarse levels have nothing to add.
    backward, found_back, _ = cv2.calcOpticalFlowPyrLK(
        current,
        previous,
        forward,
        pixels.reshape(-1, 1, 2).copy(),
        winSize=window,
        maxLevel=0,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    forward = forward.reshape(-1, 2)
    height, width = current.shape
    returned = np.linalg.norm(backward.reshape(-1, 2) - pixels, axis=1) < settings.forward_backward_px
    inside = ((forward >= 0) & (forward <= [width - 1, height - 1])).all(axis=1)
    return forward, (found.ravel() > 0) & (found_back.ravel() > 0) & returned & inside
