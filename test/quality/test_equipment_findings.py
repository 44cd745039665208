"""Equipment that contradicts what is seen is named, and never makes a result wrong."""

from dataclasses import replace

import numpy as np
from helpers.known_ride import bicycle
from helpers.naming import names, numbers
from helpers.ride_with_open_joints import record

from bodycam_ros.body.equipment_report import EquipmentRecord
from bodycam_ros.quality.equipment_findings import equipment_findings
from bodycam_ros.results.verdict import Level, Verdict

RIDE = record(list(range(60)))

PEDAL = bicycle().attachments[0]
BICYCLE = replace(bicycle(), unknown={"crank": np.array([0.02, 0.0, 0.0])})
"""Its pedal is within 2 mm of the foot, its crank within 20 mm of where it is said to be."""


def test_what_is_far_from_where_the_file_has_it_is_named() -> None:
    (finding,) = equipment_findings(RIDE)
    assert (finding.part, finding.subject, finding.level) == ("equipment", "bicycle", Level.DOUBTFUL)
    assert names(finding.what, "attachment bar") and numbers(finding.what) == [3.0]
    verdict = Verdict.from_findings([finding]).text
    assert verdict.startswith("doubtful") and names(verdict, "bicycle")


def test_a_foot_that_leaves_its_pedal_for_a_while_is_no_fault() -> None:
    assert not [finding for finding in equipment_findings(RIDE) if names(finding.what, "pedal_left")]


def test_what_never_holds_but_is_near_is_no_fault() -> None:
    near = replace(RIDE, deviations=np.full_like(RIDE.deviations, 0.05))
    assert equipment_findings(near) == ()


def test_equipment_that_was_never_placed_is_named_once() -> None:
    (finding,) = equipment_findings(replace(RIDE, placed=np.zeros(60, bool)))
    assert (finding.part, finding.subject) == ("equipment", "bicycle")


def test_equipment_that_is_let_go_most_of_the_time_is_named() -> None:
    left = replace(RIDE, engaged=RIDE.engaged & (np.arange(60) < 20)[:, None])
    (finding,) = equipment_findings(left)
    assert (finding.part, finding.subject) == ("equipment", "bicycle") and names(finding.what, "70%")


def test_what_pulls_from_afar_because_it_is_said_to_hold_is_named() -> None:
    pulled = replace(RIDE, engaged=np.ones_like(RIDE.engaged))
    (finding,) = equipment_findings(pulled)
    (unused,) = equipment_findings(RIDE)
    assert finding.subject == "bicycle" and names(finding.what, "attachment bar")
    assert finding.description != unused.description, "one pulled at the body, the other did not"


def test_without_equipment_there_is_nothing_to_find() -> None:
    assert equipment_findings(None) == ()


def near(values: float, **changed: object) -> EquipmentRecord:
    """The ride without its bar, and with its crank elsewhere."""
    quiet = np.array(RIDE.deviations)
    quiet[:, 1] = 0.01
    return replace(RIDE, deviations=quiet, values=np.array([values]), **changed)


def test_a_length_far_from_what_the_file_says_is_named() -> None:
    assert equipment_findings(near(-0.059), BICYCLE) == ()
    (finding,) = equipment_findings(near(-0.068), BICYCLE)
    assert finding.level is Level.DOUBTFUL
    assert names(finding.what, "crank_x") and numbers(finding.what) == [-68.0, 0.0, 3.4]


def test_an_attachment_that_is_let_go_for_long_is_named_unless_the_file_says_when_it_holds() -> None:
    left = near(0.0, engaged=RIDE.engaged & (np.arange(60) % 10 < 7)[:, None])
    (finding,) = equipment_findings(left, BICYCLE)
    share = 1.0 - left.held[left.placed, 0].mean()
    assert 0.3 < share < 0.45
    assert names(finding.what, "attachment pedal_left") and names(finding.what, f"{share:.0%}")
    said = replace(BICYCLE, attachments=(replace(PEDAL, intervals=((0.0, 3.0),)),))
    assert equipment_findings(left, said) == ()


def test_what_is_said_to_be_within_millimetres_may_not_be_centimetres_off() -> None:
    loose = near(0.0)
    loose.deviations[:, 0] = 0.015
    (finding,) = equipment_findings(loose, BICYCLE)
    assert names(finding.what, "attachment pedal_left") and numbers(finding.what) == [0.015]
    wide = replace(BICYCLE, attachments=(replace(PEDAL, sigmas=np.full(2, 0.03)),))
    assert equipment_findings(loose, wide) == ()
