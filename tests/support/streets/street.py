"""A rendered street from a seed: what stands and lies where, the flight over it, its truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from streets.canvas import Canvas, Layer
from streets.flight import Camera, Flight, Kind, View, camera, fly, views
from streets.paint import Markings, bare_ground, markings, surroundings, wear
from streets.relief import ROAD_HALF_M, Relief, draw_relief
from streets.render import SHADE, Look, Renderer, Scene
from streets.solids import Body, car, hidden, house, shadow, wall
from uavgram.model.arrays import Floats

FAMILIES = {
    "4x4_50": cv2.aruco.DICT_4X4_50,
    "36h11": cv2.aruco.DICT_APRILTAG_36h11,
    "25h9": cv2.aruco.DICT_APRILTAG_25h9,
}
MOVER_M_S = 8.0
MOST_TEXELS = 1.3e8
_COLORS = ((40.0, 40, 190), (180.0, 60, 40), (60.0, 120, 30), (200.0, 200, 205), (40.0, 42, 44))


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What street and flight are asked for.

    `plate_m` is the side of the plates' black square; `natural` how many natural points; `moves`
    whether a car drives; `occluded` whether something lies on some plates.
    """

    kind: Kind = "nadir"
    photos: int = 8
    height_m: float = 40.0
    readout_s: float = 0.0
    width_px: int = 2400
    height_px: int = 1800
    natural: int = 60
    plates: int = 6
    plate_m: float = 0.6
    family: str = "4x4_50"
    moves: bool = True
    occluded: bool = False
    blur_px: float = 0.7
    noise: float = 1.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Plate:
    """A coded plate: its id, the corners (4, 3) of its black square as OpenCV orders them."""

    number: int
    corner: Floats
    shadowed: bool
    occluded: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Street:
    """A street with its flight; all in the street frame (s along the road, t left, z up).

    Points have labels by their kind: P natural points on textured ground, Q on weak ground, Z
    corners of zebra stripes, D of dashes, V of cars, W of walls and houses, R discs, G chequers.
    """

    wish: Wish
    seed: int
    scene: Scene
    flight: Flight
    camera: Camera
    label: tuple[str, ...]
    point: Floats
    plates: tuple[Plate, ...]
    mover: Body | None
    gain: Floats

    @cached_property
    def view(self) -> tuple[View, ...]:
        return views(self.flight, self.camera)

    def movers(self, photo: int) -> tuple[Body, ...]:
        """The driving car, where it is in a photo."""
        if self.mover is None:
            return ()
        middle = self.flight.exposure_s.mean()
        by = np.array([MOVER_M_S * (self.flight.exposure_s[photo] - middle), 0.0, 0.0])
        by[2] = self.scene.relief.up((self.mover.corner.mean(axis=0) + by)[:2])[0] - float(
            self.scene.relief.up(self.mover.corner.mean(axis=0)[:2])[0]
        )
        return (self.mover.moved(by),)

    def sighted(self, photo: int, point: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Exact pixels (n, 2) of points (n, 3) in a photo, and whether each is visible."""
        view = self.view[photo]
        pixel = view.pixels(point)
        size = np.array([self.camera.width_px, self.camera.height_px])
        with np.errstate(invalid="ignore"):
            seen = np.asarray(((pixel > 3) & (pixel < size - 4)).all(axis=1))
        center, _ = view.poses(np.nan_to_num(pixel[:, 1]))
        seen &= ~hidden(point, center, (*self.scene.bodies, *self.movers(photo)))
        return pixel, seen

    def photos(self) -> Iterator[NDArray[np.uint8]]:
        """Render all photos, one after the other."""
        renderer = Renderer(self.scene, self.camera)
        for k, view in enumerate(self.view):
            look = Look(blur_px=self.wish.blur_px, gain=float(self.gain[k]), noise=self.wish.noise)
            yield renderer.photo(view, look, self.movers(k), self.seed * 1000 + k)


def draw_street(seed: int, wish: Wish | None = None) -> Street:
    """Draw a street, its things, a camera and a flight."""
    wish = wish or Wish()
    rng = np.random.default_rng((1607, seed))
    taken_by = camera(wish.width_px, wish.height_px, wish.readout_s, rng)
    flight = fly(wish.kind, wish.photos, wish.height_m, rng)
    half_s, half_t = _halves(flight, wish)
    texel = 0.5 * wish.height_m / taken_by.lens[0]
    texel = max(texel, float(np.sqrt(4 * half_s * half_t / MOST_TEXELS)))
    beyond = 5.0 * wish.height_m
    relief = draw_relief(rng, half_s + beyond, half_t + beyond)
    canvas, weak = bare_ground(rng, half_s, half_t, texel)
    wear(canvas, rng, half_s)
    zebra, dash, zebra_s = markings(canvas, rng, half_s)
    marks = Markings(zebra=zebra, dash=dash, weak=weak, zebra_from_m=float(zebra_s[0]))
    reach = min(half_s, 0.5 * wish.height_m + 8.0)
    bodies, mover = _things(canvas, relief, rng, reach)
    sun = np.array([0.45, -0.5, 0.9]) / np.linalg.norm([0.45, -0.5, 0.9])
    points: dict[str, list[Floats]] = {kind: [] for kind in "PQZDVWRG"}
    for body in bodies:
        points.get(body.kind, []).extend(body.corner)
    points["R"], points["G"] = _targets(canvas, rng, reach)
    plates = _plates(canvas, relief, rng, (reach, wish, bodies))
    for body in bodies:
        ground = float(relief.up(body.corner[:, :2].mean(axis=0))[0])
        canvas.shade([shadow(solid, ground, sun) for solid in body.solids], SHADE)
    points["Z"] = list(marks.zebra)
    points["D"] = [p for p in marks.dash if abs(p[0]) < half_s - 1]
    points["P"], points["Q"] = _natural(canvas, rng, (wish, half_s, taken_by), marks)
    label, place = [], []
    for kind, found in points.items():
        for k, p in enumerate(found):
            label.append(f"{kind}{k + 1}")
            place.append(p if len(p) == 3 else np.array([*p, relief.up(p)[0]]))
    fine = canvas.layer
    levels = (fine, fine.halved(), fine.halved().halved(), surroundings(rng, fine, beyond))
    skin = cv2.GaussianBlur(rng.standard_normal((512, 512)).astype("f4"), (0, 0), 2.0)
    scene = Scene(
        levels=levels, relief=relief, bodies=bodies, sun=sun, skin=np.asarray(skin / skin.std())
    )
    return Street(
        wish=wish,
        seed=seed,
        scene=scene,
        flight=flight,
        camera=taken_by,
        label=tuple(label),
        point=np.array(place),
        plates=plates,
        mover=mover if wish.moves else None,
        gain=rng.uniform(0.8, 1.2, wish.photos),
    )


def _halves(flight: Flight, wish: Wish) -> tuple[float, float]:
    """Half sizes of what is painted finely: what the photos see well."""
    center, rotation = flight.center(flight.exposure_s), flight.rotation(flight.exposure_s)
    axis = rotation.apply([0.0, 0, 1])
    met = center[:, :2] - axis[:, :2] / axis[:, 2:] * center[:, 2:]
    s, t = np.abs(met).max(axis=0) + np.array([0.65, 0.65]) * wish.height_m
    return float(np.ceil(s)), float(max(np.ceil(min(t, 60.0)), 14.0))


def _things(
    canvas: Canvas, relief: Relief, rng: np.random.Generator, reach: float
) -> tuple[tuple[Body, ...], Body]:
    """Cars, a house, a garden wall, poles; and a car that drives."""

    def on(s: float, t: float) -> Floats:
        return np.array([s, t, relief.up(np.array([s, t]))[0]])

    bodies: list[Body] = []
    for _ in range(40):
        s = rng.uniform(-reach, reach)
        parked = rng.random() < 0.7
        t = 2.9 * rng.choice([-1, 1]) if parked else 1.9  # the other lane is the driving car's
        turn = rng.normal(0, 0.03) if parked else rng.uniform(0, 2 * np.pi)
        if len(bodies) < 5 and canvas.free(np.array([s, t]), 2.6):
            bodies.append(car(on(s, float(t)), float(turn), _COLORS[len(bodies) % 5]))
            canvas.busy.append((s, float(t), 2.6))
    home = on(rng.uniform(-0.3, 0.3) * reach, 13.0)
    bodies.append(house(home, float(rng.normal(0, 0.05))))
    canvas.busy.append((home[0], home[1], 5.5))
    along = on(rng.uniform(-0.3, 0.3) * reach, -8.0)
    bodies.append(wall(along, float(rng.normal(0, 0.03)), 10.0, 0.25, 1.2))
    canvas.busy += [(along[0] + x, -8.0, 1.5) for x in (-4.0, -2.0, 0.0, 2.0, 4.0)]
    for k in (-0.5, 0.1, 0.6):
        pole = on(k * reach, 4.6)
        bodies.append(replace(wall(pole, 0.0, 0.14, 0.14, 5.0), kind="pole"))
        canvas.busy.append((pole[0], pole[1], 0.4))
    mover = car(on(0.0, -1.2), 0.0, (230.0, 160, 60))
    return tuple(bodies), mover


def _somewhere(canvas: Canvas, rng: np.random.Generator, reach: float, radius: float) -> Floats:
    """A free place on the road, the footpaths or the grass beside them, clear of kerbs."""
    place = np.zeros(2)
    for _ in range(300):
        place = np.array([rng.uniform(-reach, reach), rng.uniform(-9.0, 9.0)])
        clear = abs(abs(place[1]) - ROAD_HALF_M) > radius + 0.45
        if clear and canvas.free(place, radius + 0.15):
            break
    return place


def _targets(
    canvas: Canvas, rng: np.random.Generator, reach: float
) -> tuple[list[Floats], list[Floats]]:
    """Discs and chequers."""
    discs, chequers = [], []
    for _ in range(8):
        place = _somewhere(canvas, rng, reach, 0.3)
        canvas.disc(place, ((0.25, 30.0), (0.20, 225.0), (0.07, 30.0)))
        discs.append(place)
    cells = np.array([[30, 225], [225, 30]], np.uint8)
    for _ in range(4):
        place = _somewhere(canvas, rng, reach, 0.45)
        canvas.pattern(place, float(rng.uniform(0, 2 * np.pi)), 0.5, cells)
        chequers.append(place)
    return discs, chequers


def _plates(
    canvas: Canvas,
    relief: Relief,
    rng: np.random.Generator,
    about: tuple[float, Wish, tuple[Body, ...]],
) -> tuple[Plate, ...]:
    """Coded plates on the ground, with a white rim; the first lies where a pole's shadow falls."""
    reach, wish, bodies = about
    coded = cv2.aruco.getPredefinedDictionary(FAMILIES[wish.family])
    modules = coded.markerSize + 2
    poles = [b for b in bodies if b.kind == "pole"]
    plates = []
    for k in range(wish.plates):
        side = wish.plate_m * (modules + 2) / modules
        place = _somewhere(canvas, rng, reach, 0.75 * side)
        if k == 0 and poles:  # two metres down the shadow
            place = poles[0].corner[:, :2].mean(axis=0) - 2.0 * np.array([0.45, -0.5]) / 0.67
        number = 3 * k + 1
        cells = np.full((modules + 2, modules + 2), 235, np.uint8)
        drawn = cv2.aruco.generateImageMarker(coded, number, modules)
        cells[1:-1, 1:-1] = np.where(drawn > 0, 235, 25)
        outer = canvas.pattern(place, float(rng.uniform(0, 2 * np.pi)), side, cells)
        corner = place + (outer - place) * (modules / (modules + 2))
        covered = wish.occluded and k == 1
        if covered:
            canvas.disc(corner[0] * 0.8 + place * 0.2, ((0.25 * wish.plate_m, 120.0),))
        plates.append(
            Plate(
                number=number,
                corner=np.column_stack([corner, relief.up(corner)]),
                shadowed=k == 0,
                occluded=covered,
            )
        )
    return tuple(plates)


def _natural(
    canvas: Canvas,
    rng: np.random.Generator,
    about: tuple[Wish, float, Camera],
    marks: Markings,
) -> tuple[list[Floats], list[Floats]]:
    """Corners of the texture as a person would pick them: on textured ground, on weak asphalt."""
    wish, half_s, taken_by = about
    layer = canvas.layer
    pixel_m = wish.height_m / taken_by.lens[0]
    shrunk = max(pixel_m / layer.texel_m, 1.0)
    low = cv2.resize(layer.grey, None, fx=1 / shrunk, fy=1 / shrunk, interpolation=cv2.INTER_AREA)
    score = cv2.cornerMinEigenVal(low, 5)
    texel = layer.texel_m * layer.grey.shape[1] / low.shape[1]
    flat = Layer(grey=np.asarray(low, np.uint8), s_m=layer.s_m, t_m=layer.t_m, texel_m=texel)
    textured: list[Floats] = []
    weak: list[Floats] = []
    reach = round(0.7 / texel)
    for _ in range(60 * wish.natural):
        if len(textured) >= wish.natural and len(weak) >= wish.natural // 5:
            break
        place = np.array([rng.uniform(-half_s + 2, half_s - 2), rng.uniform(-11.0, 11.0)])
        u, v = (int(x[0]) for x in flat.texels(*place.astype("f4").reshape(2, 1)))
        v0, u0 = max(v - reach, 8), max(u - reach, 8)
        near = score[v0 : v + reach, u0 : u + reach]
        if not near.size or v + reach > low.shape[0] - 8 or u + reach > low.shape[1] - 8:
            continue
        row, column = np.unravel_index(int(near.argmax()), near.shape)
        at = np.array([u0 + column, v0 + row])
        place = (
            np.array([layer.s_m + (at[0] + 0.5) * texel, layer.t_m - (at[1] + 0.5) * texel])
            + rng.uniform(-0.5, 0.5, 2) * texel
        )
        patch = low[at[1] - 8 : at[1] + 9, at[0] - 8 : at[0] + 9]
        if not canvas.free(place, 0.35) or abs(abs(place[1]) - ROAD_HALF_M) < 0.45:
            continue
        if _on_marking(place):
            continue
        if any(a < place[0] < b and c < place[1] < d for a, b, c, d in marks.weak):
            if patch.std() < 6 and len(weak) < wish.natural // 5:
                weak.append(place)
                canvas.busy.append((*place.tolist(), 0.3))
        elif patch.std() > 5 and len(textured) < wish.natural:
            textured.append(place)
            canvas.busy.append((*place.tolist(), 0.3))
    return textured, weak


def _on_marking(place: Floats) -> bool:
    return bool(min(abs(place[1]), abs(abs(place[1]) - ROAD_HALF_M + 0.25)) < 0.35)
