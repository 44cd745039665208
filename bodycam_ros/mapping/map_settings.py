"""Public settings of ``bodycam map``, and of map extension by body cameras."""

from dataclasses import dataclass

from bodycam_ros.settings import SettingsGroups, setting


@dataclass(frozen=True)
class FrameSettings:
    """Which frames of a video or bag become photographs."""

    most: int = setting(
        150,
        unit="frames",
        limits=(2, 2000),
        reason="most frames of all cameras together; time grows faster than their number",
    )


@dataclass(frozen=True)
class FeatureSettings:
    """How features are found in photographs."""

    max_features: int = setting(
        4000,
        unit="per photograph",
        limits=(500, 20000),
        reason="most features; the largest are kept, since body cameras do not see the smallest",
    )


@dataclass(frozen=True)
class MapSettings(SettingsGroups):
    """Settings of every step from photographs to a map."""

    frames: FrameSettings = FrameSettings()
    features: FeatureSettings = FeatureSettings()


@dataclass(frozen=True)
class ExtensionSettings:
    """Map extension: while cameras are registered (A 4.1, second half), and in rounds over a recording (A 4.1)."""

    enabled: bool = setting(True, reason="body cameras add landmarks where the photographs show none")
    capacity: int = setting(
        12000,
        unit="landmarks",
        limits=(100, 1_000_000),
        reason="most added landmarks at a time; those unobserved for longest are removed first. More costs memory",
    )
    rounds: int = setting(
        5,
        limits=(1, 20),
        reason="most rounds over a recording; extension stops after a round that registers no more images",
    )
