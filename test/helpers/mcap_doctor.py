"""The checks of ``mcap doctor``, by the format's library: what is wrong with an MCAP file, in sentences."""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader, breakup_chunk, get_chunk_data_stream

_MAGIC_LENGTH = 8


def doctor(path: Path) -> list[str]:
    """Faults of a file; empty for a clean one."""
    return list(_faults(path.read_bytes(), path))


def _faults(content: bytes, path: Path) -> Iterator[str]:
    top = list(_records(path))
    ends = [number for number, (_, _, record) in enumerate(top) if isinstance(record, DataEnd)]
    if len(ends) != 1 or not isinstance(top[-1][2], Footer):
        yield "no end of the data, or no footer"
        return
    data, summary = top[: ends[0]], [record for _, _, record in top[ends[0] + 1 :]]
    yield from _checksums(content, top)
    messages = Counter[int]()
    schemas = {}
    channels = {}
    indexed = Counter[int]()
    times: list[int] = []
    chunks: dict[int, tuple[int, Chunk, dict[int, list[tuple[int, int]]]]] = {}
    for at, end, record in data:
        if isinstance(record, Message):
            yield f"a message outside chunks at {at}"
        elif isinstance(record, Chunk):
            places: dict[int, list[tuple[int, int]]] = {}
            for offset, inside in _records_in(record):
                if isinstance(inside, Schema):
                    schemas[inside.id] = inside
                elif isinstance(inside, Channel):
                    channels[inside.id] = inside
                    if inside.schema_id not in schemas:
                        yield f"channel {inside.topic} before its schema"
                elif isinstance(inside, Message):
                    if inside.channel_id not in channels:
                        yield f"a message before its channel {inside.channel_id}"
                    places.setdefault(inside.channel_id, []).append((inside.log_time, offset))
                    messages[inside.channel_id] += 1
            stamps = [stamp for each in places.values() for stamp, _ in each]
            times += stamps
            if record.compression != "zstd" or not record.uncompressed_crc:
                yield f"chunk at {at} is compressed as '{record.compression}', checksum {record.uncompressed_crc}"
            if (min(stamps), max(stamps)) != (record.message_start_time, record.message_end_time):
                yield f"chunk at {at} has other times than its messages"
            chunks[at] = (end - at, record, places)
        elif isinstance(record, MessageIndex):
            latest = max(chunks)
            indexed[latest] += 1
            if record.records != chunks[latest][2].get(record.channel_id):
                yield f"index of channel {record.channel_id} behind chunk {latest} does not fit its messages"
    for at, (_, _, places) in chunks.items():
        if indexed[at] != len(places):
            yield f"chunk at {at} has {len(places)} channels, {indexed[at]} are indexed"
    yield from _index_faults(top, summary, chunks)
    yield from _summary_faults(data, summary, schemas, channels, messages, times, len(chunks))


def _records(path: Path) -> Iterator[tuple[int, int, Any]]:
    """Start, end and content of the records outside chunks."""
    with path.open("rb") as file:
        at = _MAGIC_LENGTH
        for record in StreamReader(file, emit_chunks=True, validate_crcs=True).records:
            end = file.tell()
            yield at, end, record
            at = end


def _records_in(chunk: Chunk) -> Iterator[tuple[int, Any]]:
    """Offset in the unpacked chunk, and content, of its records."""
    records = breakup_chunk(chunk, validate_crc=True)
    stream, length = get_chunk_data_stream(chunk)
    content, at = stream.read(length), 0
    for record in records:
        yield at, record
        at += 9 + struct.unpack_from("<Q", content, at + 1)[0]


def _checksums(content: bytes, top: list[tuple[int, int, Any]]) -> Iterator[str]:
    """Wrong checksums of attachments and of the summary; those of chunks are checked as they are unpacked."""
    for at, end, record in top:
        if isinstance(record, Attachment):
            stored = struct.unpack_from("<I", content, end - 4)[0]
            if stored != zlib.crc32(content[at + 9 : end - 4]):
                yield f"attachment {record.name} has another checksum"
    at, _, footer = top[-1]
    if not footer.summary_crc or zlib.crc32(content[footer.summary_start : at + 9 + 16]) != footer.summary_crc:
        yield "the summary has another checksum"


def _index_faults(top: list[tuple[int, int, Any]], summary: list[Any], chunks: dict[int, Any]) -> Iterator[str]:
    """Entries of the index on chunks, attachments and metadata records that differ from the file."""
    index = {each.chunk_start_offset: each for each in summary if isinstance(each, ChunkIndex)}
    if index.keys() != chunks.keys():
        yield f"chunks are at {sorted(chunks)}, indexed {sorted(index)}"
    for at in index.keys() & chunks.keys():
        length, chunk, places = chunks[at]
        expected = (
            length, chunk.message_start_time, chunk.message_end_time, chunk.compression, len(chunk.data),
            chunk.uncompressed_size, places.keys(),
        )  # fmt: skip
        each = index[at]
        indexed = (
            each.chunk_length, each.message_start_time, each.message_end_time, each.compression, each.compressed_size,
            each.uncompressed_size, each.message_index_offsets.keys(),
        )  # fmt: skip
        if indexed != expected:
            yield f"chunk at {at} is indexed as {indexed}, and is {expected}"
    for kind, index_kind in ((Attachment, AttachmentIndex), (Metadata, MetadataIndex)):
        there = [(at, end - at, record.name) for at, end, record in top if isinstance(record, kind)]
        listed = [(each.offset, each.length, each.name) for each in summary if isinstance(each, index_kind)]
        if there != listed:
            yield f"{kind.__name__}: {there} are indexed as {listed}"


def _summary_faults(
    data: list[tuple[int, int, Any]],
    summary: list[Any],
    schemas: dict[int, Schema],
    channels: dict[int, Channel],
    messages: Counter[int],
    times: list[int],
    chunks: int,
) -> Iterator[str]:
    """What is repeated at the end, and the statistics, against what was counted."""
    if {each.id: each for each in summary if isinstance(each, Schema)} != schemas:
        yield "schemas at the end are not those of the messages"
    if {each.id: each for each in summary if isinstance(each, Channel)} != channels:
        yield "channels at the end are not those of the messages"
    counts = Counter(type(record) for _, _, record in data)
    expected = Statistics(
        attachment_count=counts[Attachment],
        channel_count=len(channels),
        channel_message_counts=dict(messages),
        chunk_count=chunks,
        message_count=messages.total(),
        message_end_time=max(times),
        message_start_time=min(times),
        metadata_count=counts[Metadata],
        schema_count=len(schemas),
    )
    stated = [each for each in summary if isinstance(each, Statistics)]
    if stated != [expected]:
        yield f"statistics are {stated}, counted was {expected}"


def read_beside_messages(path: Path) -> tuple[dict[str, dict[str, str]], dict[str, bytes]]:
    """Metadata records and attachments of a file, by its index."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        metadata = {each.name: each.metadata for each in reader.iter_metadata()}
        return metadata, {each.name: each.data for each in reader.iter_attachments()}
