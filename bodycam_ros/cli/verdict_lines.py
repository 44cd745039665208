"""The verdict on the terminal, and the exit code that says it to scripts."""

from rich.text import Text

from bodycam_ros.terminal import Terminal
from bodycam_ros.verdict.verdict import Level, Verdict

WRONG_RESULT = 3
"""Exit code when there is a result that should not be used; it is written all the same."""

_STYLES = {Level.GOOD: "green", Level.DOUBTFUL: "yellow", Level.WRONG: "bold red"}


def print_verdict(terminal: Terminal, verdict: Verdict) -> None:
    """Print the verdict and a line for each finding, coloured where the terminal can."""
    for finding in verdict.findings:
        line = Text.assemble((f"{finding.level.word}: ", _STYLES[finding.level]), finding.text)
        terminal.print(line, soft_wrap=True)
    terminal.print(Text(f"verdict: {verdict.text}", _STYLES[verdict.level]), soft_wrap=True)


def camera_styles(verdict: Verdict) -> dict[str, str]:
    """Camera that was found at fault -> the style of its row in a table."""
    # The worst comes first and stays.
    return {finding.camera: _STYLES[finding.level] for finding in reversed(verdict.findings)}


def exit_code(verdict: Verdict) -> int:
    """0, or that of a result that should not be used."""
    return WRONG_RESULT if verdict.level is Level.WRONG else 0
