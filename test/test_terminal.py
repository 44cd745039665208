import io
import logging
from typing import Literal

import pytest
from rich.table import Table
from rich.text import Text

from bodycam_ros.terminal import Terminal, log_to_terminal

EVIL = "\x1b[2J\x1b]0;owned\x07\x9b31m"


@pytest.mark.parametrize("is_terminal", [True, False])
def test_only_its_own_colours_reach_the_terminal(is_terminal: bool) -> None:
    written = io.StringIO()
    colours: Literal["standard"] | None = "standard" if is_terminal else None
    terminal = Terminal(file=written, force_terminal=is_terminal, width=120, color_system=colours)
    table = Table("camera")
    table.add_row(EVIL, style="red")
    for printed in (table, EVIL, Text(EVIL, style="bold"), f"[/nothing] {EVIL}"):
        terminal.print(printed)
    text = written.getvalue()
    assert text.count("\\x1b[2J") == 4
    assert "[/nothing]" in text
    assert not {"\x07", "\x9b"} & set(text)
    assert ("\x1b[31m" in text) == is_terminal
    assert "\x1b[2J" not in text


def test_log_lines_are_harmless(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logging.root, "handlers", [])
    log_to_terminal(verbose=False)
    logging.getLogger("bodycam_ros").warning("camera %s [/b]: is not on body", EVIL)
    said = capsys.readouterr().err
    assert "\\x1b[2J" in said and "\x1b" not in said and "[/b]" in said
