"""Cars seen from straight above, drawn flat on the ground."""

from __future__ import annotations

import numpy as np

from uavgram.imaging.raster import GroundRaster, Image, Painter, lay, soften
from uavgram.model.arrays import Floats
from uavgram.model.scenario.road import Vehicle

RESOLUTION_M = 0.01
MARGIN_M = 1.2
SHADOW_M = (-0.4, -0.55)  # where a car's shadow falls, in the scene

GLASS = (52, 46, 40, 255)
GLARE = (196, 186, 176, 255)
DARK = (22, 22, 24, 255)
LAMP = (228, 236, 240, 255)
TAIL = (40, 36, 190, 255)


def vehicle_raster(vehicle: Vehicle) -> GroundRaster:
    """Draw one car with its shadow: BGRA, colours multiplied by alpha."""
    half = 0.5 * np.hypot(vehicle.length_m, vehicle.width_m) + MARGIN_M
    size = int(np.ceil(2 * half / RESOLUTION_M))
    raster = GroundRaster(
        image=np.zeros((size, size, 4), np.uint8),
        x_top_m=vehicle.x_m + half,
        y_left_m=vehicle.y_m + half,
        resolution_m=RESOLUTION_M,
    )
    _draw(raster.image, Painter(raster), vehicle)
    return raster


def _draw(image: Image, painter: Painter, vehicle: Vehicle) -> None:
    body = _outline(vehicle)
    shadow = painter.polygons(body + np.array(SHADOW_M), body + 0.5 * np.array(SHADOW_M))
    lay(image, (8, 8, 10, 255), soften(shadow, 7), 0.62)
    wheels = [_part(vehicle, (f - 0.07, f + 0.07), (s - 0.03, s + 0.03))
              for f in (-0.3, 0.3) for s in (-0.475, 0.475)]  # fmt: skip
    lay(image, DARK, painter.polygons(*wheels))
    paint = vehicle.color_rgb[::-1]
    lay(image, _shade(paint, 0.5), painter.polygons(body))
    # Sheet metal rounds off towards its edge.
    for inset, light in ((0.965, 0.75), (0.925, 0.92), (0.87, 1.0)):
        lay(image, _shade(paint, light), painter.polygons(_outline(vehicle, inset)))
    for side in (-1, 1):
        crease = _part(vehicle, (0.2, 0.46), (side * 0.22 - 0.006, side * 0.22 + 0.006))
        lay(image, _shade(paint, 1.35), painter.polygons(crease), 0.7)
    mirrors = [_quad(vehicle, (0.16, s * 0.5), (0.19, s * 0.5), (0.18, s * 0.6), (0.15, s * 0.6))
               for s in (-1, 1)]  # fmt: skip
    lay(image, _shade(paint, 0.8), painter.polygons(*mirrors))
    _glass(image, painter, vehicle, paint)
    lamp = _part(vehicle, (0.455, 0.485), (-0.42, -0.28))  # the other one is broken
    lay(image, LAMP, painter.polygons(lamp), 0.9)
    tails = [_part(vehicle, (-0.49, -0.47), (s * 0.34 - 0.07, s * 0.34 + 0.07)) for s in (-1, 1)]
    lay(image, TAIL, painter.polygons(*tails), 0.9)


def _glass(image: Image, painter: Painter, vehicle: Vehicle, paint: tuple[int, ...]) -> None:
    windscreen = _quad(vehicle, (0.07, -0.36), (0.2, -0.43), (0.2, 0.43), (0.07, 0.36))
    rear = _quad(vehicle, (-0.3, -0.33), (-0.39, -0.4), (-0.39, 0.4), (-0.3, 0.33))
    sides = [
        _quad(vehicle, (0.16, s * 0.435), (0.06, s * 0.385), (-0.28, s * 0.36), (-0.34, s * 0.42))
        for s in (-1, 1)
    ]
    lay(image, GLASS, painter.polygons(windscreen, rear, *sides), 0.95)
    glare = _quad(vehicle, (0.09, -0.2), (0.19, -0.36), (0.19, -0.2), (0.09, -0.1))
    lay(image, GLARE, soften(painter.polygons(glare), 4), 0.5)
    roof = _part(vehicle, (-0.28, 0.05), (-0.34, 0.34))
    lay(image, _shade(paint, 1.12), painter.polygons(roof))
    shine = _part(vehicle, (-0.24, 0.02), (0.06, 0.26))
    lay(image, _shade(paint, 1.7), soften(painter.polygons(shine), 12), 0.4)


def _shade(color: tuple[int, ...], light: float) -> tuple[int, ...]:
    # Highlights go towards white: a lamp on red paint is not redder.
    lifted = [min(255.0, c * light + max(0.0, light - 1.0) * 90.0) for c in color]
    return (*(round(c) for c in lifted), 255)


def _outline(vehicle: Vehicle, inset: float = 1.0) -> Floats:
    """Body (72, 2) in the scene: a superellipse, its front pushed in on one corner."""
    angle = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    ahead = 0.5 * np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.36
    side = 0.5 * np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** 0.3
    dent = np.exp(-((ahead - 0.5) ** 2) / 0.006 - (side - 0.35) ** 2 / 0.05)
    ripple = 1.0 + 0.5 * np.sin(23.0 * side)
    return _place(vehicle, np.column_stack([ahead - 0.055 * dent * ripple, side]) * inset)


def _part(vehicle: Vehicle, ahead: tuple[float, float], side: tuple[float, float]) -> Floats:
    """Rectangle (4, 2), in parts of the car's length and width."""
    (a0, a1), (s0, s1) = ahead, side
    return _place(vehicle, np.array([[a0, s0], [a1, s0], [a1, s1], [a0, s1]]))


def _quad(vehicle: Vehicle, *corners: tuple[float, float]) -> Floats:
    return _place(vehicle, np.array(corners))


def _place(vehicle: Vehicle, parts: Floats) -> Floats:
    """Scene coordinates (K, 2) of (K, 2) parts of the car's length (ahead) and width (left)."""
    c, s = np.cos(np.deg2rad(vehicle.heading_deg)), np.sin(np.deg2rad(vehicle.heading_deg))
    body = parts * [vehicle.length_m, vehicle.width_m]
    placed: Floats = body @ np.array([[c, s], [-s, c]]) + [vehicle.x_m, vehicle.y_m]
    return placed
