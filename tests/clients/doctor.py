"""Examines logs as `mcap doctor --strict-message-order` does, with the official Python reader: exits 1 if it finds anything.

It also compares what that command does not: the indexes of messages, attachments and metadata with their records.
"""
import io
import sys

from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, AttachmentIndex, Channel, Chunk, ChunkIndex, DataEnd, Footer, Header, Message
from mcap.records import MessageIndex, Metadata, MetadataIndex, Schema, Statistics
from mcap.stream_reader import StreamReader, breakup_chunk

MAGIC = 8


def examine(path):
    with open(path, "rb") as file:
        data = file.read()
    wrong = []

    def expect(holds, words):
        if not holds:
            wrong.append(words)

    schemas, channels, counts, newest, first = {}, {}, {}, 0, None
    chunks, chunk_indexes, attachments, metadata, statistics, in_summary = {}, [], [], [], None, False
    summary_schemas, summary_channels, kinds = set(), set(), []
    at = MAGIC
    for record in StreamReader(io.BytesIO(data), emit_chunks=True, validate_crcs=True).records:
        # An opcode and a length come before each record.
        length = 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        kinds.append(type(record))
        if isinstance(record, Header):
            expect(record.library and not record.profile, "the header names no library, or a profile")
        elif isinstance(record, Chunk):
            times, index = [], {}
            inside = breakup_chunk(record, validate_crc=True)
            offset = 0
            for nested in inside:
                size = 9 + int.from_bytes(record.data[offset + 1 : offset + 9], "little")
                if isinstance(nested, Schema):
                    expect(nested.id not in schemas and nested.id != 0, f"schema {nested.id} twice")
                    schemas[nested.id] = nested
                elif isinstance(nested, Channel):
                    expect(nested.id not in channels, f"channel {nested.id} twice")
                    expect(nested.schema_id in schemas, f"channel {nested.id} before its schema")
                    channels[nested.id] = nested
                elif isinstance(nested, Message):
                    expect(nested.channel_id in channels, f"a message before its channel {nested.channel_id}")
                    topic = channels[nested.channel_id].topic
                    expect(nested.log_time >= newest, f"{topic}: {nested.log_time} is less than {newest}")
                    expect(nested.sequence == counts.get(nested.channel_id, 0), f"{topic}: number {nested.sequence}")
                    newest, first = max(newest, nested.log_time), nested.log_time if first is None else first
                    counts[nested.channel_id] = counts.get(nested.channel_id, 0) + 1
                    times.append(nested.log_time)
                    index.setdefault(nested.channel_id, []).append((nested.log_time, offset))
                else:
                    expect(False, f"a {type(nested).__name__} in a chunk")
                offset += size
            expect(times and (record.message_start_time, record.message_end_time) == (min(times), max(times)),
                   f"the times of the chunk at {at}")
            chunks[at] = (length, index, {})
        elif isinstance(record, MessageIndex):
            start = max(chunks)
            chunks[start][2][record.channel_id] = at
            found = sorted((time, offset) for time, offset in record.records)
            expect(found == sorted(chunks[start][1].get(record.channel_id, [])), f"the message index at {at}")
        elif isinstance(record, ChunkIndex):
            chunk_indexes.append(record)
        elif isinstance(record, Attachment):
            attachments.append((at, length, record))
        elif isinstance(record, Metadata):
            metadata.append((at, length, record.name))
        elif isinstance(record, AttachmentIndex):
            expect((record.offset, record.length, record.name) in [(at, n, a.name) for at, n, a in attachments], "attachment index")
        elif isinstance(record, MetadataIndex):
            expect((record.offset, record.length, record.name) in metadata, "metadata index")
        elif isinstance(record, Schema) and in_summary:
            summary_schemas.add(record.id)
            expect(record == schemas.get(record.id), f"schema {record.id} of the summary")
        elif isinstance(record, Channel) and in_summary:
            summary_channels.add(record.id)
            expect(record == channels.get(record.id), f"channel {record.id} of the summary")
        elif isinstance(record, Statistics):
            expect(statistics is None, "statistics twice")
            statistics = record
        elif isinstance(record, DataEnd):
            in_summary = True
        elif isinstance(record, (Message, Schema, Channel)):
            expect(False, f"a {type(record).__name__} outside of a chunk")
        at += length
    expect(DataEnd in kinds and Footer in kinds, "no end")
    if statistics is None:
        # The log of a killed program has no summary.
        expect(not chunk_indexes, "indexes without statistics")
        return wrong, sum(counts.values())
    expect(summary_schemas == set(schemas) and summary_channels == set(channels), "schemas or channels of the summary")
    expect({index.chunk_start_offset for index in chunk_indexes} == set(chunks), "the chunk indexes")
    for index in chunk_indexes:
        length, _, offsets = chunks[index.chunk_start_offset]
        expect(index.chunk_length == length and index.message_index_offsets == offsets, f"the index of the chunk at {index.chunk_start_offset}")
    expect((statistics.message_count, statistics.channel_message_counts) == (sum(counts.values()), counts), "message counts")
    expect((statistics.schema_count, statistics.channel_count, statistics.chunk_count) == (len(schemas), len(channels), len(chunks)), "other counts")
    expect((statistics.attachment_count, statistics.metadata_count) == (len(attachments), len(metadata)), "attachments or metadata")
    expect((statistics.message_start_time, statistics.message_end_time) == (first or 0, newest), "the times of the statistics")
    # The reader that seeks finds the same messages by the indexes.
    sought = sum(1 for _ in make_reader(io.BytesIO(data), validate_crcs=True).iter_messages())
    expect(sought == statistics.message_count, f"{sought} messages by the indexes")
    return wrong, sum(counts.values())


found = False
for path in sys.argv[1:]:
    wrong, count = examine(path)
    found |= bool(wrong)
    print(f"{path}: {count} messages", *wrong, sep="\n  ")
sys.exit(found)
