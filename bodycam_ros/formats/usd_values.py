"""Values as USD's text files have them."""

import json
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array


def identifier(name: str) -> str:
    """A name as USD allows it."""
    kept = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name)
    return kept if kept and not kept[0].isdigit() else f"_{kept}"


def tokens(names: Iterable[str]) -> str:
    """Names in quotation marks."""
    return ", ".join(map(json.dumps, names))


def samples(frames: NDArray[np.intp], values: Array) -> str:
    """Time samples of an array: values (T, N, K) at frames (T,)."""
    return "".join(
        f"            {frame}: [{written_rows(row)}],\n" for frame, row in zip(frames.tolist(), values, strict=True)
    )


def single_samples(frames: NDArray[np.intp], values: Array) -> str:
    """Time samples of one value: values (T, K) at frames (T,)."""
    return "".join(
        f"            {frame}: {written(row)},\n" for frame, row in zip(frames.tolist(), values.tolist(), strict=True)
    )


def written_rows(rows: Array) -> str:
    """Each row (K,) of some (N, K) in parentheses."""
    return ", ".join(map(written, rows.tolist()))


def written(values: Sequence[float]) -> str:
    """Values in parentheses."""
    return f"({', '.join(f'{value:.8g}' for value in values)})"


def matrices(poses: Array) -> str:
    """USD multiplies rows by matrices."""
    return ", ".join(f"( {written_rows(pose.T)} )" for pose in poses)
