"""Whether a file of static cameras is another program's; without NumPy, which a launch file does not load."""

from pathlib import Path


def is_other_calibration(path: Path) -> bool:
    """Whether a file is one of another program, by its name or its first line."""
    if path.name.endswith((".toml", ".qca.txt")):
        return True
    try:
        with path.open("rb") as file:
            return file.read(5) == b"%YAML"
    except OSError:
        return False
