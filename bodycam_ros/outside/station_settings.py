"""Settings of how static cameras find out where they stand."""

from dataclasses import dataclass

from bodycam_ros.registration.absolute_pose_settings import AbsolutePoseSettings
from bodycam_ros.registration.direct_registration import DirectSettings
from bodycam_ros.registration.matching import MatchingSettings
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.registration.registrar_settings import RegistrarSettings
from bodycam_ros.settings import SettingsGroups, setting


@dataclass(frozen=True)
class StationSettings:
    """How static cameras find out where they stand."""

    images: int = setting(
        12,
        unit="images",
        limits=(2, 500),
        reason="of each camera, spread over the recording: who stands before the place in one has moved on in another",
    )
    keypoints: int = setting(
        2000,
        limits=(50, 20000),
        reason="of an image, by which the camera is found; 600 give two thirds of the landmarks, in as good as the "
        "same time",
    )
    per_cell: int = setting(
        20,
        limits=(1, 200),
        reason="landmarks that are asked in each cell of an image (direct.cells), in place of direct.per_cell; in the "
        "hall 2 leave 1.3 to 4.8 mm, 20 leave 0.4 to 2.6",
    )
    agree_sigmas: float = setting(
        6.0,
        limits=(2.0, 100.0),
        reason="by which the pose of one image may differ from that of all; images of a camera that stands, half of "
        "each covered, stay within 5.2",
    )
    still_px: float = setting(
        1.0,
        unit="px",
        limits=(0.0, 20.0),
        reason="by which the picture of the place may shift, whatever the sigmas: a tripod gives way where people "
        "jump; beyond both the camera moves",
    )


@dataclass(frozen=True)
class StationsSettings(SettingsGroups):
    """Settings of every step from the images of a static camera to its pose."""

    stations: StationSettings = StationSettings()
    registrar: RegistrarSettings = RegistrarSettings()
    matching: MatchingSettings = MatchingSettings()
    absolute_pose: AbsolutePoseSettings = AbsolutePoseSettings()
    pose_fit: PoseFitSettings = PoseFitSettings()
    direct: DirectSettings = DirectSettings()
