"""Whether a registration is where a segment starts, though the body was predicted elsewhere.

The robust kernel lets a registration go that is far from the body. That is right while the body is right. But a limb
that was blind may be anywhere, and a state gone wrong would refuse every camera for ever: then the camera is believed.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.settings import setting
from bodycam_ros.solving.camera_evidence import SegmentPose

_REFUSED = 5.0
"""In units of the kernel's scale: where the Cauchy kernel has taken 96 % of a camera's weight."""


@dataclass(frozen=True)
class TrustSettings:
    """When a camera is believed against the body."""

    blind_after: float = setting(
        0.25,
        unit="s",
        limits=(0.0, 10.0),
        reason="a segment unseen for this long starts where its camera says, not where it was predicted",
    )
    max_refusals: int = setting(
        3,
        unit="frames",
        limits=(1, 100),
        reason="a camera far from the body for this many frames in a row is believed: wrong registrations are rarer",
    )


class CameraTrust:
    """Remembers when segments were seen and which cameras the body refused.

    Args:
        body: segments and mounts.
        outlier_sigmas: scale of the kernel on registrations.
        settings: thresholds.
    """

    def __init__(self, body: BodyModel, outlier_sigmas: float, settings: TrustSettings) -> None:
        self._body = body
        self._refused_sigmas = _REFUSED * outlier_sigmas
        self._settings = settings
        self._seen_ns: dict[str, int] = {}
        self._refusals: Counter[str] = Counter()

    def believed(self, evidence: Mapping[str, SegmentPose], stamp_ns: int) -> dict[int, NDArray[np.float64]]:
        """Row of each segment that starts where its camera says -> that pose (4, 4)."""
        believed = {}
        for camera, seen in evidence.items():
            last_ns = self._seen_ns.get(seen.segment)
            blind = last_ns is None or stamp_ns - last_ns > 1e9 * self._settings.blind_after
            if blind or self._refusals[camera] >= self._settings.max_refusals:
                believed[self._body.segment_index[seen.segment]] = seen.world_T_segment
        self._seen_ns |= {seen.segment: stamp_ns for seen in evidence.values()}
        return believed

    def compare(self, evidence: Mapping[str, SegmentPose], world_T_segment: NDArray[np.float64]) -> None:
        """Count for how many frames in a row each camera has been far from the body that was solved (S, 4, 4)."""
        if not evidence:
            return
        rows = [self._body.segment_index[seen.segment] for seen in evidence.values()]
        measured = np.stack([seen.world_T_segment for seen in evidence.values()])
        errors = log_se3(inverse(world_T_segment[rows]) @ measured)
        whitened = np.linalg.solve(np.stack([seen.covariance for seen in evidence.values()]), errors[:, :, None])
        sigmas = np.sqrt(np.einsum("ni,ni->n", errors, whitened[:, :, 0]))
        for camera, refused in zip(evidence, sigmas > self._refused_sigmas, strict=True):
            self._refusals[camera] = self._refusals[camera] + 1 if refused else 0
