"""The verdict of a replay as it is stored in the solved bag: JSON on a topic of text."""

import json
from dataclasses import asdict

from bodycam_ros.verdict.verdict import Finding, Level, Verdict

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
