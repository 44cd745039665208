"""Offset and drift of every camera's clock: a Kalman filter over windows of evidence."""

from collections.abc import Callable, Collection
from typing import NamedTuple

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.timing.clock_evidence import ClockEvidence
from bodycam_ros.timing.clock_state import TRIGGER_SIGMA_S

_REFERENCE_S = 1e-9  # sigma of the reference: a common offset of all clocks is not observable
DRIFT_SIGMA = 1e-4  # quartz is good to 20 ppm, to 50 when it is cold; 100 must not be held back
_TRIGGER_DRIFT_SIGMA = 1e-7  # of a camera that triggers with the others
_DRIFT_WALK = 4e-8  # [1/s per sqrt(s)] 1 ppm in ten minutes as cameras warm
_SETTLED_S = 0.001  # delays that change by less need no further turn of a window
_MOST_TURNS = 6  # of a window with clocks that moved; each leaves a fifth of the error
_FAR_SIGMAS = 60.0  # median distance of a camera in a wrong place; of good ones 1 to 5
_OFF_S, _OFF_SIGMAS = 0.006, 5.0  # a clock that is off by more, and by five sigmas, is reset; three are not rare

Linearise = Callable[[dict[str, float], Collection[str]], ClockEvidence | None]


class ClockFilter:
    """Clocks of C cameras, relative to the first.

    Args:
        sigma: of an unknown clock offset [s].

    Attributes:
        cameras: (C) names.
        offsets: (C) by how much the clocks are ahead at the time of the filter [s].
        drifts: (C) growth of the offsets per second.
    """

    def __init__(self, sigma: float) -> None:
        self._sigma = sigma
        self.cameras: list[str] = []
        self.offsets, self.drifts = np.zeros((2, 0))
        self._covariance = np.zeros((0, 0))

    def add_camera(self, camera: str, triggered: bool) -> None:
        """One more camera, which shares its stamps with the reference's group or does not."""
        count = len(self.cameras)
        sigmas = (TRIGGER_SIGMA_S, _TRIGGER_DRIFT_SIGMA) if triggered else (self._sigma, DRIFT_SIGMA)
        # Offsets come before drifts.
        for row, sigma in zip((count, 2 * count + 1), sigmas if count else (_REFERENCE_S, 0.0), strict=True):
            self._covariance = np.insert(np.insert(self._covariance, row, 0.0, axis=0), row, 0.0, axis=1)
            self._covariance[row, row] = sigma**2
        self.offsets, self.drifts = np.append(self.offsets, 0.0), np.append(self.drifts, 0.0)
        self.cameras.append(camera)

    @property
    def sigmas(self) -> tuple[Array, Array]:
        """(C) of the offsets [s] and (C) of the drifts [s/s]."""
        offsets, drifts = np.split(np.sqrt(np.diag(self._covariance)), 2)
        return offsets, drifts

    def advance(self, seconds: float) -> None:
        """Predict by some time [s]; negative where a recording is played again."""
        F = np.kron([[1.0, seconds], [0.0, 1.0]], np.eye(len(self.cameras)))
        self.offsets = self.offsets + seconds * self.drifts
        walk = np.full(len(self.cameras), abs(seconds) * _DRIFT_WALK**2)
        walk[self.reference] = 0.0
        self._covariance = F @ self._covariance @ F.T + np.diag(np.append(0.0 * walk, walk))

    @property
    def reference(self) -> int:
        """Row of the camera whose clock is the body's: of the first or, after that was reset, of the best known."""
        return int(np.argmin(self.sigmas[0]))

    def free(self, row: int) -> None:
        """Reset one clock to unknown: it jumped, or its camera is not triggered after all."""
        self._covariance = self._covariance.copy()
        for own, sigma in ((row, self._sigma), (len(self.cameras) + row, DRIFT_SIGMA)):
            self._covariance[own] = self._covariance[:, own] = 0.0
            self._covariance[own, own] = sigma**2

    def update(self, linearise: Linearise) -> list[str]:
        """Add a window's evidence.

        A camera that is far from where the body has it at every delay of its clock, as one that is registered in a
        wrong place, is no evidence of its clock and is left out of the window.

        Args:
            linearise: evidence of the delays beyond offsets of the cameras, some of them left out, or None.

        Returns:
            The cameras whose clocks contradicted their estimates, and were reset: their estimates were wrong, or the
            reference's, if most are contradicted.
        """
        before, left_out = self._covariance, set[str]()
        while True:
            fit, reset = self._fit(linearise, left_out), list[int]()
            if fit is not None and (reset := self._contradicted(fit)):
                for row in reset:
                    self.free(row)
                fit = self._fit(linearise, left_out)
            if fit is None:
                return []
            farthest = int(np.argmax(fit.distances))
            if fit.distances[farthest] < _FAR_SIGMAS:
                break
            left_out.add(self.cameras[farthest])
            self._covariance = before
        gain = self._covariance[:, : len(self.cameras)] @ np.linalg.inv(fit.prior)
        self.offsets, self.drifts = np.split(np.append(self.offsets, self.drifts) + gain @ fit.delays, 2)
        covariance = self._covariance + gain @ (fit.posterior - fit.prior) @ gain.T
        self._covariance = 0.5 * (covariance + covariance.T)
        return [self.cameras[row] for row in reset]

    def _fit(self, linearise: Linearise, left_out: Collection[str]) -> "_Fit | None":
        count = len(self.cameras)
        prior = self._covariance[:count, :count] + _REFERENCE_S**2 * np.eye(count)
        information, delays = np.linalg.inv(prior), np.zeros(count)
        for _ in range(_MOST_TURNS):
            offsets = dict(zip(self.cameras, (self.offsets + delays).tolist(), strict=True))
            if (evidence := linearise(offsets, left_out)) is None:
                return None
            posterior, distances = np.linalg.inv(evidence.hessian + information), evidence.distances
            step = -posterior @ (evidence.gradient + information @ delays)
            delays = delays + step
            if np.abs(step).max() < _SETTLED_S:
                break
        return _Fit(delays, prior, posterior, distances)

    def _contradicted(self, fit: "_Fit") -> list[int]:
        """Rows of the clocks that are not what they were estimated to be."""
        # One measurement of variance v turns the variance b into a = b v / (b + v), and moves by b / (b + v) of itself.
        before, after = np.diag(fit.prior), np.diag(fit.posterior)
        gained = np.maximum(before - after, 1e-6 * before)
        alone = np.abs(fit.delays) * before / gained
        off = np.flatnonzero((alone > _OFF_S) & (alone > _OFF_SIGMAS * np.sqrt(before * after / gained + before)))
        return off.tolist() if 2 * len(off) <= len(self.cameras) else [self.reference]


class _Fit(NamedTuple):
    """Delays (C) of a window, their covariance (C, C) before it and after it, and the cameras' distances (C)."""

    delays: Array
    prior: Array
    posterior: Array
    distances: Array
