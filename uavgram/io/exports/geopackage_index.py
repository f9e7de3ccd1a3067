"""Spatial indices of a GeoPackage, for programs that show a part of many shapes.

OGC 12-128r18 (GeoPackage 1.3), annex F.3, "RTree Spatial Indexes". The triggers keep an index up to
date in programs that edit the file; they call functions which those programs have.
"""

from __future__ import annotations

import sqlite3
from math import isnan

from uavgram.model.arrays import Floats

_EXTENSIONS = """
CREATE TABLE IF NOT EXISTS gpkg_extensions (
    table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL, definition TEXT NOT NULL,
    scope TEXT NOT NULL, CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name)
)
"""
_DEFINITION = "http://www.geopackage.org/spec120/#extension_rtree"
_HAS_PLACE = 'NEW."geom" NOT NULL AND NOT ST_IsEmpty(NEW."geom")'
_HAS_NONE = 'NEW."geom" ISNULL OR ST_IsEmpty(NEW."geom")'
_ENTER = (
    'INSERT OR REPLACE INTO {index} VALUES (NEW."fid", ST_MinX(NEW."geom"), ST_MaxX(NEW."geom"), '
    'ST_MinY(NEW."geom"), ST_MaxY(NEW."geom"));'
)
_STRIKE = 'DELETE FROM {index} WHERE id = OLD."fid";'
_SAME, _OTHER = 'OLD."fid" = NEW."fid"', 'OLD."fid" != NEW."fid"'
_TRIGGERS = {
    "insert": ("INSERT", _HAS_PLACE, _ENTER),
    "update1": ('UPDATE OF "geom"', f"{_SAME} AND ({_HAS_PLACE})", _ENTER),
    "update2": ('UPDATE OF "geom"', f"{_SAME} AND ({_HAS_NONE})", _STRIKE),
    "update3": ("UPDATE", f"{_OTHER} AND ({_HAS_PLACE})", f"{_STRIKE} {_ENTER}"),
    "update4": (
        "UPDATE",
        f"{_OTHER} AND ({_HAS_NONE})",
        'DELETE FROM {index} WHERE id IN (OLD."fid", NEW."fid");',
    ),
    "delete": ("DELETE", 'OLD."geom" NOT NULL', _STRIKE),
}
"""Triggers by the ends of their names: event, condition, and action."""


def write_index(file: sqlite3.Connection, table: str, bounds: Floats) -> None:
    """Index the column ``geom`` of a filled table; later rows are indexed only by the triggers.

    Parameters
    ----------
    file
        The GeoPackage. It stays unchanged if this SQLite was built without R-trees: a file without
        an index is valid too, only slower.
    table
        The layer.
    bounds
        (N, 4) west, east, south, north of its rows in their order, the first with ``fid`` 1; NaN
        for those without a position.
    """
    if file.execute("SELECT 1 FROM pragma_module_list WHERE name = 'rtree'").fetchone() is None:
        return
    index, own = quoted(f"rtree_{table}_geom"), quoted(table)
    file.execute(_EXTENSIONS)
    file.execute(
        "INSERT INTO gpkg_extensions VALUES (?, 'geom', 'gpkg_rtree_index', ?, 'write-only')",
        (table, _DEFINITION),
    )
    file.execute(f"CREATE VIRTUAL TABLE {index} USING rtree(id, minx, maxx, miny, maxy)")
    rows = [(fid, *row) for fid, row in enumerate(bounds.tolist(), start=1) if not isnan(row[0])]
    file.executemany(f"INSERT INTO {index} VALUES (?, ?, ?, ?, ?)", rows)  # noqa: S608 - quoted
    for end, (after, when, what) in _TRIGGERS.items():
        name = quoted(f"rtree_{table}_geom_{end}")
        file.execute(
            f"CREATE TRIGGER {name} AFTER {after} ON {own} WHEN {when} "
            f"BEGIN {what.format(index=index)} END"
        )


def quoted(name: str) -> str:
    """Quote the name of a table or a column for SQL."""
    return '"' + name.replace('"', '""') + '"'
