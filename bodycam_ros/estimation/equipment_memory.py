"""What was seen of a body holding its equipment, kept for the fit of what lasts: where it stands, and its lengths."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.equipment_fit import EquipmentFit, FittedEquipment, HeldPoints

Array = NDArray[np.float64]

_LEARN_HZ = 10.0
"""Rate of the instants that the fit keeps at first; neighbours say nothing new."""

_MOST = 200
"""Instants that are kept, spread over all that was seen: the time of a fit grows with them."""

_LEARN_EVERY_S = 0.5
"""Of seen motion, before what is unknown of the equipment is fitted anew."""


class SeenInstants:
    """Instants at which the body was seen to hold the equipment."""

    def __init__(self) -> None:
        self._instants: list[tuple[HeldPoints, Array]] = []
        self._kept_ns, self._period_ns, self._new_s = -(1 << 62), 1e9 / _LEARN_HZ, 0.0

    def add(self, stamp_ns: int, held: HeldPoints, poses: Array) -> bool:
        """Keep an instant, if it says something new; whether it is time to fit."""
        if stamp_ns - self._kept_ns < 0.99 * self._period_ns or not any(h[0] for h in held.holds.values()):
            return False
        self._kept_ns = stamp_ns
        self._instants.append((held, poses.copy()))
        self._new_s += 1e-9 * self._period_ns
        if len(self._instants) > _MOST:
            # All that was seen, at half the rate.
            self._instants = self._instants[::2]
            self._period_ns *= 2.0
        if self._new_s < _LEARN_EVERY_S:
            return False
        self._new_s = 0.0
        return True

    def fit(self, fit: EquipmentFit, lengths: Array) -> FittedEquipment:
        """What stands still and the lengths, fitted to all instants that are kept."""
        held = _together(held for held, _ in self._instants)
        start = np.stack([poses for _, poses in self._instants])
        return fit.solve(start, lengths, held)


def _together(instants: Iterable[HeldPoints]) -> HeldPoints:
    all_of = list(instants)
    return HeldPoints(
        {name: np.concatenate([held.points[name] for held in all_of]) for name in all_of[0].points},
        {name: np.concatenate([held.holds[name] for held in all_of]) for name in all_of[0].holds},
    )
