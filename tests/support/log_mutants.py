"""Damage to flight logs, by a seed: bytes, rows, numbers, formats; messages with a right checksum.

Each mutant is one flight log as bytes. What a row is depends on the form: a DataFlash message, a
line, a record of a telemetry log.
"""

from __future__ import annotations

import itertools
import struct
import tempfile
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import numpy as np
from pymavlink import DFReader
from pymavlink.dialects.v20 import all as dialect
from pymavlink.generator.mavcrc import x25crc

from uavgram.io.logs.dataflash.tables import FMT_TYPE, BinaryTables, index_binary, index_by_loop

Rng = np.random.Generator
Item = TypeVar("Item")
USED = ("POS", "ATT", "MNT", "GPS", "GPA", "ORGN", "CAM", "XKF1", "XKF4", "XKQ", "XKV1")
STRANGE = (b"\0" * 8, b"\xff" * 8, b"\x7f" * 8, b"\0\0\xc0\x7f\0\0\xf8\x7f", b"\0\0\x80\x7f" * 2)


def short_logs(folder: Path, until_s: float = 160.0) -> dict[str, bytes]:
    """The first ten seconds of our own flight in the three forms, with the messages in use only."""
    data = (folder / "twin_short.BIN").read_bytes()
    tables = index_binary("", data)
    number = {p[0].format.number: n for n, p in tables.pieces.items() if n in USED}
    late = {
        at
        for name in USED
        for at, time in zip(tables.places(name), tables.columns(name)["TimeUS"], strict=True)
        if time > until_s * 1e6
    }
    kept, at = [], 0
    for row in binary_rows(data):
        kind = row[3] if row[2] == FMT_TYPE else row[2]
        if kind in (*number, FMT_TYPE) and at not in late:
            kept.append(row)
        at += len(row)
    kept_records = records((folder / "twin_short.tlog").read_bytes())
    last = struct.unpack(">Q", kept_records[0][:8])[0] + 10_000_000
    return {
        ".BIN": b"".join(kept),
        ".log": text_log(b"".join(kept)),
        ".tlog": b"".join(r for r in kept_records if struct.unpack(">Q", r[:8])[0] < last),
    }


def text_log(data: bytes, until_s: float = np.inf) -> bytes:
    """A binary DataFlash log, up to a boot time, in its text form."""
    with tempfile.NamedTemporaryFile(suffix=".BIN") as file:
        file.write(data)
        file.flush()
        reader = DFReader.DFReader_binary(file.name)
        lines = []
        while (message := reader.recv_match()) is not None:
            if getattr(message, "TimeUS", 0) < until_s * 1e6:
                values = (getattr(message, field) for field in message.get_fieldnames())
                lines.append(", ".join([message.get_type(), *(str(v) for v in values)]))
        reader.close()
    return "\n".join(lines).encode("latin-1")


def mutant(suffix: str, data: bytes, seed: int) -> tuple[str, bytes]:
    """The kind of damage, and the damaged log."""
    rng = np.random.default_rng([seed, sum(suffix.encode())])
    kinds = KINDS[suffix]
    kind = kinds[int(rng.integers(len(kinds)))]
    return kind.__name__.strip("_"), kind(data, rng)


def _pick(rng: Rng, items: Sequence[Item]) -> Item:
    return items[int(rng.integers(len(items)))]


# bytes, whatever they mean


def _flipped(data: bytes, rng: Rng) -> bytes:
    damaged = np.frombuffer(data, dtype=np.uint8).copy()
    at = rng.integers(0, len(damaged), int(10 ** rng.uniform(0, 2.5)))
    damaged[at] ^= (1 << rng.integers(0, 8, len(at))).astype(np.uint8)
    return damaged.tobytes()


def _overwritten(data: bytes, rng: Rng) -> bytes:
    a = int(rng.integers(0, len(data)))
    b = min(len(data), a + int(10 ** rng.uniform(0, 4)))
    filling = bytes([int(rng.integers(0, 256))]) * (b - a)
    return data[:a] + (filling if rng.random() < 0.5 else rng.bytes(b - a)) + data[b:]


def _cut(data: bytes, rng: Rng) -> bytes:
    a, b = sorted(rng.integers(0, len(data), 2).tolist())
    return data[:a] if rng.random() < 0.5 else data[:a] + data[b:]


def _spliced(data: bytes, rng: Rng) -> bytes:
    a, b = sorted(rng.integers(0, len(data), 2).tolist())
    at = int(rng.integers(0, len(data)))
    return data[:at] + data[a : min(b, a + len(data) // 3)] + data[at:]


# rows


def _shuffled(rows: list[bytes], rng: Rng) -> list[bytes]:
    """Some rows left out, said twice, or exchanged."""
    rows = list(rows)
    for _ in range(int(rng.integers(1, 12))):
        i, j = (int(k) for k in rng.integers(0, len(rows), 2))
        what = int(rng.integers(0, 4))
        if what == 0:
            del rows[i]
        elif what == 1:
            rows.insert(j, rows[i])
        elif what == 2:
            rows[i], rows[j] = rows[j], rows[i]
        else:
            del rows[i : i + int(10 ** rng.uniform(0, 2))]
    return rows


@lru_cache(maxsize=1)
def binary_rows(data: bytes) -> list[bytes]:
    """The messages of a DataFlash log."""
    edges = [*sorted(at for starts in index_by_loop(data) for at in starts), len(data)]
    return [data[a:b] for a, b in itertools.pairwise(edges)]


def _binary_shuffled(data: bytes, rng: Rng) -> bytes:
    return b"".join(_shuffled(binary_rows(data), rng))


def _text_shuffled(data: bytes, rng: Rng) -> bytes:
    return b"\n".join(_shuffled(data.split(b"\n"), rng))


# values


@lru_cache(maxsize=1)
def _indexed(data: bytes) -> BinaryTables:
    return index_binary("", data)


def _binary_values(data: bytes, rng: Rng) -> bytes:
    """One to five fields of messages that are used: another bit, another value, no number."""
    tables = _indexed(data)
    damaged = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        piece = tables.pieces[_pick(rng, [n for n in USED if n in tables.pieces])][0]
        dtype = piece.format.dtype()
        assert dtype is not None
        assert dtype.names is not None
        assert dtype.fields is not None
        field, offset = dtype.fields[_pick(rng, dtype.names)][:2]
        at = int(_pick(rng, piece.starts)) + 3 + offset
        size = field.itemsize
        if rng.random() < 0.5:
            damaged[at + int(rng.integers(size))] ^= 1 << int(rng.integers(8))
        else:
            damaged[at : at + size] = (*STRANGE, rng.bytes(8))[int(rng.integers(6))][:size]
    return bytes(damaged)


def _edited(number: bytes, rng: Rng) -> bytes:
    """A number that a person or a disk made of another one."""
    digit = int(rng.integers(0, max(len(number), 1)))
    other = b"%d" % rng.integers(0, 10)
    return _pick(
        rng,
        (
            *(b"nan", b"inf", b"-inf", b"", b"0", b"-1", b"1e400", b"9" * 5000, b"1e-400", b"0x1F"),
            *(b"-" + number, number.lstrip(b"-"), number + other, number[1:], number[:-1]),
            *(number[:digit] + other + number[digit + 1 :],) * 6,
            *(number.replace(b".", b""), number.replace(b".", b","), number + b"e3"),
        ),
    )


def _text_values(data: bytes, rng: Rng) -> bytes:
    lines = data.split(b"\n")
    named = [k for k, line in enumerate(lines) if line.split(b",")[0].decode() in USED]
    for _ in range(int(rng.integers(1, 6))):
        k = _pick(rng, named)
        fields = lines[k].split(b", ")
        at = int(rng.integers(1, len(fields))) if len(fields) > 1 else 0
        fields[at] = _edited(fields[at], rng)
        lines[k] = b", ".join(fields)
    return b"\n".join(lines)


# formats


def _binary_format(data: bytes, rng: Rng) -> bytes:
    """A used format damaged where it stands, or stated anew and otherwise in mid-log."""
    rows = list(binary_rows(data))
    at = [k for k, r in enumerate(rows) if r[2] == 0x80 and r[5:9].strip(b"\0").decode() in USED]
    k = _pick(rng, at)
    row = bytearray(rows[k])
    for _ in range(int(rng.integers(1, 4))):
        part = int(rng.integers(0, 6))
        if part < 2:
            row[int(rng.integers(3, 89))] ^= 1 << int(rng.integers(8))
        elif part == 2:
            row[4] = int(rng.integers(3, 120))
        elif part == 3:
            count = len(bytes(row[9:25]).rstrip(b"\0"))
            row[9 + int(rng.integers(count))] = _pick(rng, b"bBhHiIfcCeELqQdnN")
        else:
            names = bytes(row[25:89]).rstrip(b"\0").split(b",")
            i, j = (int(n) for n in rng.integers(0, len(names), 2))
            names[i], names[j] = names[j], names[i]
            row[25:89] = b",".join(names)[:64].ljust(64, b"\0")
    if rng.random() < 0.5:
        rows[k] = bytes(row)
    else:
        rows.insert(int(rng.integers(k, len(rows))), bytes(row))
    return b"".join(rows)


def _text_format(data: bytes, rng: Rng) -> bytes:
    lines = data.split(b"\n")
    at = [k for k, x in enumerate(lines) if x[:4] == b"FMT," and x.split(b", ")[3].decode() in USED]
    k = _pick(rng, at)
    fields = lines[k].split(b", ")
    names = fields[5].split(b",")
    part = int(rng.integers(0, 5))
    i, j = (int(n) for n in rng.integers(0, len(names), 2))
    if part < 2:
        names[i], names[j] = names[j], names[i]
    elif part == 2:
        del names[i]
    elif part == 3:
        names.insert(i, b"New")
    else:
        fields[4] = bytes(
            _pick(rng, b"bBhHiIfcCeELqQdnNZ") if rng.random() < 0.3 else c for c in fields[4]
        )
    if part in (2, 3):
        fields[4] = b"f" * len(names)
    fields[5] = b",".join(names)
    line = b", ".join(fields)
    if rng.random() < 0.5:
        lines[k] = line
    else:
        lines.insert(int(rng.integers(k, len(lines))), line)
    return b"\n".join(lines)


# telemetry logs: records of eight bytes of time and a frame


def records(data: bytes) -> list[bytes]:
    """The records of an undamaged telemetry log."""
    records, at = [], 0
    while at + 20 <= len(data):
        second = data[at + 8] == 0xFD
        signed = 13 if second and data[at + 10] & 1 else 0
        end = at + 8 + data[at + 9] + (12 if second else 8) + signed
        records.append(data[at:end])
        at = end
    return records


def _tlog_shuffled(data: bytes, rng: Rng) -> bytes:
    return b"".join(_shuffled(records(data), rng))


def _checked(record: bytearray) -> bytes:
    """The record with the checksum of its bytes."""
    second = record[8] == 0xFD
    number = int.from_bytes(record[15:18], "little") if second else record[13]
    known = dialect.mavlink_map.get(number)
    end = 8 + record[9] + (10 if second else 6)
    if known is None or end + 2 > len(record):
        return bytes(record)
    crc = x25crc(bytes(record[9:end]))
    crc.accumulate(bytes([known.crc_extra]))
    record[end : end + 2] = struct.pack("<H", crc.crc)
    return bytes(record)


def _tlog_values(data: bytes, rng: Rng) -> bytes:
    """Payloads of one to five messages changed, their checksums right."""
    rows = records(data)
    for _ in range(int(rng.integers(1, 6))):
        k = int(rng.integers(len(rows)))
        record = bytearray(rows[k])
        first = 18 if record[8] == 0xFD else 14
        if record[9] == 0:
            continue
        at = first + int(rng.integers(record[9]))
        if rng.random() < 0.5:
            record[at] ^= 1 << int(rng.integers(8))
        else:
            size = min(int(rng.integers(1, 9)), first + record[9] - at)
            record[at : at + size] = (*STRANGE, rng.bytes(8))[int(rng.integers(6))][:size]
        rows[k] = _checked(record)
    return b"".join(rows)


def _tlog_stamps(data: bytes, rng: Rng) -> bytes:
    """Times of reception, which no checksum covers."""
    rows = records(data)
    for _ in range(int(rng.integers(1, 20))):
        k = int(rng.integers(len(rows)))
        record = bytearray(rows[k])
        record[int(rng.integers(8))] ^= 1 << int(rng.integers(8))
        rows[k] = bytes(record)
    return b"".join(rows)


BYTES: tuple[Callable[[bytes, Rng], bytes], ...] = (_flipped, _overwritten, _cut, _spliced)
KINDS: dict[str, tuple[Callable[[bytes, Rng], bytes], ...]] = {
    ".BIN": (*BYTES, _flipped, _binary_shuffled, _binary_values, _binary_values, _binary_format),
    ".log": (*BYTES, _text_shuffled, _text_values, _text_values, _text_values, _text_format),
    ".tlog": (*BYTES, _flipped, _tlog_shuffled, _tlog_values, _tlog_values, _tlog_stamps),
    ".ulg": BYTES,
}
