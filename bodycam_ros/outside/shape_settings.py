"""How the lengths and girths of a body are found from static cameras."""

from dataclasses import dataclass

from bodycam_ros.settings import SettingsGroups, setting


@dataclass(frozen=True)
class ShapeSettings:
    """What is expected of a body that static cameras measure, and how long they are asked."""

    length_sigma: float = setting(
        0.06, limits=(0.001, 1.0), reason="share of itself by which a length may be off before anything is seen"
    )
    girth_sigma: float = setting(
        0.08, limits=(0.001, 1.0), reason="the same of how thick segments are; people's girths differ by some 8 %"
    )
    asymmetry_sigma: float = setting(
        0.01, limits=(0.0001, 1.0), reason="share of a length by which left and right differ: 4 mm of a thigh"
    )
    girth_asymmetry_sigma: float = setting(0.03, limits=(0.0001, 1.0), reason="the same of girths")
    surface_sigma: float = setting(
        0.015,
        unit="m",
        limits=(0.0001, 0.2),
        reason="by which people bulge, taper and lean other than capsules do, always in the same places; scans of a "
        "subject do so by 3 to 18 mm",
    )
    interval: float = setting(
        0.1, unit="s", limits=(0.001, 60.0), reason="from one instant that lengths are asked of to the next"
    )
    alike_for: float = setting(
        1.0,
        unit="s",
        limits=(0.001, 60.0),
        reason="instants within this time err together and count as one; with 0.3 s lengths are twice as far off as "
        "they say",
    )
    rounds: int = setting(6, limits=(1, 100), reason="how often the recording is followed with a better body, at most")
    converged: float = setting(
        0.3,
        limits=(0.001, 10.0),
        reason="sigmas of itself by which no length changes any more: it is as good as it gets",
    )
    told: float = setting(
        0.6,
        limits=(0.0, 1.0),
        reason="sigma of a length, as a share of what it was beforehand, above which the recording does not tell it",
    )
    least_seen: float = setting(
        0.5, limits=(0.0, 1.0), reason="share of the segments that cameras must see on average, or the body is lost"
    )


@dataclass(frozen=True)
class MeasureSettings(SettingsGroups):
    """Settings of measuring a body by static cameras, beside those of following it."""

    shape: ShapeSettings = ShapeSettings()
