"""Settings of the smoother: the length of its window, and how it is solved."""

from dataclasses import dataclass
from typing import Final

from bodycam_ros.errors import SettingsError
from bodycam_ros.settings import setting

OFFLINE: Final = "offline"
"""The delay of a recording that is solved as a whole."""

_FORWARD_DELAY = 4  # frames after which the forward pass lets an instant go to where the whole recording waits


@dataclass(frozen=True)
class SmootherSettings:
    """Length of the window, and how it is solved."""

    output_delay: int | str = setting(
        4,
        unit="frames",
        limits=(0, 60),
        words=(OFFLINE,),
        reason="a frame is published when this many followed, so that a blink of a camera is bridged from both sides; "
        "'offline' solves the whole recording together, and is for recordings only",
    )
    block: float = setting(
        15.0,
        unit="s",
        limits=(1.0, 600.0),
        reason="offline, so much of a recording is solved together: memory for an hour of it at once is nobody's",
    )
    overlap: float = setting(
        1.5,
        unit="s",
        limits=(0.1, 60.0),
        reason="offline, so much of what follows a block is solved with it, and again with the next; what comes later "
        "changes nothing",
    )
    max_pause: float = setting(
        1.0,
        unit="s",
        limits=(0.05, 10.0),
        reason="a silence of all cameras up to this long is bridged; after a longer one the body begins anew",
    )
    blind_hold: float = setting(
        10.0,
        unit="s",
        limits=(0.0, 60.0),
        reason="offline, what is published waits this long at most for a blind limb to be seen again, so that its "
        "rotation can be averaged from both sides; 0 never waits, as live",
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
                f"smoother.output_delay is '{OFFLINE}', which solves a recording as a whole once it is over; live, "
                "give the number of frames (0 to 60) that a state waits for later ones"
            )

    @property
    def frames_behind(self) -> int:
        """How many frames follow an instant before the window lets it go."""
        return _FORWARD_DELAY if isinstance(self.output_delay, str) else self.output_delay
