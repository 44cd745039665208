"""Starts and drifts of clocks from sounds that several cameras heard: one robust linear least squares.

A camera c that hears the sound e at its media time a has ``start_c + (1 + drift_c) a = t_e + travel``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.ingest.sound_settings import ClockSettings

Array = NDArray[np.float64]

SOUND_SPEED = 343.0
"""Of air at 20 degrees [m/s]; at -10 degrees 325."""

_ROUNDS = 30
_CAUCHY = 2.4  # sigmas: the usual constant, 95 % efficient where nothing is wrong


@dataclass(frozen=True, eq=False)
class HeardSounds:
    """N times that one of E sounds was heard by one of C cameras.

    Attributes:
        sound: (N,) number of the sound.
        camera: (N,) number of the camera.
        media_s: (N,) media time [s].
        sigma_s: (N,) standard deviation of it without the travel [s].
    """

    sound: NDArray[np.int64]
    camera: NDArray[np.int64]
    media_s: Array
    sigma_s: Array


@dataclass(frozen=True, eq=False)
class Clocks:
    """What the fit says of C cameras and E sounds.

    Attributes:
        starts: (C,) [s].
        drifts: (C,).
        start_sigmas: (C,) [s], the travel from sounds to cameras and to the reference included.
        drift_sigmas: (C,).
        sounds_s: (E,) times of the recording [s].
        residuals_s: (N,) by how much each was heard later than the fit says [s].
    """

    starts: Array
    drifts: Array
    start_sigmas: Array
    drift_sigmas: Array
    sounds_s: Array
    residuals_s: Array


def fit_clocks(heard: HeardSounds, reference: int, first_starts: Array, settings: ClockSettings) -> Clocks:
    """Fit all clocks to the time of the reference camera.

    Args:
        heard: connected: every camera shares sounds with the reference, if only through others.
        reference: number of the camera that has start 0 and drift 0.
        first_starts: (C,) where cameras start, to some milliseconds [s].
        settings: of the error budget.
    """
    cameras, sounds = len(first_starts), int(heard.sound.max()) + 1
    first_starts = first_starts - first_starts[reference]
    times = first_starts[heard.camera] + heard.media_s
    about = np.bincount(heard.sound, times, sounds) / np.maximum(np.bincount(heard.sound, minlength=sounds), 1)
    crowd = np.array([(np.abs(about - at) <= settings.same_posture).sum() for at in about])
    moved_s = settings.moved_sigma / SOUND_SPEED
    sigma = np.sqrt(heard.sigma_s**2 + moved_s**2 * crowd[heard.sound])

    rows = np.arange(len(sigma))
    design = np.zeros((len(sigma), 2 * cameras + sounds))
    design[rows, heard.camera] = 1.0
    design[rows, cameras + heard.camera] = heard.media_s
    design[rows, 2 * cameras + heard.sound] = -1.0
    prior = np.zeros(2 * cameras + sounds)
    prior[cameras : 2 * cameras] = settings.drift_sigma**-2.0
    free = np.ones(len(prior), dtype=bool)
    free[[reference, cameras + reference]] = False
    offset = -heard.media_s - first_starts[heard.camera] + about[heard.sound]

    # Of what is fitted the sounds' times are relative to ``about``, the starts to ``first_starts``: small numbers.
    weight, solution, covariance = sigma**-2.0, np.zeros(len(prior)), np.zeros((0, 0))
    for _ in range(_ROUNDS):
        normal = (design * weight[:, None]).T @ design + np.diag(prior)
        covariance = np.linalg.pinv(normal[np.ix_(free, free)], hermitian=True)
        solution[free] = covariance @ ((design * weight[:, None]).T @ offset)[free]
        residuals = design @ solution - offset
        weight = sigma**-2.0 / (1.0 + (residuals / (_CAUCHY * sigma)) ** 2)
    variance = np.zeros(len(prior))
    variance[free] = np.diag(covariance)
    ways_s = np.sqrt(2.0) * settings.distance_sigma / SOUND_SPEED * (np.arange(cameras) != reference)
    return Clocks(
        first_starts + solution[:cameras],
        solution[cameras : 2 * cameras],
        np.sqrt(variance[:cameras] + ways_s**2),
        np.sqrt(variance[cameras : 2 * cameras]),
        about + solution[2 * cameras :],
        residuals,
    )
