"""What we read is data: no code of ours hands it to something that runs it, opens an address, or believes its sizes."""

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest
from helpers.naming import naming

from bodycam_ros.errors import MapError
from bodycam_ros.files.checked_npz import read_arrays

REPOSITORY = Path(__file__).parent.parent
FILES = sorted(f for folder in ("bodycam_ros", "docs", "launch") for f in (REPOSITORY / folder).rglob("*.py"))

_FORBIDDEN_MODULES = {
    *("pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "tarfile"),
    *("requests", "httpx", "aiohttp", "urllib.request", "urllib3", "http.client", "ftplib", "smtplib", "xmlrpc"),
    *("lxml", "xml.sax", "xml.dom", "xml.etree.cElementTree"),
}
_FORBIDDEN_CALLS = {
    *("eval", "exec", "compile", "__import__", "os.system", "os.popen", "os.spawnl", "subprocess.getoutput"),
    *("yaml.load_all", "yaml.full_load", "yaml.unsafe_load", "np.fromfile", "np.loadtxt", "np.genfromtxt"),
    *("ET.parse", "ET.fromstring", "ET.iterparse", "ET.XML", "ElementTree.parse", "ElementTree.fromstring"),
}
_WORDS = {
    *(name.rpartition(".")[2] for name in _FORBIDDEN_MODULES | _FORBIDDEN_CALLS if not name.startswith("xml.")),
    *("xml.dom", "xml.sax", "xml import", "shell", "allow_pickle", ".extract", "np.load", "numpy.load"),
    *("yaml.load", "yaml.safe_load", "yaml.parse", "://", "=//", '"//', "'//"),
}
_READS_YAML = REPOSITORY / "bodycam_ros/files/yaml_file.py"
_READS_XML = REPOSITORY / "bodycam_ros/body/urdf_xml.py"
_FETCHED = ("src=", "href=", "@import", "url(", "fetch(", "import(")


@cache
def tree(file: Path) -> ast.AST:
    """The syntax of a file; nothing of one in which no word is that a test looks for: most are such."""
    text = file.read_text()
    return ast.parse(text if any(word in text for word in _WORDS) else "")


def nodes(file: Path) -> Iterator[ast.AST]:
    return ast.walk(tree(file))


def dotted(function: ast.expr) -> str:
    """The name that is called, with those before its dots; of what is no name, only what is behind it."""
    if isinstance(function, ast.Attribute):
        return f"{dotted(function.value)}.{function.attr}"
    return function.id if isinstance(function, ast.Name) else ""


def calls(file: Path) -> Iterator[tuple[str, ast.Call]]:
    """Dotted names of what is called."""
    for node in nodes(file):
        if isinstance(node, ast.Call):
            yield dotted(node.func), node


def given(call: ast.Call) -> dict[str, str]:
    return {each.arg: ast.unparse(each.value) for each in call.keywords if each.arg in ("shell", "allow_pickle")}


def test_there_is_something_to_look_at() -> None:
    rooms = {init.parent for init in (REPOSITORY / "bodycam_ros").glob("*/__init__.py")}
    assert len(rooms) > 20 and rooms <= {file.parent for file in FILES} and _READS_YAML in FILES


@pytest.mark.parametrize("source", ["import pickle", "from urllib.request import urlopen", "from xml import dom"])
def test_a_forbidden_import_is_found(source: str) -> None:
    assert forbidden_modules(ast.walk(ast.parse(source)))


def forbidden_modules(found: Iterable[ast.AST]) -> set[str]:
    named = set()
    for node in found:
        if isinstance(node, ast.Import):
            named |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            named |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
    return {name for name in named if any(name == bad or name.startswith(f"{bad}.") for bad in _FORBIDDEN_MODULES)}


def test_nothing_unpickles_or_opens_addresses() -> None:
    assert not {f"{file}: {name}" for file in FILES for name in forbidden_modules(nodes(file))}


def test_nothing_evaluates_what_it_reads() -> None:
    found = {(file, name) for file in FILES for name, _ in calls(file) if name in _FORBIDDEN_CALLS}
    assert found == {(_READS_XML, "ET.fromstring")}, "XML is read in one place, which refuses document types"


def test_yaml_is_read_in_one_place() -> None:
    loading = {
        file for file in FILES for name, _ in calls(file) if name in ("yaml.load", "yaml.safe_load", "yaml.parse")
    }
    assert loading == {_READS_YAML}


def test_no_shell_is_asked_and_no_array_unpickled() -> None:
    for file in FILES:
        for name, call in calls(file):
            assert given(call).get("shell", "False") == "False", f"{file}: {name}"
            assert given(call).get("allow_pickle", "False") == "False", f"{file}: {name}"
            assert name not in ("np.load", "numpy.load") or "allow_pickle" in given(call), f"{file}: {name}"
            assert not name.endswith((".extractall", ".extract")), f"{file}: {name}"


def test_no_page_fetches_anything() -> None:
    for file in FILES:
        for node in nodes(file):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert not any(
                    f"{how}{quote}{there}" in node.value
                    for how in _FETCHED
                    for quote in ("", '"', "'")
                    for there in ("http", "//")
                ), f"{file}: {node.value[:100]}"


def test_an_array_that_is_code_is_not_run(tmp_path: Path) -> None:
    import pickle
    import zipfile

    import numpy as np

    class Touch:
        def __reduce__(self) -> tuple[object, ...]:
            return Path.touch, (tmp_path / "it ran",)

    np.save(tmp_path / "points.npy", np.array([Touch()], object), allow_pickle=True)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.write(tmp_path / "points.npy", "points.npy")
    with naming(MapError, tmp_path / "a.npz", "object", "f8"):
        read_arrays(tmp_path / "a.npz", {"points": "f8"})
    assert not (tmp_path / "it ran").exists()
    pickle.loads((tmp_path / "points.npy").read_bytes()[128:])
    assert (tmp_path / "it ran").exists(), "it would have"
