"""When the map grows, and what becomes a landmark of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.settings import setting
from bodycam_ros.tracking.keypoints import KeypointSettings


@dataclass(frozen=True)
class GrowthSettings:
    """Growth of the map by what registered cameras see (A 4.1, second half)."""

    enabled: bool = setting(True, reason="whether worn cameras add landmarks where the photographs show none")
    capacity: int = setting(
        12000,
        unit="landmarks",
        limits=(100, 1_000_000),
        reason="that may be there at a time; the longest unseen go first, so an hour costs no more than a minute",
    )
    covered: float = setting(
        0.5,
        limits=(0.0, 1.0),
        reason="a camera that finds landmarks in this share of its view adds none, and pays for no keyframes",
    )
    keyframe_step: float = setting(
        0.12, unit="m", limits=(0.01, 10.0), reason="that a camera moves from keyframe to keyframe: 2 deg at 3 m"
    )
    keyframe_turn: float = setting(
        20.0, unit="deg", limits=(1.0, 180.0), reason="or that it turns: SIFT stands some 30"
    )
    keyframe_gap: float = setting(
        0.3, unit="s", limits=(0.0, 60.0), reason="least time between two; SIFT costs as much as ten images of tracking"
    )
    max_sigma: float = setting(
        0.02, unit="m", limits=(0.001, 1.0), reason="of a keyframe's position; rays from who knows where make no points"
    )
    keyframes: int = setting(
        320, limits=(8, 10000), reason="that are kept to be matched with, of all cameras; the oldest go first"
    )
    partners: int = setting(8, limits=(1, 100), reason="keyframes that a new one is matched with")
    max_axis_angle: float = setting(
        90.0, unit="deg", limits=(10.0, 180.0), reason="between the optical axes of two that are matched, A section 4.1"
    )
    min_baseline: float = setting(
        0.06, unit="m", limits=(0.001, 10.0), reason="between two that are matched: less is no parallax at a metre"
    )
    epipolar_px: float = setting(
        2.0, unit="px", limits=(0.2, 20.0), reason="a match may lie beside its epipolar line: features and poses err"
    )
    max_distance: float = setting(
        230.0, limits=(50.0, 724.0), reason="between RootSIFT vectors of length 512 of two keyframes"
    )
    ratio: float = setting(
        0.85, limits=(0.3, 1.0), reason="best to second best distance along the epipolar line (Lowe 2004)"
    )
    max_size_ratio: float = setting(
        2.0, limits=(1.1, 10.0), reason="size of a feature against the one that the distance of the point predicts"
    )
    max_error: float = setting(1.0, unit="px", limits=(0.1, 10.0), reason="largest reprojection error, A section 4.1")
    min_angle: float = setting(
        2.0, unit="deg", limits=(0.1, 45.0), reason="least angle between two rays, A section 4.1"
    )
    min_views: int = setting(
        3, unit="keyframes", limits=(2, 20), reason="two rays always nearly meet; the third tells a wrong match"
    )
    min_lasting: float = setting(
        0.2,
        unit="s",
        limits=(0.0, 60.0),
        reason="from the first of those to the last; what several cameras see at one instant may be on its way",
    )
    forget_after: float = setting(
        20.0,
        unit="s",
        limits=(1.0, 100000.0),
        reason="a landmark that nobody finds for so long goes, and one that was found before a second later per image",
    )
    max_strikes: int = setting(
        3, limits=(1, 100), reason="images more in which a landmark was wrong than right; then it goes"
    )


@dataclass(frozen=True)
class ExtensionSettings:
    """Rounds of registration and growth over a recording (A 4.1), where time is no matter of milliseconds."""

    rounds: int = setting(
        5, limits=(1, 20), reason="at most, as in A section 4.1; fewer where one registers no more images than before"
    )
    least_gain: float = setting(
        0.001, limits=(0.0, 1.0), reason="share of all images that a round must add for another to follow"
    )
    covered: float = setting(
        0.8,
        limits=(0.0, 1.0),
        reason="images that show landmarks of the photographs in a larger share of their view add none",
    )
    keyframes: int = setting(
        300,
        unit="images",
        limits=(10, 10000),
        reason="of all cameras that the map grows by; 30 kB each in the map, and a tenth of a second each in a round",
    )
    image_scale: float = setting(
        1.0, limits=(0.25, 1.0), reason="at which features are looked for: at full size they are twice as exact"
    )
    max_features: int = setting(1200, unit="per image", limits=(50, 20000), reason="the strongest")
    partners: int = setting(12, limits=(1, 100), reason="images that each is matched with")
    capacity: int = setting(40000, unit="landmarks", limits=(100, 1_000_000), reason="that the map grows by at most")
    looks: int = setting(4, limits=(1, 10), reason="descriptors of a grown landmark, from sides far from each other")
    quality: int = setting(75, unit="%", limits=(30, 100), reason="of the JPEG coding of images that the map keeps")

    def growth(self, live: GrowthSettings) -> GrowthSettings:
        """The growth's settings where all of a recording is at hand."""
        return replace(live, capacity=self.capacity, keyframes=self.keyframes, partners=self.partners)

    @property
    def keypoints(self) -> KeypointSettings:
        """How features are found in the images."""
        return KeypointSettings(image_scale=self.image_scale, max_keypoints=self.max_features)


@dataclass(frozen=True)
class ExtensionRound:
    """One round.

    Attributes:
        backwards: whether it went from the recording's end to its start.
        shares: camera -> share of its images that are registered, in this round or before.
        share: the same of all images.
        absolute: share of all images that landmarks of the photographs were enough to hold, whatever helped to find
            them; later rounds have fewer, because cameras then prefer landmarks that their own kind has seen.
        landmarks: that the map had grown by.
        places: camera -> (N, 3) where its registered images were taken [m].
    """

    backwards: bool
    shares: Mapping[str, float]
    share: float
    absolute: float
    landmarks: int
    places: Mapping[str, NDArray[np.float64]]
