"""When the map grows, and what becomes a landmark of it."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


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
