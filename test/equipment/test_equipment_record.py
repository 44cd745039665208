"""Reports of single instants, put together."""

from dataclasses import replace

import numpy as np
import pytest
from held_ride import OFF, UNPLACED, record, report

from bodycam_ros.equipment.equipment_record import EquipmentLog

STAMPS = list(range(100, 160))


def test_reports_in_any_order_make_one_record() -> None:
    log = EquipmentLog()
    for frame in np.random.default_rng(1).permutation(len(STAMPS)).tolist():
        log.add(STAMPS[frame], report(frame))
    shuffled, straight = log.record(), record(STAMPS)
    assert shuffled is not None
    np.testing.assert_array_equal(shuffled.stamps_ns, STAMPS)
    np.testing.assert_array_equal(shuffled.engaged, straight.engaged)
    np.testing.assert_array_equal(shuffled.deviations, straight.deviations)
    np.testing.assert_array_equal(shuffled.values, report(len(STAMPS) - 1).values)


def test_stretches_without_hold_are_named_by_their_ends() -> None:
    ride = record(STAMPS)
    assert ride.let_go(0) == [(100 + OFF[0], 100 + OFF[-1])]
    assert ride.let_go(1) == [(100 + len(UNPLACED), 159)]


def test_nothing_holds_to_what_is_nowhere() -> None:
    log = EquipmentLog()
    log.add(1, replace(report(0), engaged=np.array([True, True])))
    said = log.record()
    assert said is not None and not said.held.any()


def test_two_machines_on_one_topic_are_refused() -> None:
    log = EquipmentLog()
    log.add(1, report(5))
    with pytest.raises(ValueError, match="of skis, and those before of another bicycle"):
        log.add(2, replace(report(6), name="skis"))


def test_no_report_makes_no_record() -> None:
    assert EquipmentLog().record() is None
