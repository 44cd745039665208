"""What is believed of the cameras' clocks before their images are looked at."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class ClockSettings:
    """How far clocks may be off, and when they are known."""

    sigma: float = setting(
        0.02,
        unit="s",
        limits=(1e-6, 1.0),
        reason="how far a clock that nothing triggers with the others may be off: sound is some milliseconds off, and "
        "pictures may lag a frame behind it",
    )
    trigger_sigma: float = setting(
        0.0002, unit="s", limits=(1e-6, 0.1), reason="the same of cameras whose stamps are those of the others"
    )
    settled: float = setting(
        0.001, unit="s", limits=(1e-6, 0.1), reason="clocks that moved by less are not used to find everything anew"
    )
    turns: int = setting(3, limits=(1, 10), reason="how often a body is found anew with clocks that moved")
