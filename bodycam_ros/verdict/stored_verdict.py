"""The verdict of a replay as it is stored in the solved bag: JSON on a topic of text."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from bodycam_ros.verdict.verdict import Finding, Level, Verdict, VerdictSettings

VERDICT, VERDICT_TYPE = "/verdict", "std_msgs/msg/String"

_LEVELS = {level.word: level for level in Level}


@dataclass(frozen=True)
class StoredVerdict:
    """What a replay judged.

    Attributes:
        verdict: with all findings: of cameras, of equipment, and of segments that static cameras should see.
        settings: group ``verdict`` as it was then, by name.
    """

    verdict: Verdict
    settings: Mapping[str, Any]


def verdict_text(verdict: Verdict, settings: VerdictSettings) -> str:
    """The message's text, which ``parse_verdict`` reads."""
    findings = [asdict(finding) | {"level": finding.level.word} for finding in verdict.findings]
    return json.dumps({"level": verdict.level.word, "findings": findings, "settings": asdict(settings)})


def parse_verdict(text: str) -> StoredVerdict:
    """Read a message's text.

    Raises:
        ValueError: it is not what ``verdict_text`` writes.
    """
    try:
        stored = json.loads(text)
        findings = [Finding(**{**finding, "level": _LEVELS[finding["level"]]}) for finding in stored["findings"]]
        return StoredVerdict(Verdict.of(findings), dict(stored["settings"]))
    except (KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"no verdict: {error}") from error
