"""A log reader of your own: a made-up text format, read by a class and a table.

Each line is a kind of message, milliseconds since boot, and numbers. The table says which message
and fields hold a quantity, and their factors; the program builds the flight log of it, with all
tests of its quality. In the program, one more line in `uavgram/io/logs/flight_log.py` makes it
known by its suffix.
"""

import numpy as np

from uavgram.io.logs.boots import Table, build_log
from uavgram.io.logs.messages import Messages, Row, Topic
from uavgram.model.flight_log import FlightLog

FIELDS = {
    "place": ("lat_e7", "lon_e7", "alt_cm", "above_home_cm"),
    "angles": ("roll_deg", "pitch_deg", "yaw_deg"),
    "shot": ("number", "confirmed"),
}


class Lines(Messages):
    """The messages of one boot."""

    def __init__(self, text: str) -> None:
        self.rows = [line.split(",") for line in text.splitlines()]

    def read(self, name: str) -> Topic | None:
        """Return the messages of one kind as columns."""
        rows = [np.array(row[1:], dtype=np.float64) for row in self.rows if row[0] == name]
        if not rows:
            return None
        time_ms, *columns = np.stack(rows, axis=1)
        return Topic(name, time_ms * 1e-3, dict(zip(FIELDS[name], columns, strict=True)))


TABLE = Table(
    positions=(Row("place", FIELDS["place"], (1e7, 1e7, 100.0, 100.0)),),
    attitudes=(Row("angles", FIELDS["angles"]),),
    events=(Row("shot", FIELDS["shot"]),),
)

written = "\n".join(
    f"place,{1000 + 100 * k},{634000000 + 27 * k},104000000,15000,4500\n"
    f"angles,{1000 + 100 * k},1.5,-2.0,90.0"
    for k in range(101)
)
written += "\nshot,2000,1,1\nshot,4000,2,1"

empty = FlightLog(path="", kind="tlog", vehicle="", firmware="", messages=(), notes=())
log = build_log(empty, [Lines(written)], TABLE)
boot = log.boots[0]
print("positions:", len(boot.positions.time_boot_s), "from", boot.positions.source)
print("height of the first [m]:", boot.positions.height_m[0])
print("attitudes:", len(boot.attitudes.time_boot_s))
print("photos at [s]:", boot.events.time_boot_s)
