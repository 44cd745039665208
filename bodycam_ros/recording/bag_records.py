"""What a bag's file carries beside messages: metadata records, and files attached to it (MCAP)."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Attachment, Metadata
from mcap.stream_reader import StreamReader

from bodycam_ros import __version__

PROGRAM = "bodycam_ros"
"""Record of every bag that we write: command, version, and versions of the libraries that compute."""

_LIBRARIES = ("gtsam", "numpy", "opencv-python-headless", "pycolmap", "scipy")


@dataclass(frozen=True)
class BagRecords:
    """Records and attachments of all files of a bag; of the same name, those of the last file.

    Attributes:
        metadata: name of the record -> key -> value.
        attachments: name of the file -> its content.
    """

    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)

    def add(self, record: Metadata | Attachment) -> None:
        """Add a record of a file."""
        if isinstance(record, Metadata):
            self.metadata[record.name] = record.metadata
        else:
            self.attachments[record.name] = record.data


def read_bag_records(path: Path) -> BagRecords:
    """Read the records of a bag folder or .mcap file; of a damaged one those before the damage, of others none."""
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path] if path.suffix == ".mcap" else []
    found = BagRecords()
    for file in files:
        try:
            records = list(_indexed_records(file))
        except Exception:  # a damaged file can raise nearly anything in a parser
            records = list(_whole_records(file))
        for record in records:
            found.add(record)
    return found


@cache
def program_record(command: str) -> dict[str, str]:
    """The record ``PROGRAM`` of a bag that a command writes."""
    record = {"command": command, "version": __version__}
    for library in _LIBRARIES:
        try:
            record[library] = version(library)
        except PackageNotFoundError:  # apt's packages have other names
            continue
    return record


def _indexed_records(file: Path) -> Iterator[Metadata | Attachment]:
    with file.open("rb") as opened:
        reader = SeekingReader(opened, record_size_limit=file.stat().st_size)
        if reader.get_summary() is None:
            raise McapError("no index")
        yield from reader.iter_metadata()
        yield from reader.iter_attachments()


def _whole_records(file: Path) -> Iterator[Metadata | Attachment]:
    """Those before the damage, without an index."""
    try:
        with file.open("rb") as opened:
            for record in StreamReader(opened, emit_chunks=True, record_size_limit=file.stat().st_size).records:
                if isinstance(record, (Metadata, Attachment)):
                    yield record
    except Exception:  # as above
        return
