"""Forms of OpenDRIVE that CARLA's towns do not use, and files that are refused by road and line."""

from __future__ import annotations

import math

import numpy as np
import pytest

from di_envs.town.loading import load_town
from tests.di_envs.town.small_maps import crossing, lane, load, one_street, opendrive, road, section
from tests.di_envs.town.test_network import lane_index, points_of, successors_of


def border(a, b=0.0, offset=0.0):
    return f'<border sOffset="{offset}" a="{a}" b="{b}" c="0" d="0"/>'


def width(a, b=0.0, offset=0.0):
    return f'<width sOffset="{offset}" a="{a}" b="{b}" c="0" d="0"/>'


def street(*lanes, **options):
    return opendrive(road("1", 100.0, section(0.0, *lanes), **options))


def profile(*rows):
    return f"<lateralProfile>{''.join(rows)}</lateralProfile>"


def same_lanes(a, b):
    return all(
        np.allclose(own, other, atol=1e-9) for own, other in zip(a.lanes, b.lanes, strict=True)
    )


def test_borders_say_the_same_as_the_widths_between_them(tmp_path):
    by_border = street(
        lane(2, width=border(7.0, 0.01)),
        lane(1, width=border(3.5)),
        lane(-1, width=border(-3.0)),
        lane(-2, width=border(-6.0) + border(-6.0, -0.02, 50.0)),
    )
    by_width = street(
        lane(2, width=width(3.5, 0.01)),
        lane(1, width=width(3.5)),
        lane(-1, width=width(3.0)),
        lane(-2, width=width(3.0) + width(3.0, 0.02, 50.0)),
    )
    town = load(by_border, tmp_path)
    assert same_lanes(town, load(by_width, tmp_path))
    # At 100 m lane -2 reaches from 3 to 7 m right of the line: its middle lies at y = 5.
    assert points_of(town, lane_index(town, -2))[-1, :2] == pytest.approx((100.0, 5.0))


def test_a_border_beyond_a_lane_of_a_width_is_told_from_the_line_too(tmp_path):
    mixed = street(lane(-1, width=width(3.0, 0.01)), lane(-2, width=border(-7.0)))
    plain = street(lane(-1, width=width(3.0, 0.01)), lane(-2, width=width(4.0, -0.01)))
    assert same_lanes(load(mixed, tmp_path), load(plain, tmp_path))


def test_superelevation_turns_lanes_about_the_reference_line(tmp_path):
    """A road falls to the right where it is positive: its left lane is lifted."""
    bank = profile('<superelevation s="0" a="0.1" b="0" c="0" d="0"/>')
    town = load(one_street(before=bank), tmp_path)
    left, right = (points_of(town, lane_index(town, k)) for k in (1, -1))
    rise, aside = 1.75 * math.sin(0.1), 1.75 * math.cos(0.1)
    assert left[:, 2] == pytest.approx(rise)
    assert right[:, 2] == pytest.approx(-rise)
    assert left[:, 1] == pytest.approx(-aside)
    assert right[:, 1] == pytest.approx(aside)


def test_crossfall_lowers_the_side_that_it_names(tmp_path):
    fall = profile('<crossfall side="right" s="0" a="0.02" b="0" c="0" d="0"/>')
    town = load(one_street(before=fall), tmp_path)
    assert points_of(town, lane_index(town, 1))[:, 2] == pytest.approx(0.0)
    lower = -1.75 * math.tan(0.02)
    assert points_of(town, lane_index(town, -1))[:, 2] == pytest.approx(lower)


def test_a_direct_junction_links_a_road_to_its_ramp_and_to_what_goes_on(tmp_path):
    into = '<successor elementType="junction" elementId="5"/>'
    out = '<predecessor elementType="junction" elementId="5"/>'
    text = opendrive(
        road("1", 50.0, section(0.0, lane(1), lane(-1), lane(-2)), links=into),
        road("2", 50.0, section(0.0, lane(1), lane(-1)), links=out, x=50.0),
        road("3", 50.0, section(0.0, lane(-1)), links=out, x=50.0, y=-3.5),
        '<junction id="5" type="direct">'
        '<connection id="0" incomingRoad="1" linkedRoad="2" contactPoint="start">'
        '<laneLink from="-1" to="-1"/><laneLink from="1" to="1"/></connection>'
        '<connection id="1" incomingRoad="1" linkedRoad="3" contactPoint="start">'
        '<laneLink from="-2" to="-1"/></connection></junction>',
    )
    town = load(text, tmp_path)
    own = {k: lane_index(town, k, "1") for k in (1, -1, -2)}
    on, ramp = lane_index(town, -1, "2"), lane_index(town, -1, "3")
    assert successors_of(town, own[-1]) == {on}
    assert successors_of(town, own[-2]) == {ramp}
    assert successors_of(town, lane_index(town, 1, "2")) == {own[1]}
    for before, after in ((own[-1], on), (own[-2], ramp)):
        assert points_of(town, before)[-1] == pytest.approx(points_of(town, after)[0])


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1"]
)
def test_a_file_is_read_in_the_encoding_that_it_has(tmp_path, encoding):
    text = one_street().replace('"1.0"?', f'"1.0" encoding="{encoding.removesuffix("-sig")}"?')
    text = text.replace('id="1" length', 'id="Straße" length')
    path = tmp_path / "map.xodr"
    path.write_bytes(text.encode(encoding))
    for _ in range(2):  # parsed, then from the cache
        town = load_town(path, "none", cache_folder=tmp_path)
        assert town.road_names == ("Straße",)
        assert "Straße" in town.opendrive


def in_lines(text):
    return text.replace("><", ">\n<")


CROSSING = in_lines(crossing())
STREET = in_lines(one_street())


def line(text, start):
    """The number of the first line that begins so."""
    return next(k for k, row in enumerate(text.split("\n"), 1) if row.startswith(start))


@pytest.mark.parametrize(
    ("old", "new", "place", "message"),
    [
        ('length="100.0" junction', 'length="nan" junction', "<road", "length='nan'> is not a num"),
        ('length="100.0" junction', 'length="inf" junction', "<road", "out of all proportion"),
        ('length="100.0" junction', 'length="1e9" junction', "<road", "expected 0 to 100000"),
        ('length="100.0" junction', 'length="-5" junction', "<road", "out of all proportion"),
        ('length="100.0" junction', 'length="900" junction', "<road", "stations 100 to 900 of 900"),
        ('x="0.0"', 'x="NaN"', "<geometry", "x='NaN'> is not a number"),
        (' hdg="0.0"', "", "<geometry", "no attribute 'hdg'"),
        ('a="3.5"', 'a="inf"', "<width", "out of all proportion"),
        ('<lane id="-1"', '<lane id="one"', '<lane id="one"', "is not a number"),
        ('<lane id="-1"', '<lane id="-1.5"', '<lane id="-1.5"', "is not an integer"),
        ('<lane id="-1"', '<lane id="1"', '<lane id="1" type="driving">', "is taken by that of"),
        ('<laneSection s="0.0">', '<laneSection s="300">', "<laneSection", "behind the road's 100"),
        ("<line/>", '<arc curvature="1e6"/>', "<arc", "out of all proportion"),
        ("laneSection", "laneSektion", "<road", "no lane sections"),
        ("<line/>", "<helix/>", "<road", "no geometry of a known shape"),
    ],
)
def test_a_road_that_cannot_be_read_is_named_with_its_line(tmp_path, old, new, place, message):
    text = STREET.replace(old, new)
    number = line(text, place)
    if "taken" in message:  # the second of the two
        number = text.split("\n").index('<lane id="1" type="driving">', number) + 1
    with pytest.raises(ValueError, match=message) as caught:
        load(text, tmp_path)
    assert "small.xodr" in str(caught.value)
    assert "road '1'" in str(caught.value)
    assert f"line {number}: " in str(caught.value)


@pytest.mark.parametrize("row", ['b="0" c="0" d="1000"', 'b="5000" c="0" d="0"'])
def test_a_lane_that_would_fill_memory_is_refused_by_road(tmp_path, row):
    text = STREET.replace('b="0" c="0" d="0"', row, 1)  # a lane of 1e9 or 5e5 m at its end
    with pytest.raises(ValueError, match=r"road '1', line \d+: a lane of it would measure"):
        load(text, tmp_path)


def test_a_road_too_far_from_the_others_for_a_grid_is_refused(tmp_path):
    far = road("2", 50.0, section(0.0, lane(-1)), x=1e11)
    with pytest.raises(ValueError, match=r"road '2', line \d+: it lies 1e\+11 m aside"):
        load(STREET.replace("</OpenDRIVE>", f"{far}</OpenDRIVE>"), tmp_path)


def test_a_map_may_lie_anywhere(tmp_path):
    town = load(one_street(x=5e6, y=-4e6), tmp_path)
    assert points_of(town, lane_index(town, -1))[0, :2] == pytest.approx((5e6, 4e6 + 1.75))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<road id="2"', '<road id="1"', r"<road id='1'> is taken by that of line \d+"),
        ("</junction>", '</junction><junction id="9"/>', "<junction id='9'> is taken by"),
        ('contactPoint="end"', 'contactPoint="middle"', "road '11', line .* known: start, end"),
        ('from="-1"', 'from="x"', "line .* <laneLink from='x'> is not a number"),
        ('<junction id="9"', "<junction", "line .* <junction> has no attribute 'id'"),
    ],
)
def test_ids_and_links_that_cannot_be_meant_are_refused_with_their_line(
    tmp_path, old, new, message
):
    with pytest.raises(ValueError, match=message):
        load(CROSSING.replace(old, new, 1), tmp_path)


@pytest.mark.parametrize(
    ("lanes", "options", "message"),
    [
        ((lane(-1, width=border(3.5)),), {}, "lane -1 lies on the inner side"),
        (
            (lane(-1, width=border(-3.5)), lane(-2, width=border(-3.0))),
            {},
            "lane -2 lies on the inner side",
        ),
        (
            (lane(-1, width=border(-3.5)),),
            {"offset": '<laneOffset s="0" a="1" b="0" c="0" d="0"/>'},
            "<border>s and its road a <laneOffset>",
        ),
    ],
)
def test_borders_that_say_nothing_definite_are_refused(tmp_path, lanes, options, message):
    with pytest.raises(ValueError, match=message):
        load(street(*lanes, **options), tmp_path)


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "map.xodr"
    path.write_bytes(one_street().encode().replace(b"driving", b"\xff\xfe\xfa"))
    with pytest.raises(ValueError, match=r"map\.xodr is not text in the encoding 'utf-8'"):
        load_town(path, "none", cache_folder=tmp_path)
