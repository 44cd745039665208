"""The short form of the campaign (see README.md beside): nothing that is damaged knocks anything over."""

import subprocess
import sys
from pathlib import Path

import pytest
from faults.cases import KINDS, chosen, named

pytestmark = pytest.mark.long

CAMPAIGN = Path(__file__).parent
_LONGEST_S = 900.0


def test_no_traceback_no_half_file_no_hang() -> None:
    command = [sys.executable, str(CAMPAIGN), "--short"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_S, cwd=CAMPAIGN.parents[1])
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    for kind in KINDS:
        assert f"│ {kind} " in done.stdout, "every kind is tried"


def test_a_case_is_what_its_title_and_the_seed_say() -> None:
    every = list(chosen(None, 1, frozenset(KINDS)))
    assert len({case.title for case in every}) == len(every) >= 1000
    for case in every[::97]:
        again = named(case.title)
        assert again == case
        assert again.random(3).bytes(8) == case.random(3).bytes(8) != case.random(4).bytes(8)
    with pytest.raises(KeyError):
        named("body/of water/0")
