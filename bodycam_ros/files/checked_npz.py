"""Arrays of an npz file of which nothing is used before it is checked against the file's size.

``np.savez`` stores arrays as they are: those of bytes are mapped, and shared by all processes that read the file; wider
numbers are copied to where a processor can reach them. Maps of older versions are compressed in part.
"""

import io
import math
import mmap
import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import MapError

_MOST_INFLATED = 100  # times its compressed size; descriptors shrink by a fifth, names of photographs by nine tenths
_SMALL = 10_000_000  # [bytes] what needs no such check
_LONGEST_HEADER = 100_000  # [bytes] of an array; numpy's own limit is below it
_LOCAL_HEADER = struct.Struct("<26xHH")  # of a zip file: lengths of name and extra field


def read_arrays(
    path: Path,
    wanted: Mapping[str, str],
    optional: Mapping[str, str] = MappingProxyType({}),
    sizes: Mapping[str, int] = MappingProxyType({}),
) -> dict[str, NDArray[Any]]:
    """Read arrays without pickle, with their checksums, and without allocating more than the file can hold.

    Args:
        path: an npz file.
        wanted: name of an array -> its dtype without byte order ("u4", "f8"; "U" for text of any length), and its
            shape, as in "f8 L 3": a letter is a size that is the same wherever it stands. Without one any is taken.
        optional: the same of arrays that the file may lack.
        sizes: letter -> its size, where it is known.

    Returns:
        The arrays that are there. What is written to one stays in this process's memory.

    Raises:
        MapError: the file is damaged, encrypted, or does not hold these arrays, or numbers that are not finite; the
            message names file and array.
    """
    name = ""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise MapError("it is a folder, pipe or device")
        with path.open("rb") as file, zipfile.ZipFile(file) as archive:
            mapped = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY))
            arrays = {}
            known = dict(sizes)
            there = set(archive.namelist())
            extra = {name: form for name, form in optional.items() if f"{name}.npy" in there}
            for name, form in (dict(wanted) | extra).items():
                dtype, *shape = form.split()
                arrays[name] = _array(archive, mapped, f"{name}.npy", dtype)
                _check_content(arrays[name], shape, known)
            return arrays
    except MemoryError as error:
        raise MapError(f"{path}: {name}: there is not enough memory for it") from error
    except Exception as error:  # a damaged file can raise nearly anything in a parser
        problem = getattr(error, "strerror", None) or str(error).strip("'\"") or repr(error)
        place = f"{name}: " if name else ""
        raise MapError(f"{path}: damaged or incomplete ({place}{problem}); build the map again") from error


def _array(archive: zipfile.ZipFile, mapped: memoryview, member: str, wanted: str) -> NDArray[Any]:
    entry = archive.getinfo(member)
    if entry.flag_bits & 1:
        raise MapError("it is encrypted")
    if entry.file_size > max(_SMALL, _MOST_INFLATED * entry.compress_size):
        raise MapError(f"it claims {entry.file_size} bytes of {entry.compress_size} compressed ones")
    content = _content(archive, mapped, entry)
    stream = io.BytesIO(content[:_LONGEST_HEADER])
    version = np.lib.format.read_magic(stream)
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_columns, dtype = read_header(stream)
    if not (dtype.str[1:] == wanted or (wanted == dtype.kind == "U")):
        raise MapError(f"it holds {dtype}, expected {wanted}")
    claimed, there = math.prod(shape) * dtype.itemsize, len(content) - stream.tell()
    if claimed != there:
        raise MapError(f"its header claims {claimed} bytes, there are {there}")
    flat = np.frombuffer(content, dtype, offset=stream.tell())
    array = flat.reshape(shape, order="F" if by_columns else "C")
    return np.require(array, dtype.newbyteorder("="), ["A", "W"])


def _check_content(array: NDArray[Any], shape: Sequence[str], sizes: dict[str, int]) -> None:
    """Check shape and numbers; sizes that were unknown are known from now on."""
    pairs = zip(shape, array.shape, strict=False)
    expected = tuple(int(size) if size.isdigit() else sizes.setdefault(size, there) for size, there in pairs)
    if shape and (len(shape) != array.ndim or expected != array.shape):
        raise MapError(f"it has the shape {array.shape}, expected {expected or shape}")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise MapError("it has values that are not finite")


def _content(archive: zipfile.ZipFile, mapped: memoryview, entry: zipfile.ZipInfo) -> memoryview:
    """What a member holds, its checksum checked: mapped if it is stored as it is."""
    if entry.compress_type != zipfile.ZIP_STORED:
        return memoryview(archive.read(entry))  # checks the checksum
    archive.open(entry).close()  # checks the member's own header
    name_length, extra_length = _LOCAL_HEADER.unpack_from(mapped, entry.header_offset)
    start = entry.header_offset + _LOCAL_HEADER.size + name_length + extra_length
    content = mapped[start : start + entry.file_size]
    if len(content) != entry.file_size or zlib.crc32(content) != entry.CRC:
        raise MapError("its checksum is another")
    return content
