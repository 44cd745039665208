"""All settings that a reference map is built with, by group."""

from dataclasses import dataclass

from bodycam_ros.mapping.alignment import AlignmentSettings, FloorSettings
from bodycam_ros.mapping.apriltag import TagSettings
from bodycam_ros.mapping.coverage import CoverageSettings
from bodycam_ros.mapping.epipolar_matching import EpipolarSettings
from bodycam_ros.mapping.features import FeatureSettings, PairSettings
from bodycam_ros.mapping.frame_choice import FrameChoiceSettings
from bodycam_ros.mapping.known_distance import KnownDistanceSettings
from bodycam_ros.mapping.small_photographs import KeptPhotographSettings
from bodycam_ros.mapping.structure import DescriptorSettings
from bodycam_ros.mapping.worn_keyframes import WornKeyframeSettings
from bodycam_ros.settings import SettingsGroups, setting


@dataclass(frozen=True)
class LandmarkSettings:
    """Which points of the structure are good enough to be landmarks."""

    max_error: float = setting(1.0, unit="px", limits=(0.1, 10.0), reason="largest reprojection error, A section 4.1")
    min_angle: float = setting(
        2.0, unit="deg", limits=(0.1, 45.0), reason="least angle between two rays, A section 4.1"
    )
    min_views: int = setting(
        3, unit="photographs", limits=(2, 50), reason="two rays always nearly meet; the third tells a wrong match"
    )
    min_fitting: float = setting(
        0.22,
        limits=(0.0, 1.0),
        reason="least share of what the largest features match that must fit, or there is no map; 0.78 and more with "
        "the right camera.yaml, 0.19 to 0.30 with a focal length 20 % off",
    )
    doubtful_fitting: float = setting(
        0.45,
        limits=(0.0, 1.0),
        reason="a smaller share is warned of; 0.13 to 0.32 with another lens model, with fx, fy 5 % off 0.38 in a "
        "hundred photographs, 0.7 in thirty",
    )
    max_model_error: float = setting(
        2.0,
        unit="px",
        limits=(0.1, 100.0),
        reason="median reprojection error of a model that is taken over (--model); one made with other intrinsics than "
        "those of camera.yaml is far above, a sound one far below",
    )


@dataclass(frozen=True)
class MapSettings(SettingsGroups):
    """Settings of every step from photographs to a map."""

    frames: FrameChoiceSettings = FrameChoiceSettings()
    features: FeatureSettings = FeatureSettings()
    pairs: PairSettings = PairSettings()
    epipolar: EpipolarSettings = EpipolarSettings()
    landmarks: LandmarkSettings = LandmarkSettings()
    descriptors: DescriptorSettings = DescriptorSettings()
    kept: KeptPhotographSettings = KeptPhotographSettings()
    tags: TagSettings = TagSettings()
    alignment: AlignmentSettings = AlignmentSettings()
    coverage: CoverageSettings = CoverageSettings()
    worn: WornKeyframeSettings = WornKeyframeSettings()
    known_distance: KnownDistanceSettings = KnownDistanceSettings()
    floor: FloorSettings = FloorSettings()


@dataclass(frozen=True)
class CheckSettings(SettingsGroups):
    """Settings of ``bodycam map check`` alone."""

    coverage: CoverageSettings = CoverageSettings()
