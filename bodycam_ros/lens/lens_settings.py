"""Settings of the calibration of a lens."""

from dataclasses import dataclass

from bodycam_ros.settings import SettingsGroups, setting


@dataclass(frozen=True)
class LensSettings:
    """Which pictures of a board a lens is measured by, and when the result is refused."""

    looked_at: int = setting(
        120, unit="pictures", limits=(10, 2000), reason="of a video, the sharpest of as many equal parts of it"
    )
    taken: int = setting(
        60, unit="pictures", limits=(8, 500), reason="the sharp ones that are spread best; more add time, hardly truth"
    )
    min_pictures: int = setting(8, unit="pictures", limits=(4, 100), reason="fewer cannot be cross-validated")
    min_sharpness: float = setting(
        0.5, limits=(0.0, 1.0), reason="of the better pictures' steepest edges; blur moves edges that light bounds"
    )
    min_coverage: float = setting(
        0.5, limits=(0.1, 1.0), reason="share of the picture's cells in which the board was seen"
    )
    min_reach: float = setting(
        0.8, limits=(0.3, 1.0), reason="of the image radius out to which it was seen; beyond that the lens is a guess"
    )
    min_tilts: int = setting(
        3, limits=(1, 20), reason="ways the board was turned, 15 deg apart; without them focal length is distance"
    )
    max_error: float = setting(
        1.0, unit="px", limits=(0.05, 10.0), reason="median error of pictures left out; more is a wrong model or board"
    )
    max_ray_error: float = setting(
        1.0,
        unit="px",
        limits=(0.05, 20.0),
        reason="of any ray up to 90 % of the image radius, by how lenses of fewer pictures differ",
    )


@dataclass(frozen=True)
class LensCalibrationSettings(SettingsGroups):
    """Settings of ``bodycam lens``."""

    lens: LensSettings = LensSettings()
