"""Quality checks of recordings and results: findings, and the verdict that they make."""

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import IntEnum
from typing import Generic, Literal, TypeVar

T = TypeVar("T")

WRONG_RESULT = 3
"""Exit code when there is a result that should not be used; it is written all the same."""


class Level(IntEnum):
    """Quality of a recording or of a result."""

    GOOD = 0
    DOUBTFUL = 1
    WRONG = 2

    @property
    def word(self) -> str:
        """The level in lower case, as printed and stored."""
        return self.name.lower()


@dataclass(frozen=True)
class Finding:
    """One thing that a quality check found.

    Attributes:
        subject: name of the camera, segment, joint or equipment; empty for the recording as a whole.
        level: quality of what depends on the subject.
        what: observation.
        why: likely cause.
        remedy: what to do.
        part: kind of the subject.
        check: name of the check that found it, as "gaps" or "contradiction", for programs.
        cause: kind of the likely cause, as "clock" or "strap", for programs; empty where it has no name.
    """

    subject: str
    level: Level
    what: str
    why: str = ""
    remedy: str = ""
    part: Literal["camera", "equipment", "segment", "joint", "recording"] = "camera"
    check: str = ""
    cause: str = ""

    @property
    def description(self) -> str:
        """Observation, cause and remedy in one line."""
        parts = (self.what, f"likely cause: {self.why}" if self.why else "", self.remedy)
        return "; ".join(part for part in parts if part)

    @property
    def text(self) -> str:
        """Subject and description in one line."""
        return f"{self.part} {self.subject}: {self.description}" if self.subject else self.description


def worst_level(findings: Iterable[Finding]) -> Level:
    """The worst level of findings; good without any."""
    return max((finding.level for finding in findings), default=Level.GOOD)


def limit_level(value: float, doubtful: float, wrong: float) -> Level:
    """Level of a value with upper limits, or with lower limits where ``wrong`` is below ``doubtful``."""
    sign = 1.0 if wrong >= doubtful else -1.0
    if sign * value > sign * wrong:
        return Level.WRONG
    return Level.DOUBTFUL if sign * value > sign * doubtful else Level.GOOD


@dataclass(frozen=True)
class Verdict:
    """Quality of a result.

    Attributes:
        level: worst level of the findings.
        findings: worst first.
    """

    level: Level
    findings: tuple[Finding, ...]

    @classmethod
    def from_findings(cls, findings: Sequence[Finding]) -> "Verdict":
        """The verdict that findings make."""
        ordered = tuple(sorted(findings, key=lambda finding: (-finding.level, finding.subject)))
        return cls(worst_level(ordered), ordered)

    @property
    def text(self) -> str:
        """One line, for a headline or a diagnostic."""
        if not self.findings:
            return "good: nothing contradicts the body"
        accused = list(dict.fromkeys(finding.subject for finding in self.findings if finding.level == self.level))
        named = ", ".join(filter(None, accused))
        if self.level is Level.WRONG:
            return f"{self.level.word}: do not use this result{f'; {named}' if named else ''}"
        return f"{self.level.word}: check the result before you use it{f', above all {named}' if named else ''}"


VERDICT, VERDICT_TYPE = "/verdict", "std_msgs/msg/String"

_LEVELS = {level.word: level for level in Level}


def finding_record(finding: Finding) -> dict[str, str]:
    """The fields of a finding as text, for JSON."""
    return asdict(finding) | {"level": finding.level.word}


def verdict_text(verdict: Verdict) -> str:
    """Text of the message on ``VERDICT``; ``parse_verdict`` reads it."""
    return json.dumps({"level": verdict.level.word, "findings": [*map(finding_record, verdict.findings)]})


def parse_verdict(text: str) -> Verdict:
    """Read the text of a message on ``VERDICT``.

    Raises:
        ValueError: the text was not written by ``verdict_text``.
    """
    try:
        stored = json.loads(text)
        findings = [Finding(**{**finding, "level": _LEVELS[finding["level"]]}) for finding in stored["findings"]]
        return Verdict.from_findings(findings)
    except (KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"no verdict: {error}") from error


@dataclass(frozen=True)
class LimitCheck(Generic[T]):
    """A number of a camera, and its limits.

    Attributes:
        check: name of the check; several rows may share one.
        measure: of what was read of a camera; NaN where it cannot be computed.
        doubtful, wrong: limits, see ``verdict.limit_level``.
        what: observation, a format of the number and of what was read.
        remedy: what to do.
        summary: of the whole recording, a format of the least and the greatest number; empty for none.
    """

    check: str
    measure: Callable[[T], float]
    doubtful: float
    wrong: float
    what: str
    remedy: str
    summary: str = ""


def good(check: str, what: str) -> Finding:
    """The finding of a check of the whole recording without a fault."""
    return Finding("", Level.GOOD, what, part="recording", check=check)


_SAME_ENDS = re.compile(r"(\S+) to \1(?!\S)")  # "30.0 to 30.0"


def check_limits(cameras: Mapping[str, T], rows: Sequence[LimitCheck[T]]) -> Iterator[Finding]:
    """Findings of the cameras beyond a limit, and the summaries.

    Args:
        cameras: name -> what was read of it.
        rows: of the table of checks.
    """
    for row in rows:
        values = {name: float(row.measure(camera)) for name, camera in cameras.items()}
        values = {name: value for name, value in values.items() if math.isfinite(value)}
        for name, value in values.items():
            if level := limit_level(value, row.doubtful, row.wrong):
                yield Finding(name, level, row.what.format(value, cameras[name]), remedy=row.remedy, check=row.check)
        if row.summary and values:
            text = row.summary.format(min(values.values()), max(values.values()))
            yield good(row.check, _SAME_ENDS.sub(r"\1", text))
