"""The solver's matrices are small: one thread each, while workers register on all cores."""

from pathlib import Path

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.replay.replay import replay


class Enough(Exception):
    """The first images have been solved."""


def test_it_uses_one_thread_while_it_replays_and_as_many_as_before_afterwards(sample: Path, tmp_path: Path) -> None:
    threads = []

    def look(seconds: float) -> None:
        threads.append({library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"})
        raise Enough

    bag, out = sample / "sample" / "bag", tmp_path / "out"
    with threadpool_limits(2, user_api="blas"):
        with pytest.raises(Enough):
            replay(bag, sample / "map", sample / "body.yaml", out, PipelineSettings(), 1, on_progress=look)
        after = {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}
    assert threads == [{1}] and after == {2}
