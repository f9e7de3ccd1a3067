"""Layout of the recording when it opens."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun.blueprint as rrb

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.views.formatting import axes_text
from uavgram.views.recording.curves import (
    PLOTS,
    STATUS,
    FrameCurves,
    Plot,
    PoseCurves,
    list_plots,
)
from uavgram.views.recording.legend import LEGEND
from uavgram.views.recording.pages import (
    CHECKS,
    FRAME_SHEET,
    HEIGHTS,
    LENGTHS,
    MEASURED,
    MESSAGES,
    POINTS,
    SUMMARY,
    messages_title,
)
from uavgram.views.recording.photo import NAME_ABOVE, OVERLAYS, PHOTO
from uavgram.views.recording.points import CLOSE_UP, ELLIPSOIDS, RULERS, SIDE_TEXTS
from uavgram.views.recording.scene import Eye, Scene
from uavgram.views.recording.stream import FRAME_TIMELINE
from uavgram.views.recording.survey import ALL, CURRENT, GAP, MAP, PROFILES, has_map, opening_height
from uavgram.views.style import Rgb
from uavgram.views.survey.heights import WIDTH
from uavgram.views.survey.key_facts import frame_counts
from uavgram.views.units import units_of

BACKGROUND: Rgb = (13, 16, 17)
NORTH_UP = (0, 1, 0)
# A map tile of zoom 0 is 256 pixels of the equator wide.
METRES_PER_PIXEL_AT_ZOOM_0 = 40_075_016.7 / 256
MAP_PX = 300
MAX_ZOOM = 19.0
PHOTO_MARGIN = 0.01
# Height of the eye above the worst point, in half axes of its ellipse.
EYE_ABOVE = 6.0
# The photo's own drawings belong to the photo view, not to the space view.
_NOT_IN_SPACE = [f"- {PHOTO}/{name}/**" for name in OVERLAYS]


def blueprint(
    result: Result, scene: Scene, curves: FrameCurves, poses: PoseCurves
) -> rrb.Blueprint:
    """Lay out an overview of eight views, and details: only views that have something to show.

    Parameters
    ----------
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    curves, poses
        Curves over the frames, for the ranges of the plots.
    """
    overview = rrb.Horizontal(
        rrb.Vertical(
            rrb.Tabs(_survey(scene), _plan(scene), active_tab=0),
            legend_view(),
            row_shares=[10, 1.1],
        ),
        rrb.Vertical(
            _photo(result, scene),
            rrb.StateTimelineView(origin=STATUS, name=frame_counts(result)),
            page_views(
                (SUMMARY, "Summary"), (MEASURED, "Measured"), (MESSAGES, messages_title(result))
            ),
            row_shares=[5.9, 1.15, 4.7],
        ),
        column_shares=[1.3, 1],
        name="Overview",
    )
    places = _places(result, scene)
    # a curve through one frame shows nothing
    is_flight = len(result.frames.frame_id) > 1
    plots = [_plots(list_plots(result, curves, poses))] if is_flight else []
    drawn = [*([rrb.Tabs(*places, active_tab=0)] if places else []), *plots]
    details = rrb.Horizontal(
        *([rrb.Vertical(*drawn)] if drawn else []),
        page_views(
            *((FRAME_SHEET, "Frame"), (LENGTHS, "Lengths"), (CHECKS, "Checks"), (POINTS, "Points")),
            *([(HEIGHTS, "Heights")] if result.points.is_off_ground.any() else []),
        ),
        column_shares=[1.3, 1][-2 if drawn else -1 :],
        name="Details",
    )
    return layout(rrb.Tabs(overview, details, active_tab=0))


def layout(views: rrb.Container) -> rrb.Blueprint:
    """Make a blueprint with Rerun's own panels folded away and one time step for each photo."""
    return rrb.Blueprint(
        views,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=FRAME_TIMELINE, fps=2, play_state="paused"),
        auto_views=False,
        auto_layout=False,
    )


def legend_view() -> rrb.Spatial2DView:
    """Show the legend."""
    return rrb.Spatial2DView(origin=LEGEND, name="Legend", titlebar=False, background=BACKGROUND)


def picture_view(
    origin: str, name: str, x: tuple[float, float], y: tuple[float, float]
) -> rrb.Spatial2DView:
    """Show a drawing in a plane.

    Parameters
    ----------
    origin, name
        Its entity, and title of the view.
    x, y
        Bounds to the left and right, above and below.
    """
    bounds = rrb.VisualBounds2D(x_range=x, y_range=y)
    return rrb.Spatial2DView(origin=origin, name=name, background=BACKGROUND, visual_bounds=bounds)


def _photo(result: Result, scene: Scene) -> rrb.Spatial2DView:
    """Show the photo with a margin for its edges and its name."""
    alone = ", flight log alone orange" if result.has_seed.any() else ""
    name = f"Photo: picks white, residuals (drawn ×{scene.residual_factor}) blue{alone}"
    width, height = result.camera.width_px, result.camera.height_px
    edge = PHOTO_MARGIN * width
    return picture_view(PHOTO, name, (-edge, width + edge), (-NAME_ABOVE * height, height + edge))


def _places(result: Result, scene: Scene) -> list[rrb.View]:
    """List the views of the ground other than those of the overview."""
    views: list[rrb.View] = []
    if scene.side_eye is not None:
        views.append(_from_the_side(scene.side_eye))
    if result.profiles.profile:
        bounds = (0.0, WIDTH), (-GAP, opening_height(result))
        views.append(picture_view(PROFILES, "Profiles", *bounds))
    if scene.worst_point is not None:
        views.append(_worst_point(result, scene.worst_point))
    if has_map(result):
        views.append(rrb.MapView(origin=MAP, name="Map", zoom=_zoom(result, scene)))
    return views


def page_views(*pages: tuple[str, str]) -> rrb.Tabs:
    """Lay out documents: their entities and names."""
    views = [rrb.TextDocumentView(origin=origin, name=name) for origin, name in pages]
    return rrb.Tabs(*views, active_tab=0)


def _survey(scene: Scene) -> rrb.Spatial3DView:
    filled = [] if scene.fill_ellipses else ["- /survey/points/ellipse_95_true_size/**"]
    contents = ["+ /survey/**", "- /survey/point_names/**", f"- /{ALL}", *filled, *_NOT_IN_SPACE]
    name = "Survey, north away from you; white: this photo"
    return space_view(name, contents, scene.eye.position_m, scene.eye.target_m, up=(0, 0, 1))


def _from_the_side(eye: Eye) -> rrb.Spatial3DView:
    """Make a level view from the side, which shows heights."""
    shown = ("survey/ground/**", "survey/points/picked", f"{RULERS}/**", f"{SIDE_TEXTS}/**")
    contents = [f"+ /{one}" for one in (*shown, f"{ELLIPSOIDS}_true_size/**")]
    name = f"From the side, looking {eye.heading}"
    return space_view(name, contents, eye.position_m, eye.target_m, up=(0, 0, 1))


def space_view(
    name: str,
    contents: Sequence[str],
    position: Floats,
    target: Floats,
    *,
    up: Sequence[float] | Floats = NORTH_UP,
    origin: str = "/",
) -> rrb.Spatial3DView:
    """Make a view of a scene in space.

    Parameters
    ----------
    name
        Title of the view.
    contents
        Its contents, as Rerun's expressions.
    position, target
        (3,) places of the eye and of its target.
    up
        Direction that is up on the screen.
    origin
        Entity whose space it is.
    """
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=up
    )
    return rrb.Spatial3DView(
        origin=origin,
        contents=contents,
        name=name,
        background=BACKGROUND,
        line_grid=False,
        eye_controls=eye,
    )


def _plots(rows: dict[str, list[Plot]]) -> rrb.Tabs:
    """Lay out a tab for each row of plots."""
    return rrb.Tabs(
        *(
            rrb.Horizontal(
                *(plot(f"{PLOTS}/{one.path}", one.title, one.values) for one in plots), name=title
            )
            for title, plots in rows.items()
        ),
        active_tab=0,
    )


def plot(origin: str, name: str, values: Floats) -> rrb.TimeSeriesView:
    """Make a plot that begins at zero, so that small values look small.

    Parameters
    ----------
    origin
        Entity of the curves.
    name
        Title of the plot, with the unit.
    values
        (n,) values of all curves, for the range; NaN if not known.
    """
    known = values[np.isfinite(values)]
    top = 1.15 * float(known.max()) if len(known) else 1.0
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_y=rrb.ScalarAxis(range=(0.0, max(top, 1e-3))),
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _plan(scene: Scene) -> rrb.Spatial3DView:
    eye = scene.top_eye
    filled = [] if scene.fill_ellipses else ["- /survey/points/ellipse_95_true_size/**"]
    known = ("known_lengths/**", "lines_of_known_position/**")
    shown = ("ground/**", "points/**", *known, "measured/**", "point_names/**")
    contents = [*(f"+ /survey/{one}" for one in shown), f"+ /{ALL}", f"+ /{CURRENT}", *filled]
    return space_view("Top view, north up", contents, eye.position_m, eye.target_m)


def _worst_point(result: Result, row: int) -> rrb.Spatial3DView:
    spot = result.points.position_world_m[row]
    axes = result.points.relative.ellipse_95_m[row]
    position = spot + np.array([0.0, 0.0, EYE_ABOVE * axes[0]])
    shown = ("ground/**", "points/picked", "points/ellipse_95_true_size/**")
    contents = [*(f"+ /survey/{one}" for one in shown), f"+ /{CLOSE_UP}/**"]
    size = axes_text(axes, units_of(result))
    name = f"Worst point {result.points.label[row]}, true scale: {size}"
    return space_view(name, contents, position, spot)


def _zoom(result: Result, scene: Scene) -> float:
    """Return the zoom of a map on which the scene is MAP_PX pixels wide."""
    latitude = np.radians(float(np.nanmean(result.points.latitude_deg)))
    metres_per_pixel = METRES_PER_PIXEL_AT_ZOOM_0 * np.cos(latitude)
    return float(np.clip(np.log2(metres_per_pixel * MAP_PX / scene.size_m), 1.0, MAX_ZOOM))
