"""Settings of the smoother: the length of its window, and how it is solved."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class SmootherSettings:
    """Length of the window, and how it is solved."""

    window: float = setting(
        0.5, unit="s", limits=(0.05, 10.0), reason="beyond half a second the past no longer changes an estimate"
    )
    output_delay: int = setting(
        4,
        unit="frames",
        limits=(0, 60),
        reason="a frame is published when this many followed, so that a blink of a camera is bridged from both sides",
    )
    incremental: bool = setting(
        True, reason="iSAM2; false solves the whole window by Levenberg-Marquardt at every frame, slower, as a check"
    )
    max_pause: float = setting(
        1.0,
        unit="s",
        limits=(0.05, 10.0),
        reason="a silence of all cameras up to this long is bridged; after a longer one the body begins anew",
    )
    blind_hold: float = setting(
        10.0,
        unit="s",
        limits=(0.0, 60.0),
        reason="offline, what is published waits this long at most for a blind limb to be seen again, so that its "
        "rotation can be averaged from both sides; 0 never waits, as live",
    )
    extra_updates: int = setting(
        0,
        limits=(0, 10),
        reason="Gauss-Newton steps after the one that adds the frame; the next frame brings one anyway",
    )
    relinearize_threshold: float = setting(
        0.005, unit="rad, m", limits=(0.0, 1.0), reason="change of a pose beyond which its factors are linearised anew"
    )
    outlier_sigmas: float = setting(
        4.0,
        limits=(1.0, 100.0),
        reason="a registration farther than this from the body counts less and less (Cauchy): a "
        "wrong one must not bend the limb",
    )
