"""The verdict on what is solved, for /diagnostics."""

from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.verdict.verdict import Level, Verdict

_LEVELS = {Level.GOOD: HealthLevel.OK, Level.DOUBTFUL: HealthLevel.WARN, Level.WRONG: HealthLevel.ERROR}


def verdict_health(verdict: Verdict) -> Health:
    """Whether the result may be used, and what each camera has to do with it."""
    told: dict[str, list[str]] = {}
    for finding in verdict.findings:
        told.setdefault(finding.camera, []).append(finding.told)
    values = {camera: "; ".join(lines) for camera, lines in told.items()}
    return Health("verdict", _LEVELS[verdict.level], verdict.text, values)
