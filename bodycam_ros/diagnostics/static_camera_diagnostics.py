"""Which segments a static camera has observed between two reports."""

from collections import Counter
from collections.abc import Collection, Sequence

import numpy as np

from bodycam_ros.geometry import Array


class StaticCameraDiagnostics:
    """Counts the segments that one static camera observes."""

    def __init__(self) -> None:
        self._observed, self._confidence = Counter[str](), 0.0

    def add(self, observed: Collection[str], segments: Sequence[str], confidence: Array) -> None:
        """Count one image.

        Args:
            observed: names of the segments.
            segments: (S) names of all.
            confidence: (S,) 0 to 1.
        """
        self._observed.update(observed)
        self._confidence += float(np.sum(confidence[[segments.index(name) for name in observed]]))

    def report(self, images: int, segments: Sequence[str]) -> tuple[dict[str, object], str]:
        """Figures since the last report, and what is wrong; an empty text if nothing is.

        Args:
            images: number of images since then.
            segments: names of all.
        """
        observed, confidence = self._observed, self._confidence
        self._observed, self._confidence = Counter(), 0.0
        total = observed.total()
        values: dict[str, object] = {
            "segments per image": round(total / max(1, images), 1),
            "confidence": round(confidence / total, 2) if total else "none",
            "unobserved": ", ".join(segment for segment in segments if not observed[segment]) or "none",
        }
        return (
            values,
            "" if total else "no segment of the body is observed; check that the body is in front of the camera",
        )
