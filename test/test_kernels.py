"""Kernels are compiled when the package is built: real processes, a package with two small kernels."""

import ast
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import bodycam_ros.kernels
from bodycam_ros import geometry_kernels
from bodycam_ros.body import surface
from bodycam_ros.kernels import argument_checks
from bodycam_ros.registration import descriptor_kernels
from bodycam_ros.static_cameras import contour_kernels

PACKAGE = Path(bodycam_ros.kernels.__file__).parent
ROOT = PACKAGE.parent
INNER = """
from bodycam_ros.kernels import kernel
@kernel()
def inner(x: float) -> float:
    return x + 1.0
"""
OUTER = """
from bodycam_ros.kernels import kernel
from bodycam_ros.folder.inner_kernels import inner
@kernel("(f8,)")
def outer(x: float) -> float:
    return 2.0 * inner(x)
"""
SETUP = """
from setuptools import setup
from compile_kernels import LIBRARY, CompileKernels
setup(name="small", packages=["bodycam_ros"], ext_modules=[LIBRARY], cmdclass={"build_ext": CompileKernels})
"""
BUILD = ("setup.py", "--quiet", "build_ext", "--inplace")
PROGRAM = """
import sys
from bodycam_ros.outer_kernels import outer
print(outer(3.0), "numba" in sys.modules)
"""


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A package of its own with the real ``kernels.py``, and two kernels in two files."""
    package = tmp_path / "bodycam_ros"
    (package / "folder").mkdir(parents=True)
    for name in ("errors.py", "kernels.py", "camera/readout.py"):
        (package / name).parent.mkdir(exist_ok=True)
        shutil.copy(PACKAGE / name, package / name)
    shutil.copy(ROOT / "compile_kernels.py", tmp_path)
    (tmp_path / "setup.py").write_text(SETUP)
    (package / "__init__.py").touch()
    (package / "folder/__init__.py").touch()
    (package / "folder/inner_kernels.py").write_text(INNER)
    (package / "outer_kernels.py").write_text(OUTER)
    return tmp_path


def run(sources: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run Python among the sources."""
    surroundings = {name: text for name, text in os.environ.items() if not name.startswith(("NUMBA_", "BODYCAM_"))}
    surroundings |= {"PYTHONPATH": str(sources), "PYTHONDONTWRITEBYTECODE": "1", **environment}
    return subprocess.run(
        [sys.executable, *arguments], cwd=sources, env=surroundings, capture_output=True, text=True, timeout=240
    )


def libraries(sources: Path) -> list[Path]:
    return [file for file in sources.rglob("compiled_kernels*") if "build" not in file.parts]


def test_the_build_compiles_what_changed_and_processes_run_without_numba(sources: Path) -> None:
    assert run(sources, *BUILD).returncode == 0
    assert run(sources, "-c", PROGRAM).stdout == "8.0 False\n"
    (library,) = libraries(sources)
    compiled_ns = library.stat().st_mtime_ns
    assert run(sources, *BUILD).returncode == 0
    assert libraries(sources)[0].stat().st_mtime_ns == compiled_ns
    (sources / "bodycam_ros/folder/inner_kernels.py").write_text(INNER.replace("1.0", "2.0"))
    assert run(sources, *BUILD).returncode == 0
    assert run(sources, "-c", PROGRAM).stdout == "10.0 False\n"


def test_the_build_imports_kernels_alone(sources: Path) -> None:
    (sources / "bodycam_ros/folder/__init__.py").write_text("raise ImportError('a library that is not installed yet')")
    built = run(sources, *BUILD)
    assert built.returncode == 0, built.stderr
    assert libraries(sources)


@pytest.mark.parametrize(
    ("environment", "named"), [({"CC": "false", "CXX": "false"}, "build-essential"), ({"NO_NUMBA": "1"}, "needs numba")]
)
def test_a_build_that_cannot_compile_names_what_is_missing(
    sources: Path, environment: dict[str, str], named: str
) -> None:
    if "NO_NUMBA" in environment:
        (sources / "numba.py").write_text("raise ImportError('none')")
    built = run(sources, *BUILD, **environment)
    assert built.returncode != 0
    assert named in built.stderr
    assert not libraries(sources)


def test_a_kernel_that_numba_cannot_compile_is_named(sources: Path) -> None:
    (sources / "bodycam_ros/outer_kernels.py").write_text(OUTER.replace("2.0 * inner(x)", "inner('x')"))
    built = run(sources, *BUILD)
    assert built.returncode != 0
    assert "outer_kernels.py" in built.stderr and "build-essential" not in built.stderr
    assert not libraries(sources)


@pytest.mark.parametrize("content", [None, b"not a library"])
def test_without_a_usable_library_the_command_to_make_it_is_named(sources: Path, content: bytes | None) -> None:
    if content is not None:
        (sources / "bodycam_ros/compiled_kernels.so").write_bytes(content)
    failed = run(sources, "-c", PROGRAM)
    assert failed.returncode == 1
    assert re.search(r"KernelError: .*make kernels", failed.stderr.splitlines()[-1])


def test_files_with_kernels_import_one_another_alone() -> None:
    """Such as the build can import, where nothing is installed but numba."""
    allowed = {"math", "typing", "numpy", "numpy.typing", "bodycam_ros.kernels", "bodycam_ros.camera.readout"}
    for file in PACKAGE.rglob("*.py"):
        if "\n@kernel(" in (text := file.read_text()):
            assert file.name.endswith("_kernels.py"), file
            found = {
                node.module if isinstance(node, ast.ImportFrom) else node.names[0].name
                for node in ast.walk(ast.parse(text))
                if isinstance(node, ast.Import | ast.ImportFrom)
            }
            assert {str(name) for name in found if not str(name).endswith("_kernels")} <= allowed, file


def test_the_label_of_nobody_is_that_of_surfaces() -> None:
    assert contour_kernels.NOBODY == surface.NOBODY


REGISTRATION = """
import queue, sys
from dataclasses import replace
from itertools import islice
from pathlib import Path
from bodycam_ros.replaying.camera_worker import RegistrationTask, register_images
from bodycam_ros.pipeline.settings import PipelineSettings
bags, settings = Path(sys.argv[1]), PipelineSettings()
settings = replace(settings, extension=replace(settings.extension, enabled=False))  # which waits for another process
task = RegistrationTask(bags / "sample/bag", bags / "map", settings)
images = list(islice(register_images(task, ("head", "foot_left"), queue.Queue()), 6))
print([image.matches.world_T_camera is not None for image in images], "numba" in sys.modules)
"""


def test_images_are_registered_without_numba(sample: Path) -> None:
    command = [sys.executable, "-c", REGISTRATION, str(sample)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert run.stdout.split("\n")[0] == f"{[True] * 6} False"


def test_arrays_that_are_not_as_stated_are_copied() -> None:
    xi = np.array([0.1, -0.2, 0.3, 1.0, 2.0, 3.0])
    expected = geometry_kernels.exp_se3(xi)
    strided = np.column_stack([xi, xi])[:, 0]
    read_only = xi.copy()
    read_only.flags.writeable = False
    for other in (strided, read_only):
        np.testing.assert_array_equal(geometry_kernels.exp_se3(other), expected)
    np.testing.assert_allclose(geometry_kernels.exp_se3(xi.astype(np.float32)), expected, atol=1e-6)
    for wrong in (None, 1.0, "x", xi[None], xi.astype(complex)):
        with pytest.raises(TypeError):
            geometry_kernels.exp_se3(wrong)
    with pytest.raises(ValueError, match="zip"):
        geometry_kernels.exp_se3(xi, xi)


def test_checks_of_a_signature() -> None:
    array, real, whole = argument_checks("(u2[:, ::1], f8, i8)")
    image = np.zeros((2, 3), np.uint16)
    assert array(image) is image and real(2) == 2.0 and whole(np.int64(3)) == 3
    turned = array(image.T)
    assert turned.flags.carray and turned.shape == (3, 2)
    for check, wrong in ((array, image[0]), (array, image.astype(float)), (whole, 1.5)):
        with pytest.raises(TypeError):
            check(wrong)


def test_other_threads_run_meanwhile() -> None:
    table, landmarks = np.zeros((2000, 128), np.uint8), np.arange(2000, dtype=np.uint32)
    one_list = np.zeros((2000, 1), np.int64), np.array([0, 2000]), np.arange(2000)
    kernel = threading.Thread(target=descriptor_kernels.search_lists, args=(table, *one_list, table, landmarks))
    counted = 0
    kernel.start()
    while kernel.is_alive():
        counted += 1
    assert counted > 10_000  # it would be switched to once or twice
