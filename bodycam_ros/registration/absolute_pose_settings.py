"""Settings of the absolute registration; apart from it, because it loads pycolmap."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class AbsolutePoseSettings:
    """RANSAC of the absolute registration."""

    ransac_px: float = setting(
        3.0, unit="px", limits=(0.5, 20.0), reason="inlier threshold; the fit that follows tightens it"
    )
    ransac_min_inliers: int = setting(12, limits=(4, 500), reason="chance agreement of wrong matches stays below this")
    ransac_max_trials: int = setting(5000, limits=(100, 1_000_000), reason="finds 4 good matches among 85 % outliers")
    ransac_seed: int = setting(
        7, limits=(0, 2**31 - 1), reason="fixed, so that two runs over one recording are identical"
    )
