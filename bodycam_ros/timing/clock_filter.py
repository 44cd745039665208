"""Offset and drift of every camera's clock: a Kalman filter over windows of evidence."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.timing.clock_settings import ClockSettings

Array = NDArray[np.float64]

_HELD_S = 1e-9
"""Sigma of the reference: all clocks together may be off by anything, and nobody would know."""


class ClockFilter:
    """Clocks of C cameras; the first is the reference.

    Args:
        triggered: (C) whether a camera shares its stamps with the reference's group.
        settings: what is believed at the start.

    Attributes:
        offsets: (C) by how much the clocks are ahead at the time of the filter [s].
        drifts: (C) by which that grows per second.
    """

    def __init__(self, triggered: Sequence[bool], settings: ClockSettings) -> None:
        self._settings = settings
        count = len(triggered)
        self.offsets, self.drifts = np.zeros(count), np.zeros(count)
        sigmas = np.where(triggered, settings.trigger_sigma, settings.sigma)
        drift_sigmas = np.where(triggered, 1e-3 * settings.drift_sigma, settings.drift_sigma)
        sigmas[0], drift_sigmas[0] = _HELD_S, 0.0
        self._covariance = np.diag(np.concatenate([sigmas, drift_sigmas]) ** 2)

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

    def free(self, camera: int) -> None:
        """Forget what is known of one clock: it jumped, or its camera is not triggered after all."""
        for row, sigma in ((camera, self._settings.sigma), (len(self.offsets) + camera, self._settings.drift_sigma)):
            self._covariance[row] = self._covariance[:, row] = 0.0
            self._covariance[row, row] = sigma**2

    def surprises(self, delays: Array, information: Array) -> Array:
        """(C) sigmas between what a window says of each clock by itself and what is believed [s] [1/s^2].

        Args:
            delays: (C) that the window saw beyond what was believed, the prior included.
            information: (C, C) of the window without the prior.
        """
        count = len(delays)
        prior = self._covariance[:count, :count] + _HELD_S**2 * np.eye(count)
        posterior = np.linalg.inv(np.linalg.inv(prior) + information)
        # The posterior moved by delays; that it should move so far has this variance.
        spread = np.sqrt(np.maximum(np.diag(prior) - np.diag(posterior), _HELD_S**2))
        return np.asarray(np.abs(delays) / spread)

    def learn(self, delays: Array, information: Array) -> None:
        """Add a window's evidence.

        Args:
            delays: (C) that the clocks are ahead of what was believed, the prior included [s].
            information: (C, C) of the window without the prior [1/s^2].
        """
        count = len(delays)
        prior = self._covariance[:count, :count] + _HELD_S**2 * np.eye(count)
        posterior = np.linalg.inv(np.linalg.inv(prior) + information)
        gain = self._covariance[:, :count] @ np.linalg.inv(prior)
        self.offsets = self.offsets + (gain @ delays)[:count]
        self.drifts = self.drifts + (gain @ delays)[count:]
        covariance = self._covariance + gain @ (posterior - prior) @ gain.T
        self._covariance = 0.5 * (covariance + covariance.T)
