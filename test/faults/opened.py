"""Which files of a folder a run opens, as the kernel has it: in Python, in C++ and in other processes alike."""

import ctypes
import os
import struct
from pathlib import Path

_NONBLOCK, _CLOEXEC = os.O_NONBLOCK, os.O_CLOEXEC
_IN_OPEN = 0x20
_EVENT = struct.Struct("iIII")  # watch, mask, cookie, length of the name
_BUFFER = 1 << 16

_libc = ctypes.CDLL(None, use_errno=True)


class OpenedFiles:
    """Watches a folder and those in it (Linux' inotify)."""

    def __init__(self, folder: Path) -> None:
        self._descriptor = _libc.inotify_init1(_NONBLOCK | _CLOEXEC)
        if self._descriptor < 0:
            raise OSError(ctypes.get_errno(), "inotify cannot be used: are too many programs watching files?")
        self._folders: dict[int, Path] = {}
        for parent, _, _ in os.walk(folder):
            watch = _libc.inotify_add_watch(self._descriptor, os.fsencode(parent), _IN_OPEN)
            self._folders[watch] = Path(parent)

    def read(self) -> set[Path]:
        """The files that were opened since the start; the watch ends."""
        found = set()
        try:
            while True:
                content = os.read(self._descriptor, _BUFFER)
                at = 0
                while at < len(content):
                    watch, _, _, length = _EVENT.unpack_from(content, at)
                    name = content[at + _EVENT.size : at + _EVENT.size + length].rstrip(b"\0")
                    at += _EVENT.size + length
                    if name and watch in self._folders:
                        found.add(self._folders[watch] / os.fsdecode(name))
        except BlockingIOError:
            return {path for path in found if not path.is_dir()}
        finally:
            os.close(self._descriptor)
