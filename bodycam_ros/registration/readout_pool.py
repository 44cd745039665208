"""What cameras of one make tell of each other's read-out time.

Cameras whose images are of one size, and whose read-out times agree, are most likely of one make in one mode: then one
that hardly moved is known as well as those that did. One that contradicts them keeps what it found itself.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.readout import Readout
from bodycam_ros.settings import setting

_EXACT_S = 1e-9
"""No read-out time is known better [s]."""

_TURNS = 5
"""Whom the mean of the others takes in and leaves out settles within two or three."""


@dataclass(frozen=True)
class ReadoutSettings:
    """Which cameras share a read-out time, and when it is known well enough."""

    spread: float = setting(
        0.0001,
        unit="s",
        limits=(0.0, 0.01),
        reason="by how much units of one make differ: their clocks count the rows to some ppm, the rest is the lens' "
        "share in the estimate",
    )
    agree: float = setting(
        3.0, unit="sigma", limits=(1.0, 10.0), reason="cameras whose read-out times differ by more are of two makes"
    )
    doubtful: float = setting(
        0.001,
        unit="s",
        limits=(0.0, 0.1),
        reason="a camera whose read-out time is known less well is named: at 2 rad/s it leaves a tenth of a degree",
    )


def pooled(
    readouts: Mapping[str, Readout], sizes: Mapping[str, tuple[int, int]], settings: ReadoutSettings
) -> dict[str, Readout]:
    """The read-out time of every camera when all have been heard; those that are given stay as they are.

    Args:
        readouts: camera -> what it says itself.
        sizes: camera -> width and height of its images [px].
        settings: who agrees with whom.
    """
    found = dict(readouts)
    for size in {sizes[camera] for camera in readouts}:
        alike = [camera for camera in readouts if sizes[camera] == size]
        while alike:
            together = _agreeing([readouts[camera] for camera in alike], settings)
            members = [alike[row] for row in np.flatnonzero(together)]
            for camera in members:
                others = [readouts[other] for other in members if other != camera]
                found[camera] = _with_others(readouts[camera], others, settings)
            alike = [camera for camera in alike if camera not in members]
    return found


def _agreeing(readouts: list[Readout], settings: ReadoutSettings) -> NDArray[np.bool_]:
    """Which of them (N,) have one read-out time: the best known that any value finds; at least one."""
    means = np.array([readout.seconds for readout in readouts])
    variances = np.array([readout.sigma**2 + settings.spread**2 for readout in readouts])
    weights = 1.0 / np.maximum(variances, _EXACT_S**2)
    # A value is tried as it stands: one that is vague agrees with everybody, but few agree with it.
    agree = np.abs(means[:, None] - means) <= settings.agree * np.sqrt(variances)
    members: NDArray[np.bool_] = agree[np.argmax(agree @ weights)]
    for _ in range(_TURNS):
        mean = np.average(means[members], weights=weights[members])
        now = np.abs(means - mean) <= settings.agree * np.sqrt(variances + 1.0 / weights[members].sum())
        if not now.any() or np.array_equal(now, members):
            break
        members = now
    return members


def _with_others(own: Readout, others: list[Readout], settings: ReadoutSettings) -> Readout:
    """What a camera says, and others of its make, together."""
    if own.is_given or not others:
        return own
    means = np.array([readout.seconds for readout in others])
    weights = 1.0 / np.maximum([readout.sigma**2 + settings.spread**2 for readout in others], _EXACT_S**2)
    mean = float(np.average(means, weights=weights))
    # Where they scatter by more than they should, they are known less well than they say (Birge 1932).
    scatter = float(weights @ (means - mean) ** 2) / max(len(others) - 1, 1)
    variance = max(1.0, scatter) / float(weights.sum()) + settings.spread**2
    information = own.sigma**-2 + 1.0 / variance
    return Readout((own.seconds * own.sigma**-2 + mean / variance) / information, math.sqrt(1.0 / information))
