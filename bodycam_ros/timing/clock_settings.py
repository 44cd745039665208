"""What is believed of the cameras' clocks, and how they are learned."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class ClockSettings:
    """Clocks of cameras that were started by hand."""

    rate: float = setting(
        0.0,
        unit="Hz",
        limits=(0.0, 480.0),
        reason="instants of the body per second; 0: those that most cameras share, or else as many as they have images",
    )
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
    drift_sigma: float = setting(
        1e-4,
        limits=(0.0, 0.01),
        reason="seconds per second; quartz is good to 20 ppm, to 50 when it is cold, and 100 must not be held back",
    )
    drift_walk: float = setting(
        4e-8, limits=(0.0, 1e-4), reason="by how much a drift changes in a second: 1 ppm in ten minutes as cameras warm"
    )
    window: float = setting(
        4.0,
        unit="s",
        limits=(0.5, 60.0),
        reason="clocks are asked once in this time: 2 s left 2.7 ms where 4 s left 1.8; a jump shows in any case",
    )
    lookahead: float = setting(
        8.0,
        unit="s",
        limits=(0.0, 600.0),
        reason="offline, how far ahead of the body clocks are learned; four seconds of walking tell them to 2 or 3 ms",
    )
    instants: float = setting(
        10.0,
        unit="Hz",
        limits=(1.0, 100.0),
        reason="instants of a window at which cameras are compared; neighbours share their errors",
    )
    instants_alike: float = setting(
        6.0, limits=(1.0, 100.0), reason="neighbouring instants that say the same, because tracks keep their errors"
    )
    jump: float = setting(
        0.006,
        unit="s",
        limits=(0.0005, 10.0),
        reason="set by less, a clock is not said to have jumped; off by more and by five sigmas, it is learned anew",
    )
    max_gap: float = setting(
        0.12,
        unit="s",
        limits=(0.01, 1.0),
        reason="a camera's pose is read off its path between two images this close; beyond, limbs do what they like",
    )
    settled: float = setting(
        0.001, unit="s", limits=(1e-6, 0.1), reason="clocks that moved by less are not used to find a body anew"
    )
    turns: int = setting(3, limits=(1, 10), reason="how often a body is found anew with clocks that moved")
