"""When lengths that are learned of a piece of equipment have settled."""

from dataclasses import replace

import numpy as np
from helpers.known_ride import bicycle

from bodycam_ros.body.coupled_body import SettledLengths
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.equipment_report import EquipmentReport

FRAME_NS = 500_000_000


def found(learning: SettledLengths, values: list[float], placed: bool = True) -> list[tuple[int, float]]:
    """Frames at which lengths had settled, and the length."""
    settled = []
    for frame, value in enumerate(values):
        one = np.array([value])
        report = EquipmentReport("bike", placed, (), np.zeros(0, bool), np.zeros(0), ("crank_x",), one, one, one)
        if (lengths := learning.add(frame * FRAME_NS, report)) is not None:
            settled.append((frame, float(lengths[0])))
    return settled


def unknown_crank() -> Equipment:
    return replace(bicycle(), unknown={"crank": np.array([0.05, 0.0, 0.0])})


def test_lengths_that_have_settled_elsewhere_are_found_once() -> None:
    values = [0.0] * 4 + [0.01, 0.02, 0.03] + [0.0301] * 12 + [0.05] * 30
    assert found(SettledLengths(unknown_crank()), values) == [(16, 0.0301)]


def test_lengths_as_in_the_file_are_described_already() -> None:
    assert found(SettledLengths(unknown_crank()), [0.0] * 12 + [0.02] * 30) == [(22, 0.02)]
    assert not found(SettledLengths(unknown_crank()), [0.0005] * 40)
    assert not found(SettledLengths(unknown_crank()), [0.02] * 40, placed=False)
    assert not found(SettledLengths(bicycle()), [0.02] * 40)
