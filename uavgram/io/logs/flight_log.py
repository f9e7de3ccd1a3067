"""A flight log of any kind, told apart by its content first and its suffix second."""

from __future__ import annotations

from pathlib import Path

from uavgram.errors import InputError
from uavgram.io.inputs import opened
from uavgram.model.flight.log import FlightLog

_DATAFLASH_SUFFIXES = (".bin", ".log")
_DATAFLASH_FORMAT = b"\xa3\x95\x80"  # the first message of a DataFlash file, a format message
_ULOG_FORMAT = b"ULog\x01\x12\x35"
_POSITION_TYPES = {
    "dataflash": "POS, XKF1 with ORGN, or GPS with a 3-D fix",
    "tlog": "GLOBAL_POSITION_INT or GPS_RAW_INT of an autopilot",
    "ulog": "vehicle_global_position, vehicle_local_position with its origin, or GPS",
}


def read_flight_log(path: str | Path, *, positions_needed: bool = True) -> FlightLog:
    """Read a DataFlash log (.bin, .BIN, text .log), a MAVLink .tlog or a PX4 ULog (.ulg).

    Parameters
    ----------
    path
        The file.
    positions_needed
        Refuse a log that never says where the vehicle was.

    Raises
    ------
    InputError
        The file is missing, of no known kind, damaged beyond use, or without positions.
    """
    log = _read(path)
    if positions_needed and all(boot.positions is None for boot in log.boots):
        names = [message.name for message in log.messages]
        held = ", ".join(names[:15]) + (", ..." if len(names) > 15 else "")
        raise InputError(
            path,
            f"holds no usable position ({_POSITION_TYPES[log.kind]}); it holds {held}. "
            "Was it recorded in flight, with GPS?",
        )
    return log


def is_flight_log(path: Path) -> bool:
    """Whether suffix and beginning are those of a flight log: other programs write .log too."""
    suffix = path.suffix.lower()
    if suffix not in (*_DATAFLASH_SUFFIXES, ".tlog", ".ulg"):
        return False
    try:
        head = _head(path)
    except InputError:
        return False
    if suffix == ".ulg":
        return head.startswith(_ULOG_FORMAT)
    if suffix == ".tlog":
        return len(head) > 8 and head[8] in (0xFD, 0xFE)
    return head.startswith(_DATAFLASH_FORMAT) or b"FMT," in head


def _read(path: str | Path) -> FlightLog:
    """By the format's own reader, which alone is loaded: the peers' dialects take their time."""
    suffix = Path(path).suffix.lower()
    head = _head(path)
    if head.startswith(_ULOG_FORMAT) or suffix == ".ulg":
        from uavgram.io.logs.ulog.reader import read_ulog  # noqa: PLC0415

        return read_ulog(path)
    is_dataflash = head.startswith(_DATAFLASH_FORMAT) or b"FMT," in head
    if not is_dataflash:
        _refuse_bare_stream(path, head)
    if is_dataflash or suffix in _DATAFLASH_SUFFIXES:
        from uavgram.io.logs.dataflash.reader import read_dataflash  # noqa: PLC0415

        return read_dataflash(path)
    if suffix == ".tlog" or (len(head) > 8 and head[8] in (0xFD, 0xFE)):
        from uavgram.io.logs.tlog.reader import read_tlog  # noqa: PLC0415

        return read_tlog(path)
    raise InputError(
        path,
        "is no flight log known here: DataFlash .bin or .log of ArduPilot, MAVLink .tlog, PX4 .ulg",
    )


def _refuse_bare_stream(path: str | Path, head: bytes) -> None:
    from uavgram.io.logs.tlog.frames import is_bare_stream  # noqa: PLC0415

    if is_bare_stream(head):
        raise InputError(
            path,
            "is a MAVLink stream without time stamps: nothing says when a message was received, "
            "so photos cannot be matched to it; give the .tlog that the ground station recorded "
            "(each message behind its time), or the autopilot's own .bin",
        )


def _head(path: str | Path) -> bytes:
    with opened(path, "name a flight log") as file:
        return file.read(8000)
