"""Equipment that the package supplies, by name; nothing here reads a file, so that help is quick."""

from importlib.resources import files
from pathlib import Path

from bodycam_ros.errors import BodyError

_ENDINGS = (".yaml", ".yml")


def equipment_path(name_or_path: str | Path) -> Path:
    """The file of a supplied piece of equipment, or the file itself; a bare name is always of a supplied one.

    Raises:
        BodyError: none of that name is supplied; the message says which are.
    """
    path = Path(name_or_path)
    if path.name != str(name_or_path) or path.suffix.lower() in _ENDINGS:
        return path
    if path.name not in (supplied := supplied_equipment()):
        if not path.name:
            raise BodyError(
                f"no equipment is named; there are {', '.join(supplied)}, or give a file that ends in .yaml"
            )
        if path.exists():
            raise BodyError(f"{path}: an equipment file must end in .yaml; name it {path.stem}.yaml")
        raise BodyError(
            f"equipment {path.name}: none of that name is supplied; there are {', '.join(supplied)}. A file of yours "
            f"is named with its ending: {path.name}.yaml"
        )
    return _supplied_folder() / f"{path.name}.yaml"


def supplied_equipment() -> tuple[str, ...]:
    """Names of what the package supplies."""
    return tuple(sorted(path.stem for path in _supplied_folder().glob("*.yaml")))


def _supplied_folder() -> Path:
    # A link to config/equipment in the sources, a folder of the package wherever that is installed.
    return Path(str(files("bodycam_ros.equipment"))) / "supplied"
