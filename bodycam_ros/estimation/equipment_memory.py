"""What was seen of a body holding its equipment, kept for the fit of what lasts: where it stands, and its lengths."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.coupling_settings import CouplingSettings
from bodycam_ros.estimation.equipment_fit import EquipmentFit, FittedEquipment, HeldPoints

Array = NDArray[np.float64]


class SeenInstants:
    """Instants at which the body was seen to hold the equipment.

    Args:
        settings: how many are kept, and how often they are asked.
    """

    def __init__(self, settings: CouplingSettings) -> None:
        self._settings = settings
        self._instants: list[tuple[HeldPoints, Array]] = []
        self._kept_ns, self._period_ns, self._new_s = -(1 << 62), 1e9 / settings.learn_rate, 0.0

    def add(self, stamp_ns: int, held: HeldPoints, poses: Array) -> bool:
        """Keep an instant, if it says something new; whether it is time to fit."""
        if stamp_ns - self._kept_ns < 0.99 * self._period_ns or not any(h[0] for h in held.holds.values()):
            return False
        self._kept_ns = stamp_ns
        self._instants.append((held, poses.copy()))
        self._new_s += 1e-9 * self._period_ns
        if len(self._instants) > self._settings.learn_instants:
            # All that was seen, at half the rate.
            self._instants = self._instants[::2]
            self._period_ns *= 2.0
        if self._new_s < self._settings.learn_every:
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
