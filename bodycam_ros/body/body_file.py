"""A body in a file: YAML (``body_yaml``), or URDF, which carries it beside what other programs read (``urdf``)."""

from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_yaml import body_from_yaml, yaml_text
from bodycam_ros.body.urdf import body_from_urdf
from bodycam_ros.errors import BodyError
from bodycam_ros.files.whole_file import write_whole
from bodycam_ros.files.yaml_file import read_text

URDF_SUFFIX = ".urdf"


def read_body(path: Path | str) -> BodyModel:
    """Read a body file: URDF if it is named so, else YAML.

    Raises:
        BodyError: the file is missing, or describes no body; the message names the file and the place in it.
    """
    path = Path(path)
    text = read_text(path, "body file", BodyError)
    try:
        return body_from_urdf(text) if is_urdf(path) else body_from_yaml(text)
    except BodyError as error:
        raise BodyError(f"{path}: {error}") from error


def write_body(body: BodyModel, path: Path | str) -> None:
    """Write a body file as YAML, whole or not at all.

    Raises:
        BodyError: the file is named as a URDF, which would not keep all of the body.
        OutputError: it cannot be written.
    """
    path = Path(path)
    if is_urdf(path):
        raise BodyError(f"{path}: a body is kept as YAML; write it as .yaml, then 'bodycam export --to urdf'")
    write_whole(path, yaml_text(body))


def is_urdf(path: Path) -> bool:
    """Whether a file is named as a URDF."""
    return path.suffix.lower() == URDF_SUFFIX
