"""Reference maps as nodes load them: those that share a process share a map, its photographs and what is learned of it.

Nobody changes a map that was loaded; what grows is a copy.
"""

import threading
from pathlib import Path
from weakref import WeakValueDictionary

from bodycam_ros.registration.reference_map import ReferenceMap

_lock = threading.Lock()
_loaded: WeakValueDictionary[tuple[Path, int], ReferenceMap] = WeakValueDictionary()
"""Folder, and when it was last changed -> map, for as long as a node has it."""


def load_map(path: Path) -> ReferenceMap:
    """Read a map folder, unless a node of this process has done so.

    Raises:
        MapError: as of ``ReferenceMap.load``.
    """
    with _lock:
        place = (path.absolute(), path.stat().st_mtime_ns if path.exists() else 0)
        reference_map = _loaded.get(place)
        if reference_map is None:
            reference_map = _loaded[place] = ReferenceMap.load(path)
        return reference_map
