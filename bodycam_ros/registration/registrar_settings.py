"""Settings of the registrar."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class RegistrarSettings:
    """When a camera counts as registered, and when a track loses its landmark."""

    min_inliers: int = setting(
        12,
        limits=(4, 500),
        reason="fewer landmarks in agreement are no registration (the paper asks 50, with twice as many pixels)",
        live=True,
    )
    max_sigma: float = setting(
        0.1,
        unit="m",
        limits=(0.001, 10.0),
        reason="of a pose's position, by its landmarks: a dozen in a corner of the picture let it drift by metres, and "
        "it takes their successors along",
        live=True,
    )
    max_strikes: int = setting(
        2,
        unit="frames",
        limits=(1, 30),
        reason="a track whose landmark disagrees on this many frames in a row loses it",
        live=True,
    )
    max_predicted_frames: int = setting(
        15,
        unit="frames",
        limits=(0, 300),
        reason="how long a lost camera's pose is carried on by its rotation before the whole map is searched",
        live=True,
    )
