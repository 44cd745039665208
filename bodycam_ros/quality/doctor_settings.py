"""Limits of the checks: from when on a light is amber or red."""

from dataclasses import dataclass

from bodycam_ros.registration.lost_camera import AbsolutePoseSettings
from bodycam_ros.registration.matching import MatchingSettings
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.registration.registrar import RegistrarSettings
from bodycam_ros.settings import SettingsGroups, setting


@dataclass(frozen=True)
class DoctorSettings:
    """How much of a recording the doctor looks at, and what it thinks of it."""

    images: int = setting(
        12,
        limits=(2, 500),
        reason="of each camera, spread over the recording: enough to see what is wrong all the time, in seconds",
    )
    registered_images: int = setting(
        6,
        limits=(1, 500),
        reason="of those, by which the share that finds itself in the map is told: each costs a tenth of a second",
    )
    exercise_images: int = setting(
        20,
        limits=(4, 1000),
        reason="of each camera of a range of motion, by which it is told which joints were moved; more miss less",
    )
    low_rate: float = setting(
        10.0,
        unit="Hz",
        limits=(0.1, 1000.0),
        reason="images a second; a walk was solved as well at 10 as at 30, below it limbs turn too far in between",
    )
    gap: float = setting(
        0.2,
        unit="s",
        limits=(0.01, 60.0),
        reason="without an image; limbs are guessed for as long, fast ones by 10 deg",
    )
    long_gap: float = setting(
        1.0, unit="s", limits=(0.05, 600.0), reason="without an image: what a limb does by then is anybody's guess"
    )
    lost: float = setting(0.02, limits=(0.0, 1.0), reason="share of images missing; a card or disk that is too slow")
    clock: float = setting(
        0.5,
        unit="s",
        limits=(0.001, 3600.0),
        reason="between a camera's stamps and when they were recorded, beyond that of the others: its clock was not "
        "set; what is left of smaller errors is found by the motion of the body",
    )
    drift: float = setting(
        300.0, unit="ppm", limits=(10.0, 1e5), reason="clocks of cameras drift by 10 to 100; more is a stamp that jumps"
    )
    dark: float = setting(
        30.0, limits=(0.0, 255.0), reason="middle grey level; below it noise hides what landmarks are known by"
    )
    black: float = setting(8.0, limits=(0.0, 255.0), reason="middle grey level of a lens that is covered, or of night")
    saturated: float = setting(
        0.2, limits=(0.0, 1.0), reason="share of a picture that is white: nothing can be recognised there"
    )
    flicker: float = setting(
        3.0, limits=(1.0, 100.0), reason="times that the brightest image is brighter than the darkest: exposure hunts"
    )
    blur: float = setting(
        0.55,
        limits=(0.0, 1.0),
        reason="perceptual blur (Crete 2007) of an image in its worst direction: sharp ones have 0.34, blurred by 5 px "
        "0.49, by 8 px 0.59, from where on features err by centimetres",
    )
    blurred: float = setting(
        0.25, limits=(0.0, 1.0), reason="share of images that are blurred; three times that is red"
    )
    features: int = setting(
        150, limits=(1, 20000), reason="an image has; a quarter of them are landmarks, and a hundred hold a pose well"
    )
    few_features: int = setting(
        40, limits=(1, 20000), reason="an image has, below which the dozen landmarks of a pose are not to be hoped for"
    )
    registered: float = setting(
        0.6,
        limits=(0.0, 1.0),
        reason="share of single images that find themselves; where they follow each other more do, so less is no loss "
        "yet",
    )
    hardly_registered: float = setting(
        0.2, limits=(0.0, 1.0), reason="share below which a camera is lost for most of the time"
    )
    exercise: float = setting(
        40.0,
        unit="deg",
        limits=(1.0, 180.0),
        reason="by which a joint should turn; its place is known the better the farther",
    )
    second_axis: float = setting(
        15.0,
        unit="deg",
        limits=(0.0, 180.0),
        reason="by which a joint that is no hinge should turn about another axis too; one axis alone leaves its place "
        "along that open",
    )


@dataclass(frozen=True)
class DoctorGroups(SettingsGroups):
    """Settings of the doctor, and of the registration of single images."""

    doctor: DoctorSettings = DoctorSettings()
    registrar: RegistrarSettings = RegistrarSettings()
    matching: MatchingSettings = MatchingSettings()
    absolute_pose: AbsolutePoseSettings = AbsolutePoseSettings()
    pose_fit: PoseFitSettings = PoseFitSettings()
