"""Kernels are compiled once, wherever that can be kept: real processes on an installation with two small kernels."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bodycam_ros.kernels.kernel_folder import CONSTANT_FILES, KERNEL_FILES, PACKAGE

INNER = """
from bodycam_ros.kernels.kernel import kernel
@kernel()
def inner(x: float) -> float:
    return x + 1.0
"""
OUTER = """
from bodycam_ros.kernels.kernel import kernel
from bodycam_ros.inner import inner
@kernel("(f8,)")
def outer(x: float) -> float:
    return 2.0 * inner(x)
"""
PROGRAM = """
import logging
logging.basicConfig(format="%(message)s")
from bodycam_ros.kernels.preparation import prepare_kernels
prepare_kernels()
prepare_kernels()
from bodycam_ros.outer import outer
import sys
print(outer(3.0), "compiled" if "numba.pycc" in sys.modules else "with numba" if "numba" in sys.modules else "loaded")
"""


@pytest.fixture
def installation(tmp_path: Path) -> Path:
    """A package of its own with the real code of ``kernels``, and two kernels in two files."""
    return install(tmp_path)


@pytest.fixture(scope="module")
def first_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, tuple[str, str]]:
    """An installation in which the program ran once, and what it printed and said."""
    package = install(tmp_path_factory.mktemp("first"))
    return package, run(package)


@pytest.fixture
def compiled(first_run: tuple[Path, tuple[str, str]], tmp_path: Path) -> Path:
    """An installation with its compiled kernels, brought to another place."""
    shutil.copytree(first_run[0].parent, tmp_path / "site")
    return tmp_path / "site" / "bodycam_ros"


def install(place: Path) -> Path:
    package = place / "site" / "bodycam_ros"
    shutil.copytree(PACKAGE / "kernels", package / "kernels", ignore=shutil.ignore_patterns("__pycache__"))
    (package / "__init__.py").touch()
    for file in CONSTANT_FILES:
        (package / file).parent.mkdir(exist_ok=True)
        shutil.copy(PACKAGE / file, package / file)
    (package / "inner.py").write_text(INNER)
    (package / "outer.py").write_text(OUTER)
    folder = package / "kernels" / "kernel_folder.py"
    source, count = re.subn(
        r"^KERNEL_FILES = \(.*?\)$", 'KERNEL_FILES = ("inner.py", "outer.py")', folder.read_text(), flags=re.S | re.M
    )
    assert count == 1
    folder.write_text(source)
    return package


def start(installation: Path, *prefix: str, **environment: str) -> "subprocess.Popen[str]":
    place = installation.parent.parent
    surroundings = {name: text for name, text in os.environ.items() if not name.startswith(("NUMBA_", "XDG_"))}
    surroundings |= {"PYTHONPATH": str(installation.parent), "HOME": str(place / "home"), "TMPDIR": str(place / "tmp")}
    surroundings |= {"PYTHONDONTWRITEBYTECODE": "1", **environment}
    (place / "tmp").mkdir(exist_ok=True)
    return subprocess.Popen(
        [*prefix, sys.executable, "-c", PROGRAM],
        cwd=place,
        env=surroundings,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(installation: Path, *prefix: str, **environment: str) -> tuple[str, str]:
    """What the program printed, and what it said."""
    return result(start(installation, *prefix, **environment))


def result(process: "subprocess.Popen[str]") -> tuple[str, str]:
    out, error = process.communicate(timeout=120)
    assert process.returncode == 0, error
    return out.strip(), error


def kept(folder: Path) -> list[Path]:
    return sorted(file for file in folder.rglob("*") if file.suffix in (".so", ".nbc"))


def forbid(folder: Path) -> None:
    """Keep everybody, root too, from making a folder."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.touch()


def test_the_first_run_says_that_it_compiles_and_the_next_loads(first_run: tuple[Path, tuple[str, str]]) -> None:
    installation, (out, said) = first_run
    assert out == "8.0 compiled"
    assert said.startswith("compiling the numerical kernels for this machine, once") and said.count("\n") == 1
    assert kept(installation / "__pycache__") and not (installation.parent.parent / "home").exists()
    assert run(installation) == ("8.0 loaded", "")


def test_what_is_damaged_is_compiled_again(compiled: Path) -> None:
    file = kept(compiled)[0]
    file.write_bytes(file.read_bytes()[:100])
    out, said = run(compiled)
    assert out.startswith("8.0") and "compiling" in said
    assert run(compiled) == ("8.0 loaded", "")


def test_two_that_start_at_once_compile_once(installation: Path) -> None:
    processes = [start(installation) for _ in range(2)]
    results = [result(process) for process in processes]
    assert sorted(out for out, _ in results) == ["8.0 compiled", "8.0 loaded"]
    assert "".join(said for _, said in results).count("compiling") == 1


def test_a_read_only_installation_keeps_them_with_the_user(installation: Path) -> None:
    forbid(installation / "__pycache__")
    out, said = run(installation)
    assert out == "8.0 compiled" and "compiling" in said
    assert kept(installation.parent.parent / "home" / ".cache" / "bodycam_ros")
    assert run(installation) == ("8.0 loaded", "")


def test_a_full_disk_costs_time_and_nothing_else(installation: Path) -> None:
    if shutil.which("prlimit") is None:
        pytest.skip("there is no prlimit here")
    assert run(installation, "prlimit", "--fsize=4096")[0] == "8.0 compiled"
    out, said = run(installation)
    assert out == "8.0 compiled" and "compiling" in said
    assert run(installation) == ("8.0 loaded", "")


def test_without_a_compiler_they_are_kept_in_numbas_cache(installation: Path) -> None:
    assert run(installation, CC="false", CXX="false")[0] == "8.0 compiled"
    assert {file.suffix for file in kept(installation)} == {".nbc"}
    assert run(installation) == ("8.0 with numba", "")


def test_every_file_with_kernels_is_known() -> None:
    holding = {str(file.relative_to(PACKAGE)) for file in PACKAGE.rglob("*.py") if "\n@kernel(" in file.read_text()}
    assert holding == set(KERNEL_FILES)
