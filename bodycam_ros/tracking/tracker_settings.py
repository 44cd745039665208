"""How many tracks a camera has, how old they grow, and when new ones are looked for."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class TrackerSettings:
    """How many tracks, how old they may grow, and when to look for new ones."""

    keyframe_interval: int = setting(
        30,
        unit="frames",
        limits=(1, 300),
        reason="SIFT costs as much as ten frames of tracking, and a camera that hardly turns keeps its tracks",
    )
    keyframe_survival: float = setting(
        0.55,
        limits=(0.0, 1.0),
        reason="a keyframe comes early when fewer of the last keyframe's tracks than this share are left",
    )
    keyframe_rotation: float = setting(
        0.6,
        unit="rad",
        limits=(0.01, 6.3),
        reason="a keyframe comes early once the camera turned this far: flow does not follow turning patches exactly",
    )
    min_keyframe_gap: float = setting(
        0.09,
        unit="s",
        limits=(0.0, 5.0),
        reason="a camera that sees nothing must not pay for a keyframe on every frame; at ten images a second one that "
        "turns quickly needs just that",
    )
    lost_keyframe_gap: float = setting(
        0.18,
        unit="s",
        limits=(0.0, 5.0),
        reason="a camera that the registration has lost is described again so soon: the next image may show more",
    )
    starved_survival: float = setting(
        0.25,
        limits=(0.0, 1.0),
        reason="keyframe at once, however soon after the last, when fewer than this share of its tracks survive",
    )
    max_track_age: float = setting(
        1.5,
        unit="s",
        limits=(0.05, 60.0),
        reason="flow drifts by some hundredths of a pixel a frame; an old track ends at the next keyframe",
    )
    min_distance_px: float = setting(
        3.0,
        unit="px",
        limits=(1.0, 50.0),
        reason="an old track this near to a fresh keypoint gives way to it, and of two fresh ones the weaker",
    )
    max_view_angle_deg: float = setting(
        86.0,
        unit="deg",
        limits=(20.0, 110.0),
        reason="fisheye pictures end near 90 degrees, and their rim is no feature of the world",
    )
