"""All settings that clocks are found by from sound, by group."""

from dataclasses import dataclass

from bodycam_ros.settings import SettingsGroups, setting


@dataclass(frozen=True)
class PeakSettings:
    """What counts as a sudden sound, and how many are kept."""

    min_rise_db: float = setting(
        9.0,
        unit="dB",
        limits=(3.0, 40.0),
        reason="rise over the milliseconds before; steady noise rises by up to 4.4 in a minute, bumps by 9 to 13",
    )
    min_gap: float = setting(0.05, unit="s", limits=(0.01, 1.0), reason="of two nearer peaks the weaker is an echo")
    window: float = setting(20.0, unit="s", limits=(1.0, 600.0), reason="sounds compete for a place within this long")
    most_per_window: int = setting(
        12, limits=(2, 200), reason="bounds memory: a dribbled ball, each bounce a peak, must not fill it"
    )


@dataclass(frozen=True)
class ClapSettings:
    """When sounds are the same, and when a camera may be trusted to them."""

    tolerance: float = setting(
        0.008, unit="s", limits=(0.001, 0.1), reason="travel over 2 m, and 2 ms by which AAC smears a beginning"
    )
    largest_drift: float = setting(
        200e-6, limits=(0.0, 0.01), reason="twice what a crystal in the cold differs from one in the sun"
    )
    most_peaks: int = setting(
        90,
        limits=(6, 2000),
        reason="that take part: loudest at the beginning, at the end, of all; the search squares it",
    )
    min_score: float = setting(
        0.35, limits=(0.0, 10.0), reason="a clap that both hear clearly is worth 0.7 to 1, a bump met by chance 0.1"
    )
    min_confidence: float = setting(
        0.15, limits=(0.0, 1.0), reason="lead over the second best spacing; below, claps alone do not decide"
    )
    most_sounds: int = setting(60, limits=(2, 500), reason="common sounds that clocks are fitted to, claps first")
    min_share: float = setting(
        0.5, limits=(0.0, 1.0), reason="of the cameras that ran, which must have heard a sound for it to be a clap"
    )
    min_loudness: float = setting(
        0.25, limits=(0.0, 1.0), reason="of the loudest common sound; quieter ones help, but are called no claps"
    )


@dataclass(frozen=True)
class WholeSoundSettings:
    """When two sounds are taken for the same place and time."""

    min_strength: float = setting(
        8.0, limits=(4.0, 100.0), reason="minutes of unlike noise reach 6.7 at some shift [sigmas]"
    )
    min_lead: float = setting(
        0.4, limits=(0.0, 1.0), reason="over the second best shift: one clap of two, met wrongly, has up to 0.36"
    )
    sigma: float = setting(
        0.003, unit="s", limits=(1e-4, 0.1), reason="of a piece of 30 s, from steps of 2 ms of what rises for 4"
    )
    agreement: float = setting(
        0.03,
        unit="s",
        limits=(0.001, 1.0),
        reason="pairs that contradict the others round a cycle by more are left out",
    )
    largest_drift: float = setting(200e-6, limits=(0.0, 0.01), reason="as for claps")


@dataclass(frozen=True)
class ClockSettings:
    """How clocks go, and how far a sound has to travel."""

    reference: str = setting("", reason="camera whose time is the recording's; empty: the one that shares most sounds")
    wearer_claps: bool = setting(
        False, reason="the wearer's own hands clap, and not a board beside: nominal ways to the segments are taken off"
    )
    drift_sigma: float = setting(
        100e-6,
        limits=(1e-7, 1e-2),
        reason="of two cameras: crystals are sold with 20 to 50 ppm, and get warm; claps a minute apart outweigh it",
    )
    distance_sigma: float = setting(
        0.3,
        unit="m",
        limits=(0.0, 10.0),
        reason="spread of the ways from a clap to the cameras of a body: 3 ms a metre",
    )
    moved_sigma: float = setting(
        0.1, unit="m", limits=(0.0, 10.0), reason="by how much these ways differ between claps in much the same posture"
    )
    same_posture: float = setting(
        2.0, unit="s", limits=(0.0, 60.0), reason="sounds nearer than this come by the same ways and count as one"
    )


@dataclass(frozen=True)
class SoundSettings(SettingsGroups):
    """Settings of every step from sound to clocks."""

    sound_peaks: PeakSettings = PeakSettings()
    claps: ClapSettings = ClapSettings()
    whole_sound: WholeSoundSettings = WholeSoundSettings()
    clocks: ClockSettings = ClockSettings()


@dataclass(frozen=True)
class MotionSyncSettings:
    """How far clocks may be apart, and what is believed of pairs."""

    max_offset: float = setting(
        600.0,
        unit="s",
        limits=(0.1, 7200.0),
        reason="cameras started by hand are on within minutes of each other; each further minute is another chance "
        "for a wrong match",
    )
    searched: float = setting(
        300.0,
        unit="s",
        limits=(5.0, 7200.0),
        reason="the liveliest stretch of this length decides which second; drift is 30 ms within it at most",
    )
    min_overlap: float = setting(
        2.0,
        unit="s",
        limits=(0.5, 600.0),
        reason="shorter stretches of motion resemble each other by chance",
    )
    min_confidence: float = setting(
        0.25,
        limits=(0.0, 1.0),
        reason="lead of the best offset over the next best and over chance, as a share of its evidence; limbs that "
        "have nothing to do with each other lead by less 19 times in 20, linked ones that move freely by 0.8 and more",
    )
    chunk: float = setting(
        30.0,
        unit="s",
        limits=(3.0, 600.0),
        reason="clocks are compared once in this time: drift within it is below 3 ms, and it holds a dozen movements",
    )
    frame_slack: float = setting(
        0.5,
        unit="frames",
        limits=(0.0, 3.0),
        reason="standard deviation by which images may be out of step with the sound of their own file: a file's "
        "first image and first sound share the time 0, though the image came up to a frame later",
    )
    drift_sigma: float = setting(
        5e-5, limits=(0.0, 0.01), reason="cameras' crystals are within 50 millionths of each other"
    )
    rigid_floor: float = setting(
        0.003,
        unit="s",
        limits=(0.0, 0.1),
        reason="what is near moves against what is far, and each camera sees other things near: up to 7 ms were seen "
        "on a slowly turning pelvis",
    )
