"""Offset and drift of every camera's clock: a Kalman filter over windows of evidence."""

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.timing.clock_state import TRIGGER_SIGMA_S

_REFERENCE_S = 1e-9  # sigma of the reference: a common offset of all clocks is not observable
DRIFT_SIGMA = 1e-4  # quartz is good to 20 ppm, to 50 when it is cold; 100 must not be held back
_TRIGGER_DRIFT_SIGMA = 1e-7  # of a camera that triggers with the others
_DRIFT_WALK = 4e-8  # [1/s per sqrt(s)] 1 ppm in ten minutes as cameras warm


class ClockFilter:
    """Clocks of C cameras; the first is the reference, as long as it does not jump.

    Args:
        sigma: of an unknown clock offset [s].

    Attributes:
        offsets: (C) by how much the clocks are ahead at the time of the filter [s].
        drifts: (C) growth of the offsets per second.
        reference: row of the camera whose clock is the body's.
    """

    def __init__(self, sigma: float) -> None:
        self._sigma = sigma
        self.offsets, self.drifts = np.zeros(0), np.zeros(0)
        self._covariance = np.zeros((0, 0))
        self.reference = 0

    def add_camera(self, triggered: bool) -> None:
        """One more camera, which shares its stamps with the reference's group or does not."""
        count = len(self.offsets)
        sigmas = (TRIGGER_SIGMA_S, _TRIGGER_DRIFT_SIGMA) if triggered else (self._sigma, DRIFT_SIGMA)
        old = [*range(count), *range(count + 1, 2 * count + 1)]
        covariance = np.zeros((2 * count + 2, 2 * count + 2))
        covariance[np.ix_(old, old)] = self._covariance
        covariance[count, count], covariance[-1, -1] = np.square(sigmas if count else (_REFERENCE_S, 0.0))
        self._covariance = covariance
        self.offsets, self.drifts = np.append(self.offsets, 0.0), np.append(self.drifts, 0.0)

    @property
    def sigmas(self) -> tuple[Array, Array]:
        """(C) of the offsets [s] and (C) of the drifts [s/s]."""
        offsets, drifts = np.split(np.sqrt(np.diag(self._covariance)), 2)
        return offsets, drifts

    @property
    def prior_information(self) -> Array:
        """(C, C) on the offsets [1/s^2]."""
        return np.asarray(np.linalg.inv(self._prior))

    @property
    def _prior(self) -> Array:
        count = len(self.offsets)
        return self._covariance[:count, :count] + _REFERENCE_S**2 * np.eye(count)

    def advance(self, seconds: float) -> None:
        """Predict by some time [s]; negative where a recording is played again."""
        count = len(self.offsets)
        F = np.eye(2 * count)
        F[:count, count:] = seconds * np.eye(count)
        self.offsets = self.offsets + seconds * self.drifts
        self._covariance = F @ self._covariance @ F.T
        walking = np.arange(count, 2 * count)[np.arange(count) != self.reference]
        self._covariance[walking, walking] += abs(seconds) * _DRIFT_WALK**2

    def free(self, camera: int) -> None:
        """Reset one clock to unknown: it jumped, or its camera is not triggered after all."""
        count = len(self.offsets)
        if camera == self.reference:
            others = self.sigmas[0]
            others[camera] = np.inf
            self._make_reference(int(np.argmin(others)))
        for row, sigma in ((camera, self._sigma), (count + camera, DRIFT_SIGMA)):
            self._covariance[row] = self._covariance[:, row] = 0.0
            self._covariance[row, row] = sigma**2

    def _make_reference(self, camera: int) -> None:
        for row in (camera, len(self.offsets) + camera):
            column = self._covariance[:, row]
            if column[row] > 0.0:
                self._covariance = self._covariance - np.outer(column, column) / column[row]
                # Exactly zero: rounding may leave a negative variance.
                self._covariance[row] = self._covariance[:, row] = 0.0
        self.reference = camera
        self._covariance[camera, camera] = _REFERENCE_S**2

    def innovations(self, delays: Array, information: Array) -> tuple[Array, Array]:
        """What a window alone measures of each clock beyond the prediction (C) [s], and how many sigmas that is (C).

        Args:
            delays: (C) that the clocks are ahead of the prediction, the prior included [s].
            information: (C, C) of the window without the prior [1/s^2].
        """
        before, after = np.diag(self._prior), np.diag(self._posterior(information))
        gained = np.maximum(before - after, 1e-6 * before)
        # One measurement of variance v turns the variance b into a = b v / (b + v), and moves by b / (b + v) of itself.
        alone = delays * before / gained
        return np.asarray(alone), np.asarray(np.abs(alone) / np.sqrt(before * after / gained + before))

    def update(self, delays: Array, information: Array) -> None:
        """Add a window's evidence, as in ``innovations``."""
        count, prior = len(delays), self._prior
        gain = self._covariance[:, :count] @ np.linalg.inv(prior)
        step = gain @ delays
        self.offsets, self.drifts = self.offsets + step[:count], self.drifts + step[count:]
        covariance = self._covariance + gain @ (self._posterior(information) - prior) @ gain.T
        self._covariance = 0.5 * (covariance + covariance.T)

    def _posterior(self, information: Array) -> Array:
        """(C, C) covariance of the offsets after a window [s^2]."""
        return np.asarray(np.linalg.inv(self.prior_information + information), np.float64)
