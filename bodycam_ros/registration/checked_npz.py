"""Arrays of an npz file of which nothing is believed until it was checked against the file's size."""

import io
import math
import os
import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import MapError

_MOST_INFLATED = 100  # times its compressed size; descriptors shrink by a fifth, names of photographs by nine tenths
_SMALL = 10_000_000  # [bytes] what needs no such check


def read_arrays(path: Path, dtypes: Mapping[str, str]) -> dict[str, NDArray[Any]]:
    """Read arrays without pickle, with their checksums, and without allocating more than the file can hold.

    Args:
        path: an npz file.
        dtypes: name of a wanted array -> its dtype without byte order ("u4", "f8"); "U" for text of any length.

    Raises:
        MapError: the file is damaged, encrypted, or does not hold these arrays; the message names file and array.
    """
    name = ""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise MapError("it is a folder, pipe or device")
        with zipfile.ZipFile(path) as archive:
            arrays = {}
            for name, dtype in dtypes.items():
                arrays[name] = _array(archive, f"{name}.npy", dtype)
            return arrays
    except MemoryError as error:
        raise MapError(f"{path}: {name}: there is not enough memory for it") from error
    except Exception as error:  # a damaged file can raise nearly anything in a parser
        problem = getattr(error, "strerror", None) or str(error).strip("'\"") or repr(error)
        place = f"{name}: " if name else ""
        raise MapError(f"{path}: damaged or incomplete ({place}{problem}); build the map again") from error


def _array(archive: zipfile.ZipFile, member: str, wanted: str) -> NDArray[Any]:
    entry = archive.getinfo(member)
    if entry.flag_bits & 1:
        raise MapError("it is encrypted")
    if entry.file_size > max(_SMALL, _MOST_INFLATED * entry.compress_size):
        raise MapError(f"it claims {entry.file_size} bytes of {entry.compress_size} compressed ones")
    content = archive.read(entry)  # checks the checksum
    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_columns, dtype = read_header(stream)
    if not (dtype.str[1:] == wanted or (wanted == dtype.kind == "U")):
        raise MapError(f"it holds {dtype}, expected {wanted}")
    claimed, there = math.prod(shape) * dtype.itemsize, len(content) - stream.tell()
    if claimed != there:
        raise MapError(f"its header claims {claimed} bytes, there are {there}")
    flat = np.frombuffer(content, dtype, offset=stream.tell())
    return flat.reshape(shape, order="F" if by_columns else "C").astype(dtype.newbyteorder("="))
