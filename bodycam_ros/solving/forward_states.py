"""What is published of the forward pass alone: silences bridged, and blind limbs mended once they are seen again."""

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.solving.blind_stretches import BlindStretches
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.bridge import bridge
from bodycam_ros.solving.recorded_instants import RecordedInstant


class ForwardStates:
    """States as they leave the window.

    Args:
        body: segments and joints.
        longest_s: how long a state may wait for a blind limb to be seen again; 0 never.
        turn_sigma: of a measured rotation [rad].
        density: (6) of accelerations, for covariances of instants that are bridged.

    Attributes:
        bridged: instants without any image that were filled in.
    """

    def __init__(self, body: BodyModel, longest_s: float, turn_sigma: float, density: NDArray[np.float64]) -> None:
        self._body, self._density = body, density
        self._stretches = BlindStretches(body, longest_s, turn_sigma)
        self._leaving: deque[BodyState] = deque(maxlen=2)
        self.bridged = 0

    def add(self, instant: RecordedInstant, following: Sequence[BodyState]) -> list[BodyState]:
        """The next instant, and the state after it where there is one; returns what need not wait any more."""
        states = []
        if instant.recorded.missing_ns and self._leaving:
            after = [instant.state, *following[:1]]
            bridged = bridge(self._body, list(self._leaving), after, instant.recorded.missing_ns, self._density)
            self.bridged += len(bridged)
            for state in bridged:
                states += self._stretches.add(state, {})
        self._leaving.append(instant.state)
        return states + self._stretches.add(instant.state, instant.recorded.turns)

    def flush(self) -> list[BodyState]:
        """All that is left: nothing follows."""
        return self._stretches.flush()
