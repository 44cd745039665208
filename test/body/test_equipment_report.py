"""Reports of the coupling to equipment, collected over a recording."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.body.equipment_report import EquipmentLog, EquipmentReport

NO_LENGTH = np.zeros(0)
REPORT = EquipmentReport(
    "board",
    True,
    ("left", "right"),
    np.array([True, False]),
    np.array([0.01, 0.2]),
    (),
    NO_LENGTH,
    NO_LENGTH,
    NO_LENGTH,
)


def collected(*reports: tuple[int, EquipmentReport]) -> EquipmentLog:
    log = EquipmentLog()
    for stamp_ns, report in reports:
        log.add(stamp_ns, report)
    return log


def test_reports_come_in_any_order_and_leave_in_that_of_time() -> None:
    unplaced = replace(REPORT, placed=False, deviations=np.full(2, np.nan))
    record = collected((30, REPORT), (10, unplaced), (20, replace(REPORT, engaged=np.array([True, True])))).record()
    assert record is not None
    assert record.stamps_ns.tolist() == [10, 20, 30]
    assert record.placed.tolist() == [False, True, True]
    assert record.engaged.tolist() == [[True, False], [True, True], [True, False]]
    # An attachment of equipment that is nowhere does not hold.
    assert record.held.tolist() == [[False, False], [True, True], [True, False]]


def test_of_two_reports_of_one_time_the_later_counts() -> None:
    record = collected((10, REPORT), (10, replace(REPORT, deviations=np.array([0.5, 0.6])))).record()
    assert record is not None and record.deviations.tolist() == [[0.5, 0.6]]


def test_without_reports_there_is_no_record() -> None:
    assert EquipmentLog().record() is None


@pytest.mark.parametrize("change", [{"name": "sledge"}, {"attachments": ("left", "middle")}, {"lengths": ("crank_x",)}])
def test_a_report_of_other_equipment_is_refused(change: dict[str, object]) -> None:
    log = collected((10, REPORT))
    with naming(ValueError, "board", change.get("name", "board")):
        log.add(20, replace(REPORT, **change))  # type: ignore[arg-type]
    record = log.record()
    assert record is not None and record.stamps_ns.tolist() == [10]


def test_stretches_without_hold_begin_and_end_where_it_was_let_go() -> None:
    holds = [True, False, False, True, False, True, False]
    placed = [True, True, True, True, False, True, True]
    reports = [
        (10 * row, replace(REPORT, placed=there, engaged=np.array([held, True])))
        for row, (held, there) in enumerate(zip(holds, placed, strict=True))
    ]
    record = collected(*reports).record()
    assert record is not None
    assert record.let_go(0) == [(10, 20), (60, 60)], "at 40 ns it was not known where it is"
    assert record.let_go(1) == []
