"""The verdict while it is solved: of the last seconds, so that it ends some time after its cause."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.verdict.agreement_log import AgreementLog
from bodycam_ros.verdict.judge import judge
from bodycam_ros.verdict.verdict import Verdict
from bodycam_ros.verdict.verdict_settings import VerdictSettings


class LiveVerdict:
    """Hears what the solver hears and says, and judges now and then.

    Args:
        body: that is solved.
        cameras: models by name.
        settings: thresholds, how far it looks back, and how often it judges.
        pose_fit: which landmarks a registration took for its own; they tell of the lens.
    """

    def __init__(
        self, body: BodyModel, cameras: Mapping[str, CameraModel], settings: VerdictSettings, pose_fit: PoseFitSettings
    ) -> None:
        self._body = body
        self._settings = settings
        self._log = AgreementLog(body, cameras, settings, pose_fit.inlier_px, settings.span)
        self._latest = Verdict.of(())
        self._judged_ns: int | None = None
        self._solved_ns = 0

    def add_registration(self, matches: LandmarkMatches) -> None:
        """Add what one image of a camera said."""
        self._log.add_registration(matches)

    def add_state(self, stamp_ns: int, world_T_segment: NDArray[np.float64]) -> None:
        """Add a solved instant: poses (S, 4, 4) of all segments of the body."""
        self._log.add_state(stamp_ns, world_T_segment)
        self._solved_ns = stamp_ns
        if self._judged_ns is None or stamp_ns < self._judged_ns:
            # It needs some time before there is anything to judge.
            self._judged_ns, self._latest = stamp_ns, Verdict.of(())

    def verdict(self) -> Verdict:
        """The latest; made anew when ``interval`` has passed since, in time of the recording."""
        if self._judged_ns is not None and self._solved_ns - self._judged_ns >= 1e9 * self._settings.interval:
            self._latest = judge(self._log.agreement(), self._body, self._settings)
            self._judged_ns = self._solved_ns
        return self._latest
