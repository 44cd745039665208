"""What static cameras cost is measured on a person whom they do follow."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.body.body_file import read_body
from bodycam_ros.evaluate.station_timing import STATIONS, time_stations
from bodycam_ros.pipeline import PipelineSettings


def test_the_person_is_followed_while_it_is_timed(sample: Path) -> None:
    body = read_body(sample / "body.yaml")
    timing = time_stations(body, PipelineSettings(), instants=4)
    assert timing is not None
    assert timing.largest_off_m < 0.03
    assert len(timing.look_ms) == 4 and min(timing.look_ms) > 0.0
    assert timing.stations == STATIONS and timing.segments == len(body.segments) < timing.faces
    assert timing.share_ms * len(body.segments) * STATIONS == pytest.approx(np.median(timing.look_ms))


def test_a_body_without_bones_is_not_timed(sample: Path) -> None:
    body = read_body(sample / "body.yaml")
    alone = replace(body, segments=(body.root,), joints=(), mounts={})
    assert time_stations(alone, PipelineSettings()) is None
