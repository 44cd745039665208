"""The verdict on a solved recording: may it be used, and if not, which camera is it and what helps."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import IntEnum
from typing import Literal


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


VERDICT, VERDICT_TYPE = "/verdict", "std_msgs/msg/String"

_LEVELS = {level.word: level for level in Level}


def verdict_text(verdict: Verdict) -> str:
    """The message's text, which ``parse_verdict`` reads."""
    findings = [asdict(finding) | {"level": finding.level.word} for finding in verdict.findings]
    return json.dumps({"level": verdict.level.word, "findings": findings})


def parse_verdict(text: str) -> Verdict:
    """Read a message's text.

    Raises:
        ValueError: it is not what ``verdict_text`` writes.
    """
    try:
        stored = json.loads(text)
        findings = [Finding(**{**finding, "level": _LEVELS[finding["level"]]}) for finding in stored["findings"]]
        return Verdict.of(findings)
    except (KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"no verdict: {error}") from error
