"""Offset and drift of every camera's clock: a Kalman filter over windows of evidence."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.timing.clock_state import ClockSettings

Array = NDArray[np.float64]

_HELD_S = 1e-9
"""Sigma of the reference: all clocks together may be off by anything, and nobody would know."""

_TRIGGERED_DRIFT = 1e-3
"""Times less than a clock of its own does one drift that triggers with the others."""


class ClockFilter:
    """Clocks of C cameras; the first is the reference, as long as it does not jump.

    Args:
        settings: what is believed at the start.

    Attributes:
        offsets: (C) by how much the clocks are ahead at the time of the filter [s].
        drifts: (C) by which that grows per second.
        reference: row of the camera whose clock is the body's.
    """

    def __init__(self, settings: ClockSettings) -> None:
        self._settings = settings
        self.offsets, self.drifts = np.zeros(0), np.zeros(0)
        self._covariance = np.zeros((0, 0))
        self.reference = 0

    def grow(self, triggered: bool) -> None:
        """One more camera, which shares its stamps with the reference's group or does not."""
        count = len(self.offsets)
        sigmas = [self._settings.sigma, self._settings.drift_sigma]
        if triggered:
            sigmas = [self._settings.trigger_sigma, _TRIGGERED_DRIFT * self._settings.drift_sigma]
        if not count:
            sigmas = [_HELD_S, 0.0]
        covariance = np.zeros((2 * count + 2, 2 * count + 2))
        old = [*range(count), *range(count + 1, 2 * count + 1)]
        covariance[np.ix_(old, old)] = self._covariance
        covariance[count, count], covariance[-1, -1] = np.square(sigmas)
        self._covariance = covariance
        self.offsets, self.drifts = np.append(self.offsets, 0.0), np.append(self.drifts, 0.0)

    @property
    def offset_sigmas(self) -> Array:
        """(C) [s]."""
        return np.asarray(np.sqrt(np.diag(self._covariance)[: len(self.offsets)]))

    @property
    def drift_sigmas(self) -> Array:
        """(C) [s/s]."""
        return np.asarray(np.sqrt(np.diag(self._covariance)[len(self.offsets) :]))

    @property
    def prior_information(self) -> Array:
        """(C, C) on the offsets [1/s^2]."""
        count = len(self.offsets)
        return np.asarray(np.linalg.inv(self._covariance[:count, :count] + _HELD_S**2 * np.eye(count)))

    def advance(self, seconds: float) -> None:
        """Time passes."""
        count = len(self.offsets)
        F = np.eye(2 * count)
        F[:count, count:] = seconds * np.eye(count)
        self.offsets = self.offsets + seconds * self.drifts
        self._covariance = F @ self._covariance @ F.T
        walking = np.arange(count, 2 * count)[np.arange(count) != self.reference]
        self._covariance[walking, walking] += seconds * self._settings.drift_walk**2

    def free(self, camera: int) -> None:
        """Forget what is known of one clock: it jumped, or its camera is not triggered after all."""
        if camera == self.reference:
            others = self.offset_sigmas
            others[camera] = np.inf
            self._hold(int(np.argmin(others)))
        for row, sigma in ((camera, self._settings.sigma), (len(self.offsets) + camera, self._settings.drift_sigma)):
            self._covariance[row] = self._covariance[:, row] = 0.0
            self._covariance[row, row] = sigma**2

    def _hold(self, camera: int) -> None:
        """Make another clock the reference: the one that is known."""
        for row in (camera, len(self.offsets) + camera):
            column = self._covariance[:, row]
            if column[row] > 0.0:
                self._covariance = self._covariance - np.outer(column, column) / column[row]
                # Nothing of it is left: not even what rounding leaves, which may be negative.
                self._covariance[row] = self._covariance[:, row] = 0.0
        self.reference = camera
        self._covariance[camera, camera] = _HELD_S**2

    def surprises(self, delays: Array, information: Array) -> tuple[Array, Array]:
        """What a window alone says of each clock beyond what was believed (C) [s], and how many sigmas off (C) that is.

        Args:
            delays: (C) that the clocks are ahead of what was believed, the prior included [s].
            information: (C, C) of the window without the prior [1/s^2].
        """
        prior, posterior = self._learned(information)
        before, after = np.diag(prior), np.diag(posterior)
        told = np.maximum(before - after, 1e-6 * before)
        # One measurement of variance v turns the variance b into a = b v / (b + v), and moves by b / (b + v) of itself.
        alone = delays * before / told
        return np.asarray(alone), np.asarray(np.abs(alone) / np.sqrt(before * after / told + before))

    def learn(self, delays: Array, information: Array) -> None:
        """Add a window's evidence.

        Args:
            delays: (C) that the clocks are ahead of what was believed, the prior included [s].
            information: (C, C) of the window without the prior [1/s^2].
        """
        count = len(delays)
        prior, posterior = self._learned(information)
        gain = self._covariance[:, :count] @ np.linalg.inv(prior)
        self.offsets = self.offsets + (gain @ delays)[:count]
        self.drifts = self.drifts + (gain @ delays)[count:]
        covariance = self._covariance + gain @ (posterior - prior) @ gain.T
        self._covariance = 0.5 * (covariance + covariance.T)

    def _learned(self, information: Array) -> tuple[Array, Array]:
        """Covariances (C, C) of the offsets before and after a window [s^2]."""
        count = len(self.offsets)
        prior = self._covariance[:count, :count] + _HELD_S**2 * np.eye(count)
        return prior, np.asarray(np.linalg.inv(np.linalg.inv(prior) + information), np.float64)
