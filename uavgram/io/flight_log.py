"""A flight log of any kind, told apart by its content first and its suffix second."""

from __future__ import annotations

from pathlib import Path

from uavgram.errors import InputError
from uavgram.io.dataflash import read_dataflash
from uavgram.io.tlog import read_tlog
from uavgram.model.telemetry import FlightLog

_DATAFLASH_SUFFIXES = (".bin", ".log")
_DATAFLASH_FORMAT = b"\xa3\x95\x80"  # the first message of a DataFlash file, a format message
_ULOG_MAGIC = b"ULog\x01\x12\x35"


def read_flight_log(path: str | Path) -> FlightLog:
    """Read a DataFlash log (.bin, .BIN, text .log) or a MAVLink telemetry log (.tlog).

    Raises
    ------
    InputError
        The file is missing, of no known kind, damaged beyond use, or without positions.
    """
    suffix = Path(path).suffix.lower()
    head = _head(path)
    if head.startswith(_ULOG_MAGIC) or suffix == ".ulg":
        raise InputError(path, "is a PX4 ULog, which this version does not read; give a .tlog")
    if head.startswith(_DATAFLASH_FORMAT) or b"FMT," in head or suffix in _DATAFLASH_SUFFIXES:
        return read_dataflash(path)
    if suffix == ".tlog" or (len(head) > 8 and head[8] in (0xFD, 0xFE)):
        return read_tlog(path)
    raise InputError(
        path, "is no flight log known here: DataFlash .bin or .log of ArduPilot, MAVLink .tlog"
    )


def _head(path: str | Path) -> bytes:
    try:
        with Path(path).open("rb") as file:
            return file.read(8000)
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
