"""Nodes of one process share a map, for as long as one of them has it."""

import os
import shutil
import threading
import weakref
from pathlib import Path

from bodycam_ros.nodes.loaded_map import load_map


def test_those_who_load_a_map_at_the_same_time_share_it(sample: Path) -> None:
    maps = []
    threads = [threading.Thread(target=lambda: maps.append(load_map(sample / "map"))) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(maps) == 3 and all(each is maps[0] for each in maps)
    known = weakref.ref(maps[0])
    maps.clear()
    del thread, threads
    assert known() is None


def test_a_map_that_was_made_anew_is_read_anew(sample: Path, tmp_path: Path) -> None:
    folder = tmp_path / "map"
    for seconds in (1_000, 2_000):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(sample / "map", folder)
        os.utime(folder, (seconds, seconds))
        if seconds == 1_000:
            first = load_map(folder)
    assert load_map(folder) is not first
