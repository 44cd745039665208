"""The short form of the campaign (see README.md beside): nothing that is damaged knocks anything over."""

import subprocess
import sys
from pathlib import Path

import pytest
from faults.cases import KINDS, Case, chosen, named
from faults.outcome import NAMED, Outcome
from faults.table import unreached

pytestmark = pytest.mark.long

CAMPAIGN = Path(__file__).parent
_LONGEST_S = 900.0


def test_no_traceback_no_half_file_no_hang() -> None:
    command = [sys.executable, str(CAMPAIGN), "--short"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_S, cwd=CAMPAIGN.parents[1])
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    for kind in KINDS:
        assert f"│ {kind} " in done.stdout, "every kind is tried"


_WITHOUT_MAPS = """
import sys
sys.path[0] = sys.argv.pop(1)
from faults import campaign, work
work._QUICK_MAP = ("--features.nobodys", "1")
sys.exit(campaign.main())
"""


def test_a_campaign_whose_good_inputs_are_refused_fails_at_once() -> None:
    command = [sys.executable, "-c", _WITHOUT_MAPS, str(CAMPAIGN.parent), "--only", "reference", "--cases", "3"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_S, cwd=CAMPAIGN.parents[1])
    assert done.returncode == 1, f"{done.stdout}\n{done.stderr}"
    assert "good refused" in done.stdout and "│ reference " not in done.stdout


def test_cases_that_stop_before_the_damaged_file_is_opened_are_no_proof() -> None:
    def outcomes(opened: int) -> list[tuple[Case, Outcome]]:
        case = named("reference/camera.yaml: empty/0")
        return [(case, Outcome(NAMED, {}, "", 0.0, {"reference": number < opened})) for number in range(5)]

    assert not unreached(outcomes(1))
    (line,) = unreached(outcomes(0))
    assert line.plain == "reference: none of 5 cases with a damaged reference reached what reads it"


def test_a_case_is_what_its_title_and_the_seed_say() -> None:
    every = list(chosen(None, 1, frozenset(KINDS)))
    assert len({case.title for case in every}) == len(every) >= 1000
    for case in every[::97]:
        again = named(case.title)
        assert again == case
        assert again.random(3).bytes(8) == case.random(3).bytes(8) != case.random(4).bytes(8)
    with pytest.raises(KeyError):
        named("body/of water/0")
