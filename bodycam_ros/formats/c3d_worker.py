"""Reads a C3D in a process of its own and writes its content to stdout: a damaged file crashes ezc3d or never ends.

Run as a program, with the path and the limit of its memory [bytes].

The header counts frames in 16 bits. What the file has beyond them is read here, by its size and by TRIAL or
POINT:FRAMES, which some programs write.
"""

import resource
import struct
import sys
from typing import Any

_BLOCK = 512
_MOST_COUNTED = 65_535  # frames that the header can count
_INTEL = 84
_WORDS_A_POINT = 4  # x, y, z and residual


def main() -> None:
    """Write the positions (N, K, 3) of markers, their labels, rate, unit and vertical as an npz, and frames left."""
    import ezc3d
    import numpy as np

    path, most_bytes = sys.argv[1], int(sys.argv[2])
    resource.setrlimit(resource.RLIMIT_AS, (most_bytes, most_bytes))
    file = ezc3d.c3d(path)
    parameters = file["parameters"]["POINT"]
    # Names of the markers; those beyond the 255th are in LABELS2 and so on.
    keys = sorted((key for key in parameters if key.startswith("LABELS")), key=lambda key: int(key[6:] or "1"))
    # Bytes that are no UTF-8 are surrogates in the library's text, which no file or terminal takes.
    labels = [_printable(str(label)).strip() for key in keys for label in parameters[key]["value"]]
    positions = np.asarray(file["data"]["points"], np.float64)[:3].transpose(1, 2, 0)
    more, unread = _frames_beyond(path, file["parameters"], positions.shape[0], positions.shape[1])
    if more is not None:
        positions = np.concatenate([positions, more], axis=1)
    np.savez(
        sys.stdout.buffer,
        positions=positions,
        labels=np.array(labels, dtype=np.str_),
        rate=float(parameters["RATE"]["value"][0]),
        unit=str((parameters.get("UNITS", {}).get("value") or ["mm"])[0]).strip().lower(),
        up=str((parameters.get("Y_SCREEN", {}).get("value") or ["+Z"])[0]).strip().upper(),
        unread=unread,
        stated=_stated(path),
    )


def _frames_beyond(path: str, parameters: Any, markers: int, frames: int) -> tuple[Any, int]:
    """Positions (N, K, 3) of frames that the library did not read, or None; and how many are left unread."""
    import numpy as np

    with open(path, "rb") as file:
        header = file.read(_BLOCK)
        points, analog, _, _, _, scale, block = struct.unpack_from("<HHHHHfH", header, 2)
        file.seek((header[0] - 1) * _BLOCK)
        processor = file.read(4)[3:]
        begin, end = (block - 1) * _BLOCK, file.seek(0, 2)
    word = 4 if scale < 0.0 else 2
    length = word * (_WORDS_A_POINT * points + analog)
    if points != markers or not length or processor != bytes([_INTEL]) or block < 1:
        return None, 0  # another machine's numbers, which no program writes into so long a file
    held = (end - begin) // length
    declared = _declared(parameters)
    padding = -(-_BLOCK // length)  # frames that the last block may be filled up with
    # Full at its width, or gone around it once or more: a header of another count is right, and more data follow.
    is_wrapped = frames == _MOST_COUNTED or (held - frames) // (_MOST_COUNTED + 1) > 0
    total = declared if frames < declared <= held else held if is_wrapped else frames
    if total <= frames:
        return None, held - frames if held - frames > padding else 0
    rows = np.memmap(path, np.uint8, "r", begin + frames * length, ((total - frames), length))
    data = np.ascontiguousarray(rows[:, : word * _WORDS_A_POINT * points])
    if total == held:
        filled = np.flatnonzero(rows.any(axis=1))
        data = data[: max(len(data) - padding, filled[-1] + 1 if len(filled) else 0)]
    values = data.view("<f4" if word == 4 else "<i2").reshape(len(data), points, _WORDS_A_POINT).astype(np.float64)
    positions = values[:, :, :3] * (1.0 if word == 4 else scale)
    positions[values[:, :, 3] < 0.0] = np.nan
    return positions.transpose(1, 0, 2), 0


def _stated(path: str) -> int:
    """Frames by the header, since the library's POINT:FRAMES are those that it read; 0 where 16 bits are too few."""
    with open(path, "rb") as file:
        first, last = struct.unpack_from("<HH", file.read(_BLOCK), 6)
    return last - first + 1 if first <= last < _MOST_COUNTED else 0


def _declared(parameters: Any) -> int:
    """Frames as TRIAL (two words of 16 bits each) or POINT:FRAMES have them; 0 where neither does."""
    try:
        first, last = (
            int(low) % 65536 + 65536 * (int(high) % 65536)
            for low, high in (parameters["TRIAL"][f"ACTUAL_{end}_FIELD"]["value"] for end in ("START", "END"))
        )
        return last - first + 1
    except (KeyError, ValueError, TypeError):
        pass
    try:
        count = int(parameters["POINT"]["FRAMES"]["value"][0])
    except (KeyError, ValueError, TypeError, IndexError):
        return 0
    return count if count > _MOST_COUNTED else 0


def _printable(name: str) -> str:
    return name.encode("utf-8", "replace").decode("utf-8")


if __name__ == "__main__":
    main()
