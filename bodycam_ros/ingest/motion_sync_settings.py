"""How far clocks may be apart that motion aligns, and what is believed of pairs of cameras."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


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
