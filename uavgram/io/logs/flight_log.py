"""Reader of flight logs of any kind, recognised by content first and by suffix second."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from uavgram.errors import InputError
from uavgram.input_files import opened
from uavgram.model.flight_log import FlightLog, LogKind

_DATAFLASH_FORMAT = b"\xa3\x95\x80"  # the first message of a DataFlash file, a format message
_ULOG_FORMAT = b"ULog\x01\x12\x35"


@dataclass(frozen=True)
class _Format:
    """A kind of log: its suffixes, test of its first bytes, reader, and messages with positions."""

    suffixes: tuple[str, ...]
    begins: Callable[[bytes], bool]
    read: Callable[[str | Path], FlightLog]
    positions: str


# Each reader is imported on demand, since the dialects load slowly.
def _read_ulog(path: str | Path) -> FlightLog:
    from uavgram.io.logs.ulog.reader import read_ulog  # noqa: PLC0415

    return read_ulog(path)


def _read_dataflash(path: str | Path) -> FlightLog:
    from uavgram.io.logs.dataflash.reader import read_dataflash  # noqa: PLC0415

    return read_dataflash(path)


def _read_tlog(path: str | Path) -> FlightLog:
    from uavgram.io.logs.tlog.reader import read_tlog  # noqa: PLC0415

    return read_tlog(path)


# a file is of the first kind whose first bytes or suffix match
_FORMATS: dict[LogKind, _Format] = {
    "ulog": _Format(
        (".ulg",),
        lambda head: head.startswith(_ULOG_FORMAT),
        _read_ulog,
        "vehicle_global_position, vehicle_local_position with its origin, or GPS",
    ),
    "dataflash": _Format(
        (".bin", ".log"),
        lambda head: head.startswith(_DATAFLASH_FORMAT) or b"FMT," in head,
        _read_dataflash,
        "POS, XKF1 with ORGN, or GPS with a 3-D fix",
    ),
    "tlog": _Format(
        (".tlog",),
        lambda head: len(head) > 8 and head[8] in (0xFD, 0xFE),
        _read_tlog,
        "GLOBAL_POSITION_INT or GPS_RAW_INT of an autopilot",
    ),
}


def read_flight_log(path: str | Path, *, positions_needed: bool = True) -> FlightLog:
    """Read a DataFlash log (.bin, .BIN, text .log), a MAVLink .tlog or a PX4 ULog (.ulg).

    Parameters
    ----------
    path
        The file.
    positions_needed
        Reject a log without positions of the vehicle.

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
            f"holds no usable position ({_FORMATS[log.kind].positions}); it holds {held}. "
            "Was it recorded in flight, with GPS?",
        )
    return log


def is_flight_log(path: Path) -> bool:
    """Return whether suffix and first bytes are a flight log's; other programs use .log too."""
    suffix = path.suffix.lower()
    formats = [known for known in _FORMATS.values() if suffix in known.suffixes]
    try:
        return any(known.begins(_head(path)) for known in formats)
    except InputError:
        return False


LOG_SUFFIXES = tuple(suffix for known in _FORMATS.values() for suffix in known.suffixes)


def find_log_fault(path: Path, *, whole: bool) -> str:
    """Return why a file with the suffix of a flight log cannot be used; empty if it can.

    Parameters
    ----------
    path
        The file; programs other than autopilots write .log and .bin files, too.
    whole
        Whether all of it is read, not the beginning alone.
    """
    try:
        if not _head(path):
            return "is empty: copy it once more"
        if not is_flight_log(path):
            return "does not begin as a flight log does: it is damaged, or of another program"
        if whole:
            read_flight_log(path)
    except InputError as why:
        return why.message
    return ""


def _read(path: str | Path) -> FlightLog:
    suffix = Path(path).suffix.lower()
    head = _head(path)
    # one byte of a telemetry log is weak evidence: a stream without times may have it too
    if not any(known.begins(head) for kind, known in _FORMATS.items() if kind != "tlog"):
        _refuse_bare_stream(path, head)
    for known in _FORMATS.values():
        if known.begins(head) or suffix in known.suffixes:
            return known.read(path)
    raise InputError(
        path,
        "is no flight log known here: DataFlash .bin or .log of ArduPilot, MAVLink .tlog, PX4 .ulg",
    )


def _refuse_bare_stream(path: str | Path, head: bytes) -> None:
    from uavgram.io.logs.tlog.frames import is_bare_stream  # noqa: PLC0415

    if is_bare_stream(head):
        raise InputError(
            path,
            "is a MAVLink stream without time stamps: the times of its messages are unknown, "
            "so photos cannot be matched to it; give the .tlog that the ground station recorded "
            "(each message behind its time), or the autopilot's own .bin",
        )


def _head(path: str | Path) -> bytes:
    with opened(path, "name a flight log") as file:
        return file.read(8000)
