"""QGroundControl's plan file, written from its documentation alone.

https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html (the parts on simple
items and fences); what a simple item without a place has is from MissionItem::save.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=180)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class SimpleItem(_Strict):
    type: Literal["SimpleItem"]
    doJumpId: Annotated[int, Field(ge=1)]  # noqa: N815
    autoContinue: bool  # noqa: N815
    command: Annotated[int, Field(ge=16, le=65535)]
    frame: Annotated[int, Field(ge=0, le=21)]
    params: Annotated[list[float | None], Field(min_length=7, max_length=7)]


class PlacedItem(SimpleItem):
    Altitude: float
    AltitudeMode: Annotated[int, Field(ge=1, le=4)]
    AMSLAltAboveTerrain: float | None


class Mission(_Strict):
    version: Literal[2]
    firmwareType: Literal[3, 12]  # noqa: N815
    vehicleType: int  # noqa: N815
    globalPlanAltitudeMode: Annotated[int, Field(ge=0, le=4)]  # noqa: N815
    cruiseSpeed: float  # noqa: N815
    hoverSpeed: float  # noqa: N815
    plannedHomePosition: tuple[Latitude, Longitude, float]  # noqa: N815
    items: Annotated[list[PlacedItem | SimpleItem], Field(min_length=1)]


class FencePolygon(_Strict):
    version: Literal[1]
    inclusion: bool
    polygon: Annotated[list[tuple[Latitude, Longitude]], Field(min_length=3)]


class GeoFence(_Strict):
    version: Literal[2]
    circles: Annotated[list[float], Field(max_length=0)]
    polygons: list[FencePolygon]


class RallyPoints(_Strict):
    version: Literal[2]
    points: list[tuple[Latitude, Longitude, float]]


class QgcPlan(_Strict):
    fileType: Literal["Plan"]  # noqa: N815
    version: Literal[1]
    groundStation: str  # noqa: N815
    mission: Mission
    geoFence: GeoFence  # noqa: N815
    rallyPoints: RallyPoints  # noqa: N815
