"""Public settings of ``bodycam map``."""

from dataclasses import dataclass

from bodycam_ros.settings import SettingsGroups, setting


@dataclass(frozen=True)
class FrameSettings:
    """Which frames of a video or bag become photographs."""

    step_deg: float = setting(
        10.0,
        unit="deg",
        limits=(0.5, 60.0),
        reason="change of view between two frames, by turning or by passing things; lower takes more frames",
    )
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
class KeptPhotographSettings:
    """What the map keeps of the photographs."""

    keep: bool = setting(
        True, reason="keep small photographs in the map; without them landmarks are known by their descriptors alone"
    )


@dataclass(frozen=True)
class MapSettings(SettingsGroups):
    """Settings of every step from photographs to a map."""

    frames: FrameSettings = FrameSettings()
    features: FeatureSettings = FeatureSettings()
    kept: KeptPhotographSettings = KeptPhotographSettings()
