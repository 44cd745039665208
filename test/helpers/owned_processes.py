"""Processes that a test starts: they end with it, even where it is killed and cannot end them itself."""

import shutil
from collections.abc import Sequence

_SETPRIV = shutil.which("setpriv")


def ended_with_us(command: Sequence[str]) -> list[str]:
    """The command, killed by the kernel when the thread that starts it is gone; as it is without util-linux."""
    return [_SETPRIV, "--pdeathsig", "KILL", "--", *command] if _SETPRIV else [*command]
