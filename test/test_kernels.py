"""Kernels are compiled once, into the user's cache: real processes, an installation with two small kernels."""

import os
import re
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numba.core.errors import TypingError

import bodycam_ros.kernels
from bodycam_ros import geometry_kernels
from bodycam_ros.kernels import KERNEL_FILES, argument_checks, prepare_kernels
from bodycam_ros.registration import descriptor_kernels

PACKAGE = Path(bodycam_ros.kernels.__file__).parent
INNER = """
from bodycam_ros.kernels import kernel
@kernel()
def inner(x: float) -> float:
    return x + 1.0
"""
OUTER = """
from bodycam_ros.kernels import kernel
from bodycam_ros.inner import inner
@kernel("(f8,)")
def outer(x: float) -> float:
    return 2.0 * inner(x)
"""
PROGRAM = """
import logging
logging.basicConfig(format="%(message)s")
from bodycam_ros.kernels import prepare_kernels
prepare_kernels()
from bodycam_ros.outer import outer
import sys
print(outer(3.0), "compiled" if "numba.pycc" in sys.modules else "with numba" if "numba" in sys.modules else "loaded")
"""


@pytest.fixture
def installation(tmp_path: Path) -> Path:
    """A package of its own with the real ``kernels.py``, and two kernels in two files."""
    package = tmp_path / "site" / "bodycam_ros"
    package.mkdir(parents=True)
    source = (PACKAGE / "kernels.py").read_text()
    for name, files in (("KERNEL_FILES", '"inner.py", "outer.py"'), ("_CONSTANT_FILES", '"kernels.py",')):
        source, count = re.subn(rf"^{name} = \(.*?\)$", f"{name} = ({files})", source, flags=re.S | re.M)
        assert count == 1
    (package / "kernels.py").write_text(source)
    (package / "__init__.py").touch()
    (package / "inner.py").write_text(INNER)
    (package / "outer.py").write_text(OUTER)
    return package


def run(installation: Path, command: Sequence[str] = (), **environment: str) -> tuple[str, str]:
    """What the program printed, and what it logged."""
    place = installation.parent.parent
    surroundings = {name: text for name, text in os.environ.items() if not name.startswith(("NUMBA_", "XDG_"))}
    surroundings |= {"PYTHONPATH": str(installation.parent), "HOME": str(place / "home")}
    surroundings |= {"PYTHONDONTWRITEBYTECODE": "1", **environment}
    command = command or [sys.executable, "-c", PROGRAM]
    process = subprocess.run(command, cwd=place, env=surroundings, capture_output=True, text=True, timeout=120)
    assert process.returncode == 0, process.stderr
    return process.stdout.strip(), process.stderr


def test_the_first_run_compiles_into_the_users_cache_and_the_next_loads(installation: Path) -> None:
    before = sorted(installation.rglob("*"))
    out, logged = run(installation)
    assert out == "8.0 compiled"
    assert logged.startswith("compiling the numerical kernels for this machine, once") and logged.count("\n") == 1
    assert len(list((installation.parent.parent / "home" / ".cache" / "bodycam_ros").glob("*.so"))) == 1
    assert sorted(installation.rglob("*")) == before
    assert run(installation) == ("8.0 loaded", "")
    (installation / "inner.py").write_text(INNER.replace("1.0", "2.0"))
    assert run(installation)[0] == "10.0 compiled"


@pytest.mark.parametrize("kept", [0.5, 0.99, 0.0])
def test_a_library_that_was_cut_is_made_anew(installation: Path, kept: float) -> None:
    assert run(installation)[0] == "8.0 compiled"
    (library,) = (installation.parent.parent / "home" / ".cache" / "bodycam_ros").glob("*.so")
    whole = library.read_bytes()
    os.truncate(library, int(kept * len(whole)))
    assert run(installation)[0] == "8.0 compiled"
    library.write_bytes(whole[: len(whole) // 2] + bytes(len(whole) - len(whole) // 2))
    assert run(installation)[0] == "8.0 compiled"
    assert run(installation) == ("8.0 loaded", "")


FORBIDDEN = """
import sys
sys.path.insert(0, sys.argv.pop(1))
from faults.limits import obey_permissions
obey_permissions()
"""


def test_a_home_that_may_not_be_entered_is_done_without(installation: Path, tmp_path: Path) -> None:
    """As after ``sudo -E``."""
    (home := tmp_path / "forbidden").mkdir(mode=0)
    command = [sys.executable, "-c", FORBIDDEN + PROGRAM, str(Path(__file__).parent)]
    out, logged = run(installation, command, HOME=str(home))
    home.chmod(0o700)
    assert out == "8.0 compiled" and "numba's cache" in logged


def test_without_a_compiler_they_are_kept_in_numbas_cache(installation: Path) -> None:
    out, logged = run(installation, CC="false", CXX="false")
    assert out == "8.0 compiled" and "numba's cache" in logged
    assert list(installation.rglob("*.nbc"))


def test_without_a_place_they_are_compiled_at_every_start(installation: Path) -> None:
    out, logged = run(installation, NUMBA_CACHE_DIR=os.devnull)
    assert out == "8.0 compiled" and os.devnull in logged


def test_every_file_with_kernels_is_known() -> None:
    holding = {str(file.relative_to(PACKAGE)) for file in PACKAGE.rglob("*.py") if "\n@kernel(" in file.read_text()}
    assert holding == set(KERNEL_FILES)


REGISTRATION = """
import queue, sys
from dataclasses import replace
from itertools import islice
from pathlib import Path
from bodycam_ros.replay.camera_worker import RegistrationTask, register_images
from bodycam_ros.pipeline.settings import PipelineSettings
bags, settings = Path(sys.argv[1]), PipelineSettings()
settings = replace(settings, extension=replace(settings.extension, enabled=False))  # which waits for another process
task = RegistrationTask(bags / "sample/bag", bags / "map", settings)
images = list(islice(register_images(task, ("head", "foot_left"), queue.Queue()), 6))
print([image.matches.world_T_camera is not None for image in images], "numba" in sys.modules)
"""


def test_no_kernel_of_an_image_is_compiled_while_it_waits(sample: Path) -> None:
    """An array that is not as a kernel states it would go to numba, which takes seconds."""
    command = [sys.executable, "-c", REGISTRATION, str(sample)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert run.stdout.split("\n")[0] == f"{[True] * 6} False"


def test_what_the_library_does_not_take_goes_to_numba() -> None:
    prepare_kernels()
    xi = np.array([0.1, -0.2, 0.3, 1.0, 2.0, 3.0])
    expected = geometry_kernels.exp_se3(xi)
    strided = np.column_stack([xi, xi])[:, 0]
    read_only = xi.copy()
    read_only.flags.writeable = False
    for other in (strided, read_only):
        np.testing.assert_array_equal(geometry_kernels.exp_se3(other), expected)
    np.testing.assert_allclose(geometry_kernels.exp_se3(xi.astype(np.float32)), expected, atol=1e-6)
    for wrong in (None, 1.0, "x"):
        with pytest.raises((TypeError, TypingError)):
            geometry_kernels.exp_se3(wrong)


def test_checks_of_a_signature() -> None:
    array, real, whole = argument_checks("(u2[:, ::1], f8, i8)")
    image = np.zeros((2, 3), np.uint16)
    assert array(image) is image and real(2) == 2.0 and whole(np.int64(3)) == 3
    for check, wrong in ((array, image.T), (array, image[0]), (array, image.astype("u1")), (whole, 1.5)):
        with pytest.raises(TypeError):
            check(wrong)


def test_other_threads_run_meanwhile() -> None:
    prepare_kernels()
    table, landmarks = np.zeros((2000, 128), np.uint8), np.arange(2000, dtype=np.uint32)
    one_list = np.zeros((2000, 1), np.int64), np.array([0, 2000]), np.arange(2000)
    kernel = threading.Thread(target=descriptor_kernels.search_lists, args=(table, *one_list, table, landmarks))
    counted = 0
    kernel.start()
    while kernel.is_alive():
        counted += 1
    assert counted > 10_000  # it would be switched to once or twice
