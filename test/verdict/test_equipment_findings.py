"""Equipment that contradicts what is seen is named, and never makes a result wrong."""

from dataclasses import replace

import numpy as np
from held_ride import record

from bodycam_ros.verdict.equipment_findings import equipment_findings
from bodycam_ros.verdict.verdict import Level, Verdict

RIDE = record(list(range(60)))


def test_what_is_far_from_where_the_file_has_it_is_named() -> None:
    (finding,) = equipment_findings(RIDE)
    assert finding.level is Level.DOUBTFUL
    assert finding.text == (
        "equipment bicycle: attachment bar is 3 m from the body where the file has it; "
        "it was not used; check its points, and when it holds"
    )
    assert Verdict.of([finding]).text == "doubtful: look twice at what depends on bicycle"


def test_a_foot_that_leaves_its_pedal_for_a_while_is_no_fault() -> None:
    assert not [finding for finding in equipment_findings(RIDE) if "pedal_left" in finding.what]


def test_what_never_holds_but_is_near_is_no_fault() -> None:
    near = replace(RIDE, deviations=np.full_like(RIDE.deviations, 0.05))
    assert equipment_findings(near) == ()


def test_equipment_that_was_never_placed_is_named_once() -> None:
    (finding,) = equipment_findings(replace(RIDE, placed=np.zeros(60, bool)))
    assert finding.text.startswith("equipment bicycle: where it is was never known, so nothing was coupled to it; ")


def test_equipment_that_is_let_go_most_of_the_time_is_named() -> None:
    left = replace(RIDE, engaged=RIDE.engaged & (np.arange(60) < 20)[:, None])
    (finding,) = equipment_findings(left)
    assert finding.text.startswith("equipment bicycle: nothing held it for 70% of the time; is it the equipment")


def test_what_pulls_from_afar_because_it_is_said_to_hold_is_named() -> None:
    pulled = replace(RIDE, engaged=np.ones_like(RIDE.engaged))
    (finding,) = equipment_findings(pulled)
    assert finding.told.endswith("it pulled at the body all the same; check its points, and when it holds")


def test_without_equipment_there_is_nothing_to_find() -> None:
    assert equipment_findings(None) == ()
