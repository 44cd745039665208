"""How a map is extended by a whole recording."""

from dataclasses import dataclass, replace

from bodycam_ros.growth.growth_settings import GrowthSettings
from bodycam_ros.settings import setting
from bodycam_ros.tracking.keypoints import KeypointSettings


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
