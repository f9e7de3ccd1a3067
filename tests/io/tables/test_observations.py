"""picks.csv, lines.csv, measure.csv, control.csv: what they give, and what they refuse."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.io.tables.known import read_known_points, read_lines
from uavgram.io.tables.measure import read_measure
from uavgram.io.tables.picks import read_picks

Write = Callable[[str], Path]

PICKS = "image,label,u_px,v_px,sigma_px,height_m\n"
HEIGHTS = "image,label,u_px,v_px,height_m,height_sigma_m\n"
LINES = "name,from,to,length_m,sigma_m,use\n"
MEASURE = "name,kind,points,parameters\n"
GEODETIC = "label,latitude_deg,longitude_deg,height_m,sigma_m\n"
LOCAL = "label,east_m,north_m,up_m,sigma_east_m,sigma_north_m,sigma_up_m\n"


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def _write(content: str) -> Path:
        path = tmp_path / "table.csv"
        path.write_text(content)
        return path

    return _write


def test_picks_arrive_with_their_own_sigmas_and_heights(write: Write) -> None:
    picks = read_picks(write(PICKS + "a.jpg,P,1.5,2,,\nb.jpg,P,3,4,0.5,0.2\n"))

    assert picks.image == ("a.jpg", "b.jpg")
    assert picks.label == ("P", "P")
    np.testing.assert_array_equal(picks.pixel_px, [[1.5, 2], [3, 4]])
    np.testing.assert_array_equal(picks.sigma_px, [np.nan, 0.5])
    np.testing.assert_array_equal(picks.height_m, [np.nan, 0.2])


def test_a_height_may_be_free_or_have_a_sigma(write: Write) -> None:
    rows = "a.jpg,P,1,2,Free,\nb.jpg,P,3,4,free,\na.jpg,Q,5,6,1.4,0.02\nb.jpg,Q,5,6,,\n"
    picks = read_picks(write(HEIGHTS + rows))

    assert picks.is_free.tolist() == [True, True, False, False]
    np.testing.assert_array_equal(picks.height_m, [np.nan, np.nan, 1.4, np.nan])
    np.testing.assert_array_equal(picks.height_sigma_m, [np.nan, np.nan, 0.02, np.nan])


def test_picks_arrive_with_their_area_and_their_line(write: Write) -> None:
    picks = read_picks(write("area,image,label,u_px,v_px\n,a.jpg,P,1,2\n\nverge,b.jpg,P,3,4\n"))

    assert picks.area == ("", "verge")
    assert picks.line == (2, 4)
    assert picks.line_of(1) == 4


def test_a_file_without_areas_names_none(write: Write) -> None:
    assert read_picks(write(PICKS + "a.jpg,P,1.5,2,,\n")).area == ("",)


def test_lines_are_observations_unless_withheld(write: Write) -> None:
    lines = read_lines(write(LINES + "n,a,b,1.5,0.01,\nm,b,c,2,0.02,check\no,a,c,3,1,adjust\n"))

    assert (lines.name, lines.start, lines.end) == (
        ("n", "m", "o"),
        ("a", "b", "a"),
        ("b", "c", "c"),
    )
    np.testing.assert_array_equal(lines.length_m, [1.5, 2, 3])
    np.testing.assert_array_equal(lines.sigma_m, [0.01, 0.02, 1])
    assert lines.adjust.tolist() == [True, False, True]


def test_measurements_arrive_with_points_in_order_and_parameters(write: Write) -> None:
    requests = read_measure(
        write(MEASURE + "d,distance,b; a,\ns,skid_speed,a;b;c,mu_sigma = 0.05; mu=0.7\n")
    )

    assert [r.points for r in requests] == [("b", "a"), ("a", "b", "c")]
    assert requests[1].parameters == (("mu", 0.7), ("mu_sigma", 0.05))
    assert requests[0].parameters == ()


def test_known_points_are_geodetic_or_local(write: Write) -> None:
    geodetic = read_known_points(write(GEODETIC + "a,50.5,-104.25,577,0.02\n"))
    local = read_known_points(write(LOCAL + "a,1,2,3,0.1,0.2,0.3\nb,4,5,6,1,2,3\n"))

    assert geodetic.kind == "geodetic"
    np.testing.assert_array_equal(geodetic.coordinates, [[50.5, -104.25, 577]])
    np.testing.assert_array_equal(geodetic.sigma_m, [[0.02, 0.02, 0.02]])
    assert local.kind == "local"
    np.testing.assert_array_equal(local.coordinates, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(local.sigma_m, [[0.1, 0.2, 0.3], [1, 2, 3]])


def test_a_header_alone_is_a_table_without_rows(write: Write) -> None:
    assert read_lines(write(LINES)).name == ()
    assert read_measure(write(MEASURE)) == ()
    assert read_known_points(write(GEODETIC)).sigma_m.shape == (0, 3)


@pytest.mark.parametrize(
    ("read", "content", "line", "words"),
    [
        (read_picks, PICKS, 1, "holds no pick"),
        (
            read_picks,
            "image,label,u_px,v_px,area\na.jpg,P,1,2,road\nb.jpg,P,1,2,\nc.jpg,P,3,4,verge\n",
            4,
            "area of label 'P' is 'verge' here, but 'road' in line 2",
        ),
        (read_picks, PICKS + "photos/a.jpg,P,1,2,,\n", 2, "the file's name alone: 'a.jpg'"),
        (read_picks, PICKS + "a.jpg,P;Q,1,2,,\n", 2, "semicolon"),
        (
            read_picks,
            "image,label,u_px,v_px,source\n"
            "a.jpg,P,1,2,match\na.jpg,Q,1,2,match\na.jpg,P,3,4,match\n",
            4,
            "label 'P' is found twice in image 'a.jpg' (source match), first in line 2",
        ),
        (read_picks, PICKS + "a.jpg,P,1,2,0,\n", 2, "sigma_px must be greater than 0 (got 0)"),
        (read_picks, PICKS + "a.jpg,P,1,2,-1,\n", 2, "sigma_px must be greater than 0 (got -1)"),
        (
            read_picks,
            PICKS + "a.jpg,P,1,2,,0.1\nb.jpg,P,1,2,,\nc.jpg,P,1,2,,0.2\n",
            4,
            "height_m of label 'P' is 0.2 here, but 0.1 in line 2",
        ),
        (
            read_picks,
            HEIGHTS + "a.jpg,P,1,2,free,\nb.jpg,P,1,2,1.5,\n",
            3,
            "height_m of label 'P' is 1.5 here, but free in line 2",
        ),
        (read_picks, HEIGHTS + "a.jpg,P,1,2,free,0.1\n", 2, "'P' is the sigma of no height"),
        (read_picks, HEIGHTS + "a.jpg,P,1,2,fre,\n", 2, "height_m must be a number (got 'fre')"),
        (read_picks, HEIGHTS + "a.jpg,P,1,2,1.5,0\n", 2, "height_sigma_m must be greater than 0"),
        (read_lines, LINES + "n,a,b,0,0.1,\n", 2, "length_m must be greater than 0 (got 0)"),
        (read_lines, LINES + "n,a,b,-3.5,0.1,\n", 2, "length_m must be greater than 0 (got -3.5)"),
        (read_lines, LINES + "n,a,b,1,0,\n", 2, "sigma_m must be greater than 0"),
        (read_lines, LINES + "n,a,b,1,,\n", 2, "sigma_m is empty"),
        (read_lines, LINES + "n,a,a,1,1,\n", 2, "from 'a' to itself"),
        (read_lines, LINES + "n,a,b,1,1,\n\nn,c,d,1,1,\n", 4, "line 'n' is already in line 2"),
        (read_lines, LINES + "n,a,b,1,1,chek\n", 2, "(got 'chek'): did you mean 'check'?"),
        (read_lines, LINES + "n,a,b,NaN,1,\n", 2, "must be a number (got 'NaN')"),
        (read_measure, MEASURE + "m,distnace,a;b,\n", 2, "did you mean 'distance'?"),
        (
            read_measure,
            MEASURE + "m,curvature,a;b,\n",
            2,
            "unknown kind 'curvature': known are distance",
        ),
        (read_measure, MEASURE + "m,distance,a;b;c,\n", 2, "needs 2 labels joined by ';' (got 3"),
        (read_measure, MEASURE + "m,area,a;b,\n", 2, "needs at least 3 labels"),
        (read_measure, MEASURE + "m,angle,a;b,\n", 2, "needs 3 labels"),
        (read_measure, MEASURE + "m,coordinate,a;b,\n", 2, "needs 1 labels"),
        (read_measure, MEASURE + "m,distance,,\n", 2, "points is empty"),
        (read_measure, MEASURE + "m,polyline,a;;b,\n", 2, "empty label"),
        (read_measure, MEASURE + "m,polyline,a;a;b,\n", 2, "names 'a' twice in a row"),
        (read_measure, MEASURE + "m,area,a;b;c;b,\n", 2, "needs different points"),
        (read_measure, MEASURE + "m,skid_speed,a;b,\n", 2, "needs the parameter mu and mu_sigma"),
        (read_measure, MEASURE + "m,skid_speed,a;b,mu=0.7\n", 2, "needs the parameter mu_sigma"),
        (read_measure, MEASURE + "m,skid_speed,a;b,mu=0;mu_sigma=0\n", 2, "mu must be greater"),
        (read_measure, MEASURE + "m,skid_speed,a;b,mu=1;mu_sigma=-1\n", 2, "must not be negative"),
        (read_measure, MEASURE + "m,skid_speed,a;b,mu=x;mu_sigma=0\n", 2, "must be a number"),
        (read_measure, MEASURE + "m,skid_speed,a;b,mu=1;mu=2;mu_sigma=0\n", 2, "there twice"),
        (read_measure, MEASURE + "m,skid_speed,a;b,mu 1;mu_sigma=0;mu=1\n", 2, "name=number"),
        (read_measure, MEASURE + "m,height,a;b;c,\n", 2, "needs 1 or 2 labels"),
        (read_measure, MEASURE + "m,plane_distance,a;b;c,\n", 2, "needs 4 labels"),
        (read_measure, MEASURE + "m,volume,a;b;c,top=1\n", 2, "at least 4 labels"),
        (read_measure, MEASURE + "m,volume,a;b;c;d;e,plane=1\n", 2, "three of the plane below"),
        (read_measure, MEASURE + "m,volume,a;b;c;d,top=0\n", 2, "can only be 1"),
        (read_measure, MEASURE + "m,volume,a;b;c;d;e;f,plane=1;level=2\n", 2, "remove one"),
        (read_measure, MEASURE + "m,volume,a;b;c,hight=2\n", 2, "it has top, level, plane"),
        (read_measure, MEASURE + "m,distance,a;b,mu=1\n", 2, "unknown parameter 'mu'"),
        (read_measure, MEASURE + "m,distance,a;b,\nm,area,a;b;c,\n", 3, "'m' is already in line 2"),
        (read_known_points, "label,sigma_m\na,1\n", 1, "give either latitude_deg"),
        (read_known_points, "label,east_m,north_m,up_m\na,1,2,3\n", 1, "give either sigma_m or"),
        (read_known_points, "label,east_m,north_m,sigma_m\na,1,2,3\n", 1, "'up_m' is missing"),
        (
            read_known_points,
            "label,east_m,north_m,up_m,latitude_deg,sigma_m\na,1,2,3,4,5\n",
            1,
            "has both latitude_deg and east_m",
        ),
        (
            read_known_points,
            "label,east_m,north_m,up_m,sigma_m,sigma_up_m\na,1,2,3,4,5\n",
            1,
            "has both sigma_m and sigma_up_m",
        ),
        (read_known_points, GEODETIC + "a,50,,577,1\n", 2, "longitude_deg is empty"),
        (read_known_points, GEODETIC + "a,50,x,577,1\n", 2, "longitude_deg must be a number"),
        (read_known_points, GEODETIC + "a,91,0,577,1\n", 2, "between -90 and 90 (got 91)"),
        (read_known_points, GEODETIC + "a,9,361,577,1\n", 2, "between -360 and 360"),
        (read_known_points, GEODETIC + "a,9,6,577,0\n", 2, "sigma_m must be greater than 0"),
        (read_known_points, LOCAL + "a,9,6,5,1,1,-1\n", 2, "sigma_up_m must be greater than 0"),
        (
            read_known_points,
            GEODETIC + "a,9,6,5,1\na,9,6,5,1\n",
            3,
            "label 'a' is already in line 2",
        ),
    ],
)
def test_a_mistake_is_named_with_its_line(
    write: Write, read: Callable[[Path], object], content: str, line: int, words: str
) -> None:
    with pytest.raises(InputError) as caught:
        read(write(content))

    assert caught.value.line == line
    assert words in caught.value.message
    assert "\n" not in caught.value.message


def test_mistakes_of_cells_and_of_meaning_come_in_one_error(write: Write) -> None:
    with pytest.raises(InputError) as caught:
        read_lines(write(LINES + "n,a,a,1,1,\nm,a,b,x,1,\no,a,b,1,-1,\n"))

    assert len(str(caught.value).splitlines()) == 3


@pytest.mark.parametrize("flight", ["cuav", "calm_nadir", "wind_oblique"])
def test_the_real_tables_load(data_dir: Path, flight: str) -> None:
    folder = data_dir / flight
    picks, lines = read_picks(folder / "picks.csv"), read_lines(folder / "lines.csv")
    requests = read_measure(folder / "measure.csv")

    assert len(picks.label) == len((folder / "picks.csv").read_text().splitlines()) - 1
    assert {*lines.start, *lines.end} <= set(picks.label)
    assert len(requests) > 0


def test_a_volume_may_have_a_top_and_something_to_lie_on(write: Write) -> None:
    rows = "v,volume,a;b;c,\nt,volume,a;b;c;d,top=1\np,volume,a;b;c;d;e;f,plane=1\n"
    requests = read_measure(write(MEASURE + rows + "l,volume,a;b;c,level=-1.5\nh,height,a,\n"))

    assert [r.parameters for r in requests] == [
        (),
        (("top", 1.0),),
        (("plane", 1.0),),
        (("level", -1.5),),
        (),
    ]
