"""Where cameras were registered, and where the solved body has them, at the same instants."""

from collections.abc import Mapping
from dataclasses import dataclass

from bodycam_ros.geometry import Array
from bodycam_ros.verdict.lens_evidence import LensDeviation


@dataclass(frozen=True)
class CameraCount:
    """A camera's images so far.

    Attributes:
        images: that were tracked.
        registered: of them with a pose.
        first_ns: stamp of the first image [ns].
        last_ns: stamp of the last image [ns].
        last_registered_ns: stamp of the last with a pose [ns]; 0 if there was none.
    """

    images: int = 0
    registered: int = 0
    first_ns: int = 0
    last_ns: int = 0
    last_registered_ns: int = 0

    @property
    def share(self) -> float:
        """Of the images that were registered."""
        return self.registered / self.images if self.images else 0.0


@dataclass(frozen=True, eq=False)
class Agreement:
    """C cameras at T instants; rows are in the order of time.

    Attributes:
        cameras: names, those on the body that were heard.
        seconds: (T,) since ``start_ns`` [s].
        start_ns: stamp of the first image [ns].
        world_T_registered: (T, C, 4, 4) poses of the optical frames by their own registration [m]; NaN where unknown.
        twists: (T, C, 6) velocity of these poses in their own axes [rad/s, m/s]; NaN where unknown.
        world_T_solved: (T, C, 4, 4) where the solved body has them [m].
        counts: camera -> its images.
        lens_errors: camera -> by how much its lens is not what its model says; absent where nobody knows.
    """

    cameras: tuple[str, ...]
    seconds: Array
    start_ns: int
    world_T_registered: Array
    twists: Array
    world_T_solved: Array
    counts: Mapping[str, CameraCount]
    lens_errors: Mapping[str, LensDeviation]

    def registered(self, camera: str) -> Array:
        """(T, 4, 4) registered poses of a camera."""
        return self.world_T_registered[:, self.cameras.index(camera)]

    def solved(self, camera: str) -> Array:
        """(T, 4, 4) solved poses of a camera."""
        return self.world_T_solved[:, self.cameras.index(camera)]
