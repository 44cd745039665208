"""Settings of the window; apart from it, for what reads settings need not load gtsam."""

from dataclasses import dataclass
from typing import Final

from bodycam_ros.errors import SettingsError
from bodycam_ros.settings import setting

OFFLINE: Final = "offline"
"""The delay of a recording that is solved as a whole."""


@dataclass(frozen=True)
class EstimatorSettings:
    """Length of the window, and how it is solved."""

    output_delay: int | str = setting(
        4,
        unit="frames",
        limits=(0, 60),
        words=(OFFLINE,),
        reason="number of later frames that are solved before a frame is published, so that a short gap of a camera is "
        "interpolated from both sides; raise it for longer gaps, at the cost of delay. 'offline' solves the whole "
        "recording together, for recordings only",
    )
    max_pause: float = setting(
        1.0,
        unit="s",
        limits=(0.05, 10.0),
        reason="a gap without images up to this long is filled; after a longer one the body is initialised again",
    )

    @property
    def whole_recording(self) -> bool:
        """Whether the recording is solved as a whole."""
        return self.output_delay == OFFLINE

    def check_live(self) -> None:
        """Refuse what only a recording can have.

        Raises:
            SettingsError: the whole recording is asked for.
        """
        if self.whole_recording:
            raise SettingsError(
                f"estimator.output_delay is '{OFFLINE}', which solves a recording as a whole once it is over; live, "
                "give the number of frames (0 to 60) that a state waits for later ones"
            )
