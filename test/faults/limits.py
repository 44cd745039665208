"""What a run may use, and which rights it has."""

import ctypes
import resource

_VERSION_3 = 0x20080522
_DAC_OVERRIDE, _DAC_READ_SEARCH = 1, 2
_DROP_FROM_BOUNDING_SET = 24
_ALL = 0xFFFFFFFF


class _Header(ctypes.Structure):
    _fields_ = [("version", ctypes.c_uint32), ("pid", ctypes.c_int)]


class _Sets(ctypes.Structure):
    _fields_ = [("effective", ctypes.c_uint32), ("permitted", ctypes.c_uint32), ("inheritable", ctypes.c_uint32)]


def obey_permissions() -> None:
    """Give up root's right to read and write what the mode of a file forbids, if this is root (Linux)."""
    libc = ctypes.CDLL(None, use_errno=True)
    forbidden = 1 << _DAC_OVERRIDE | 1 << _DAC_READ_SEARCH
    for right in (_DAC_OVERRIDE, _DAC_READ_SEARCH):
        libc.prctl(_DROP_FROM_BOUNDING_SET, right, 0, 0, 0)
    header, sets = _Header(_VERSION_3, 0), (_Sets * 2)()
    if libc.capget(ctypes.byref(header), sets) == 0:
        sets[0].effective &= _ALL ^ forbidden
        sets[0].permitted &= _ALL ^ forbidden
        libc.capset(ctypes.byref(header), sets)


def limit(memory_bytes: int, largest_file: int | None) -> None:
    """Bound the memory that this process may map, and the size of files that it may write."""
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if largest_file is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))
