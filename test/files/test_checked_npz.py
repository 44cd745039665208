"""Arrays of a map: nothing in the file is believed before it is checked."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.errors import MapError
from bodycam_ros.files.checked_npz import read_arrays

DTYPES = {"places": "f8", "names": "U"}
PLACES = np.random.default_rng(0).random((40, 3))
NAMES = np.array(["a.jpg", "ä.png"] + 20 * ["and so on"])


@pytest.fixture(params=[np.savez_compressed, np.savez])
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Written as maps once were, and as they are now."""
    request.param(tmp_path / "arrays.npz", places=PLACES, names=NAMES)
    return tmp_path / "arrays.npz"


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def write(file: Path, places: bytes) -> None:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("places.npy", places)
        archive.writestr("names.npy", npy(NAMES))


def test_no_bit_can_flip_unnoticed(file: Path) -> None:
    content = file.read_bytes()
    wrong = 0
    for place in range(0, len(content), 3):
        file.write_bytes(content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :])
        try:
            arrays = read_arrays(file, DTYPES)
        except MapError as error:
            assert str(file) in str(error)
            wrong += 1
            continue
        np.testing.assert_array_equal(arrays["places"], PLACES)  # a date, a flag that nobody reads
        assert arrays["names"].tolist() == NAMES.tolist()
    assert wrong > len(content) // 3 // 2


@pytest.mark.parametrize(
    ("places", "named"),
    [
        (npy(PLACES).replace(b"(40, 3)", b"(30000000000,)"), ("240000000000 bytes",)),
        (npy(PLACES).replace(b"(40, 3)", b"(-4, 3)"), ()),
        (npy(PLACES).replace(b"(40, 3)", b"(4, [)"), ()),
        (npy(np.float32(PLACES)), ("float32",)),
        (npy(np.array([{}], dtype=object)), ("object",)),
        (npy(np.zeros(20_000_000)), ("160000128 bytes",)),
        (b"no array", ()),
        (b"", ()),
    ],
)
def test_headers_are_held_to_the_file(file: Path, places: bytes, named: tuple[str, ...]) -> None:
    write(file, places)
    with naming(MapError, file, "places", *named):
        read_arrays(file, DTYPES)
