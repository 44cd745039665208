"""The verdict on a solved recording: may it be used, and if not, which camera is it and what helps."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

from bodycam_ros.settings import setting


class Level(IntEnum):
    """How far a result may be trusted."""

    GOOD = 0
    DOUBTFUL = 1
    WRONG = 2

    @property
    def word(self) -> str:
        """As people say it."""
        return self.name.lower()


@dataclass(frozen=True)
class Finding:
    """What is wrong with one camera, with the equipment, or with a segment that static cameras should see.

    Attributes:
        camera: name; of the equipment or the segment if ``part`` says so.
        level: what it makes of the result; doubtful or wrong.
        what: is seen.
        why: that likely is.
        remedy: what to do.
        part: what has this name.
    """

    camera: str
    level: Level
    what: str
    why: str = ""
    remedy: str = ""
    part: Literal["camera", "equipment", "segment"] = "camera"

    @property
    def told(self) -> str:
        """What, why and what to do in one line."""
        parts = (self.what, f"likely {self.why}" if self.why else "", self.remedy)
        return "; ".join(part for part in parts if part)

    @property
    def text(self) -> str:
        """The part and all of it in one line."""
        return f"{self.part} {self.camera}: {self.told}"


@dataclass(frozen=True)
class Verdict:
    """The verdict.

    Attributes:
        level: the worst of the findings.
        findings: the worst first.
    """

    level: Level
    findings: tuple[Finding, ...]

    @classmethod
    def of(cls, findings: Sequence[Finding]) -> "Verdict":
        """The verdict that findings make."""
        ordered = tuple(sorted(findings, key=lambda finding: (-finding.level, finding.camera)))
        return cls(max((finding.level for finding in ordered), default=Level.GOOD), ordered)

    @property
    def text(self) -> str:
        """In one line, for a headline or a diagnostic."""
        if not self.findings:
            return "good: nothing contradicts the body"
        accused = list(dict.fromkeys(finding.camera for finding in self.findings if finding.level == self.level))
        what = "do not use this result;" if self.level is Level.WRONG else "look twice at what depends on"
        return f"{self.level.word}: {what} {', '.join(accused)}"


@dataclass(frozen=True)
class VerdictSettings:
    """From when on a camera contradicts the body, and for how long it must."""

    doubtful_gap: float = setting(
        0.06,
        unit="m",
        limits=(0.001, 1.0),
        reason="two cameras disagree this much about the body; good recordings stay below 0.045 in their worst second",
        live=True,
    )
    wrong_gap: float = setting(
        0.12,
        unit="m",
        limits=(0.001, 5.0),
        reason="beyond it a limb points elsewhere; lenses and names that are wrong show 0.14 and more",
        live=True,
    )
    min_stay: float = setting(
        1.0,
        unit="s",
        limits=(0.1, 60.0),
        reason="half of this time must disagree; a wrong registration or blur passes sooner, and the solver bridges it",
        live=True,
    )
    wrong_share: float = setting(
        0.05,
        limits=(0.0, 1.0),
        reason="of the time that a camera contradicts; shorter spells make a result doubtful, not wrong as a whole",
        live=True,
    )
    lens_scale: float = setting(
        0.007,
        limits=(0.001, 0.5),
        reason="share by which landmarks lie farther out or in than the lens says; a focal length 2 % off shows as "
        "0.010 to 0.017, good lenses as 0.0027 at most",
        live=True,
    )
    lens_centre: float = setting(
        0.015,
        limits=(0.001, 0.5),
        reason="by how much the principal point is off, of half the width; 40 px show as 0.06 and more, good lenses as "
        "0.005 at most",
        live=True,
    )
    clock_error: float = setting(
        0.008,
        unit="s",
        limits=(0.001, 1.0),
        reason="a camera whose places fit the body better this much earlier or later; as far as stamps are one instant",
        live=True,
    )
    min_registered: float = setting(
        0.05,
        limits=(0.0, 1.0),
        reason="share of a camera's images; below it the camera has not been registered",
        live=True,
    )
    early_end: float = setting(
        1.0,
        unit="s",
        limits=(0.1, 600.0),
        reason="a camera that is registered for the last time this long before the others ends early",
        live=True,
    )
    blind_time: float = setting(
        1.0,
        unit="s",
        limits=(0.1, 600.0),
        reason="a camera alone on its segment that is not registered for longer leaves it to guesswork",
        live=True,
    )
    rate: float = setting(
        10.0, unit="Hz", limits=(1.0, 100.0), reason="instants that are looked at; a camera that is wrong stays wrong"
    )
    span: float = setting(
        30.0,
        unit="s",
        limits=(2.0, 3600.0),
        reason="how far a live verdict looks back: it ends this long after its cause",
    )
    interval: float = setting(
        3.0,
        unit="s",
        limits=(0.5, 600.0),
        reason="between two live verdicts; one takes some hundredths of a second, in which nothing is solved",
        live=True,
    )
