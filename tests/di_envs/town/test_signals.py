"""Signals: from the map, from sidecars, guessed; their stop lines, boxes and poles."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from di_envs.town.lanes import LaneKind, SignalKind
from di_envs.town.loading import load_town
from di_envs.town.reading.arms import junction_arms, stem_of
from tests.di_envs.town.small_maps import (
    crossing,
    geometry,
    lane,
    left_handed,
    load,
    one_street,
    opendrive,
    road,
    section,
)

LIGHT_AT_STREET_1 = (
    '<signals><signal id="70" name="Light" type="1000001" s="79" t="-5" orientation="-" '
    'dynamic="yes"><validity fromLane="0" toLane="0"/></signal></signals>'
)


def sidecar(folder, *junctions, **others):
    path = folder / "signals.json"
    path.write_text(json.dumps({"junctions": list(junctions), **others}), encoding="utf-8")
    return path


def refer(text, road_id, lanes):
    """Adds a reference to signal 70 to a road of the junction."""
    reference = (
        f'<signals><signalReference id="70" s="0.5" t="0" orientation="-">'
        f'<validity fromLane="{lanes[0]}" toLane="{lanes[1]}"/></signalReference></signals></road>'
    )
    head, tail = text.split(f'<road id="{road_id}"', 1)
    return head + f'<road id="{road_id}"' + tail.replace("</road>", reference, 1)


def with_limit(text, kmh, *roads):
    """A limit on all lanes of the roads of these ids; of all roads where none is named."""
    limit = f'<type s="0"><speed max="{kmh}" unit="km/h"/></type><planView>'
    parts = text.split("<road ")
    return "<road ".join(
        part.replace("<planView>", limit) if not roads or part[4:].split('"')[0] in roads else part
        for part in parts
    )


def without_roads(text, *roads):
    for name in roads:
        head, tail = text.split(f'<road id="{name}"', 1)
        text = head + tail.split("</road>", 1)[1]
    return text


def test_a_reference_inside_the_junction_rules_the_lanes_before_it(tmp_path):
    text = refer(crossing(2, signals=LIGHT_AT_STREET_1), "11", (-2, -1))
    town = load(text, tmp_path, signals=None)
    signals, lanes = town.signals, town.lanes
    assert list(signals.kind) == [SignalKind.LIGHT]
    assert list(signals.groups) == [1]
    assert sorted(lanes.lane_id[signals.stop_lane]) == [-2, -1]
    assert {town.road_names[i] for i in lanes.road[signals.stop_lane]} == {"1"}
    # Street 1 comes from the east: it runs west and ends at x = 10, its right is north.
    assert signals.stop_pose[:, 0] == pytest.approx(10.0)
    assert sorted(signals.stop_pose[:, 1]) == pytest.approx([-5.25, -1.75])
    assert np.cos(signals.stop_pose[:, 3]) == pytest.approx(-1.0)
    assert signals.stop_width_m == pytest.approx(3.5)
    # The pole stands where the file has it: 1 m before the end, 5 m to the right.
    assert signals.pose[0, :3] == pytest.approx((11.0, -5.0, 0.0))
    # The box covers the last 4 m of both lanes.
    x, y, z, yaw, half_length, half_width = signals.box[0]
    assert (x, y, z, half_length, half_width) == pytest.approx((12.0, -3.5, 0.0, 2.0, 3.5))
    assert math.cos(yaw) == pytest.approx(-1.0)


def test_validity_limits_a_light_to_its_lanes(tmp_path):
    text = refer(crossing(2, signals=LIGHT_AT_STREET_1), "11", (-1, -1))
    town = load(text, tmp_path, signals=None)
    assert list(town.lanes.lane_id[town.signals.stop_lane]) == [-1]


def test_lanes_know_their_stop_lines(tmp_path):
    town = load(
        refer(crossing(2, signals=LIGHT_AT_STREET_1), "11", (-2, -1)), tmp_path, signals=None
    )
    for line, lane_ in enumerate(town.signals.stop_lane):
        assert town.lanes.stop_line[lane_] == line
    assert np.count_nonzero(town.lanes.stop_line >= 0) == 2


def test_a_signal_that_nothing_refers_to_rules_the_lanes_that_end_beside_it(tmp_path):
    town = load(crossing(signals=LIGHT_AT_STREET_1), tmp_path, signals=None)
    assert len(town.signals.stop_lane) == 1
    assert town.road_names[town.lanes.road[town.signals.stop_lane[0]]] == "1"


@pytest.mark.parametrize(
    ("old", "new", "kind"),
    [
        ('type="1000001"', 'type="206"', SignalKind.STOP),
        ('type="1000001"', 'type="205"', SignalKind.YIELD),
        ('name="Light" type="1000001"', 'name="Signal_3Light_Post01" type="-1"', SignalKind.LIGHT),
        ('name="Light" type="1000001"', 'name="StopSign_2" type="x"', SignalKind.STOP),
    ],
)
def test_kinds_are_known_by_type_and_by_name(tmp_path, old, new, kind):
    town = load(crossing(signals=LIGHT_AT_STREET_1.replace(old, new)), tmp_path, signals=None)
    assert list(town.signals.kind) == [kind]
    assert list(town.signals.group) == [0 if kind == SignalKind.LIGHT else -1]


def test_other_signs_are_no_signals(tmp_path):
    speed = LIGHT_AT_STREET_1.replace('type="1000001"', 'type="274"')
    with pytest.warns(UserWarning, match="signals='synthesise'"):
        town = load(crossing(signals=speed), tmp_path, signals=None)
    assert len(town.signals.kind) == 0


def test_controllers_order_the_turns(tmp_path):
    light = LIGHT_AT_STREET_1
    second = light.replace('id="70"', 'id="71"')
    text = crossing(signals=light)
    text = text.replace('<road id="3"', '<road  id="3"')
    head, tail = text.split('<road  id="3"', 1)
    text = head + '<road id="3"' + tail.replace("</road>", f"{second}</road>", 1)
    controllers = "".join(
        f'<controller id="{number}"><control signalId="{signal}"/></controller>'
        for number, signal in ((500, 71), (501, 70))
    )
    turns = '<controller id="500" sequence="0"/><controller id="501" sequence="1"/>'
    text = text.replace("</junction>", f"{turns}</junction>{controllers}")
    town = load(text, tmp_path, signals=None)
    first, second = town.signals.stop_signal.argsort()
    roads = [town.road_names[town.lanes.road[town.signals.stop_lane[k]]] for k in (first, second)]
    assert roads == ["3", "1"]  # 71, on street 3, has the first turn
    assert list(town.signals.group) == [0, 1]


def test_all_arms_of_a_sidecar_junction_get_lights_one_group_each(tmp_path):
    path = sidecar(tmp_path, {"junction": "9", "kind": "lights"})
    town = load(crossing(2), tmp_path, signals=path)
    signals = town.signals
    assert list(signals.kind) == [SignalKind.LIGHT] * 4
    assert list(signals.group) == [0, 1, 2, 3]
    assert list(signals.groups) == [4]
    assert len(signals.stop_lane) == 8
    # Clockwise from south-east (x right, y down): south, west, north, east.
    roads = [
        town.road_names[town.lanes.road[signals.stop_lane[signals.stop_signal == head][0]]]
        for head in range(4)
    ]
    assert roads == ["2", "3", "4", "1"]


def test_a_pole_stands_behind_the_shoulder_at_the_right(tmp_path):
    shoulder = lane(-2, kind="shoulder", width='<width sOffset="0" a="1" b="0" c="0" d="0"/>')
    text = crossing().replace("</right>", f"{shoulder}</right>", 1)  # street 1
    path = sidecar(tmp_path, {"junction": "9", "kind": "lights"})
    signals = load(text, tmp_path, signals=path).signals
    # Street 1 runs west; right of its 3.5 m lane and 1 m shoulder, and 0.6 m beyond.
    assert signals.pose[3, :3] == pytest.approx((10.0, -5.1, 0.0))
    assert math.cos(signals.pose[3, 3]) == pytest.approx(-1.0)
    # Street 2 comes from the south (y = 10) running north: its right is east.
    assert signals.pose[0, :3] == pytest.approx((4.1, 10.0, 0.0))


def test_a_stop_signs_box_covers_its_lanes_from_the_sign_too(tmp_path):
    path = sidecar(tmp_path, {"junction": "9", "kind": "stop"})
    town = load(crossing(2), tmp_path, signals=path)
    signals = town.signals
    for line, sign in enumerate(signals.stop_signal):
        x, y, _, yaw, half_length, half_width = signals.box[sign]
        for centre in ((x, y), signals.pose[sign, :2]):
            # Somewhere in the last 4 m of the lane its centre is in the box around this centre.
            dx, dy = signals.stop_pose[line, :2] - centre
            right = math.cos(yaw) * dy - math.sin(yaw) * dx
            ahead = math.cos(yaw) * dx + math.sin(yaw) * dy
            assert abs(right) <= half_width
            assert -half_length < ahead <= half_length + 2.0
        # It does not lie over the oncoming lanes, left of the road's centre line.
        centre_line = -math.sin(yaw) * x + math.cos(yaw) * y
        assert centre_line - half_width == pytest.approx(0.0, abs=1e-6)


def test_where_one_drives_on_the_left_a_pole_stands_at_the_left(tmp_path):
    path = sidecar(tmp_path, {"junction": "9", "kind": "stop"})
    signals = load(left_handed(crossing(2)), tmp_path, signals=path).signals
    # Traffic of street 1 runs west on its southern lanes; the kerb is at y = 7, on its left.
    (east,) = np.flatnonzero(signals.pose[:, 0] > 10.0)
    assert signals.pose[east, :3] == pytest.approx((12.0, 7.6, 0.0))
    # Seen from the pole, 4.1 m beside the middle of two lanes of 7 m, the box covers both.
    assert signals.box[east, :3] == pytest.approx((12.0, 7.6, 0.0))
    assert signals.box[east, 4:] == pytest.approx((2.0, 4.1 + 3.5))


def test_a_junction_is_found_by_its_centre_whatever_its_id(tmp_path):
    path = sidecar(tmp_path, {"junction": "another id", "centre": [1, -2], "kind": "stop"})
    assert len(load(crossing(), tmp_path, signals=path).signals.kind) == 4


def test_listed_arms_have_what_is_listed_and_others_nothing(tmp_path):
    arms = [{"at": [10, -1.75]}, {"at": [-10, 1.75], "kind": "yield"}]
    path = sidecar(tmp_path, {"junction": "9", "kind": "stop", "arms": arms})
    town = load(crossing(), tmp_path, signals=path)
    kinds = {
        town.road_names[town.lanes.road[lane_]]: town.signals.kind[signal]
        for lane_, signal in zip(town.signals.stop_lane, town.signals.stop_signal, strict=True)
    }
    assert kinds == {"1": SignalKind.STOP, "3": SignalKind.YIELD}


@pytest.mark.parametrize(
    ("junction", "message"),
    [
        ({"junction": "9", "kind": "light"}, "did you mean 'lights'"),
        ({"junction": "9", "kindd": "stop"}, "did you mean 'kind'"),
        ({"junction": "9", "kind": "stop", "arms": "steem"}, "did you mean 'stem'"),
        ({"junction": "10", "kind": "stop"}, "has no junction '10'; it has 9"),
        ({"centre": [50, 50], "kind": "stop"}, "no junction within 12 m"),
        (
            {"centre": "here", "kind": "stop"},
            r"junctions\[0\]\.centre: expected a list or null, got 'here'",
        ),
        ({"kind": "stop"}, "neither 'junction' nor 'centre'"),
        ({"junction": "9", "kind": "stop", "arms": [{"at": [50, 50]}]}, "no arm that ends"),
        (["9"], "expected an object, got a list of 1"),
    ],
)
def test_a_wrong_sidecar_says_what_is_wrong(tmp_path, junction, message):
    path = sidecar(tmp_path, junction)
    with pytest.raises(ValueError, match=message):
        load(crossing(), tmp_path, signals=path)


def test_a_junction_listed_twice_is_refused(tmp_path):
    rows = {"junction": "9", "kind": "stop"}, {"centre": [0, 0], "kind": "lights"}
    with pytest.raises(ValueError, match="same junction"):
        load(crossing(), tmp_path, signals=sidecar(tmp_path, *rows))


def test_a_sidecar_that_is_no_json_or_has_unknown_keys_is_refused(tmp_path):
    path = tmp_path / "bad.json"
    path.write_text("junctions: 9", encoding="utf-8")
    with pytest.raises(ValueError, match="is not whole JSON"):
        load(crossing(), tmp_path, signals=path)
    with pytest.raises(ValueError, match="did you mean 'junctions'"):
        load(crossing(), tmp_path, signals=sidecar(tmp_path, junctons=[]))


def test_an_unknown_word_for_signals_is_refused_with_a_suggestion(tmp_path):
    with pytest.raises(FileNotFoundError, match="did you mean 'synthesise'"):
        load(crossing(), tmp_path, signals="synthesize")


@pytest.mark.parametrize(
    ("lanes_each_way", "kmh", "kind"),
    [
        (1, 50, SignalKind.LIGHT),
        (2, 50, SignalKind.LIGHT),
        (2, 30, SignalKind.LIGHT),
        (1, 30, SignalKind.STOP),  # nobody is on a main road: all stop
    ],
)
def test_a_guess_gives_crossings_of_main_roads_lights_and_small_ones_stops(
    tmp_path, lanes_each_way, kmh, kind
):
    text = with_limit(crossing(lanes_each_way), kmh)
    assert list(load(text, tmp_path, signals="synthesise").signals.kind) == [kind] * 4


def test_a_guess_stops_the_side_streets_that_cross_a_main_road(tmp_path):
    text = with_limit(crossing(), 30, "2", "4")
    town = load(text, tmp_path, signals="synthesise")
    assert list(town.signals.kind) == [SignalKind.STOP] * 2
    ruled = {town.road_names[i] for i in town.lanes.road[town.signals.stop_lane]}
    assert ruled == {"2", "4"}


def test_a_guess_gives_nothing_where_nobody_crosses_anybody(tmp_path):
    """Two arms that look at each other and go straight on: a street, not a crossing."""
    text = without_roads(crossing(), "2", "4", "12", "14")
    assert len(load(text, tmp_path, signals="synthesise").signals.kind) == 0


@pytest.mark.parametrize("name", ["Town01_2020", "Town04_2020"])
def test_guessed_lights_stand_where_carlas_do_at_four_of_five_junctions(shared, tmp_path, name):
    path = shared / "data" / "xodr" / f"{name}.xodr"
    real, ours = (
        load_town(path, signals, cache_folder=tmp_path).signals.groups > 0
        for signals in (None, "synthesise")
    )
    print(f"{name}: lights or none as in the map at {(real == ours).mean():.1%} of {len(real)}")
    assert (real == ours).mean() >= 0.8
    assert ours.sum() >= real.sum() > 0


def test_a_guess_says_what_it_made_also_from_the_cache(tmp_path):
    for _ in range(2):
        with pytest.warns(UserWarning, match=r"made 4 lights at 1 and 0 stop signs at 0 of .* 1 "):
            load(crossing(), tmp_path, signals="synthesise")


def test_a_guess_stops_the_stem_of_a_t(tmp_path):
    town = load_town("toy", "synthesise", cache_folder=tmp_path)
    arms = junction_arms(town.lanes, len(town.junction_names))
    for head, junction in enumerate(town.signals.junction):
        assert town.signals.kind[head] == SignalKind.STOP
        (stem,) = stem_of(arms[junction])
        own = town.signals.stop_lane[town.signals.stop_signal == head]
        assert set(own) == set(stem.lanes)
        assert {town.road_names[i] for i in town.lanes.road[own]} == {"13"}  # the narrow street
    assert len(town.signals.kind) == 2


def test_a_guess_leaves_a_merge_alone(tmp_path):
    """Two roads side by side into one: no two arms look at each other."""
    into = '<successor elementType="junction" elementId="5"/>'
    out = '<successor elementType="road" elementId="9" contactPoint="start"/>'
    parts = [road("9", 50.0, section(0.0, lane(-1)), x=70.0)]
    connections = ""
    for k, y in enumerate((0.0, 8.0)):
        parts.append(road(str(k), 50.0, section(0.0, lane(-1)), links=into, y=y))
        link = f'<predecessor elementType="road" elementId="{k}" contactPoint="end"/>{out}'
        way = section(0.0, lane(-1, predecessor=-1, successor=-1))
        line = geometry(21.0, x=50.0, y=y, heading=-0.4 * k)
        parts.append(road(str(20 + k), 21.0, way, links=link, line=line, junction="5"))
        connections += (
            f'<connection id="{k}" incomingRoad="{k}" connectingRoad="{20 + k}" '
            'contactPoint="start"><laneLink from="-1" to="-1"/></connection>'
        )
    text = opendrive(*parts, f'<junction id="5">{connections}</junction>')
    town = load(text, tmp_path, signals="synthesise")
    assert np.count_nonzero(town.lanes.junction == 0) == 2
    assert len(town.signals.kind) == 0


@pytest.mark.parametrize(
    ("heading", "lane_ids", "back", "heads"),
    [
        (1.57, (-1, -2), False, 2),  # two wide roads join at a right angle: one light each
        (0.5, (-1, -2), False, 0),  # a ramp
        (1.57, (-1,), False, 0),  # single lanes
        (1.57, (-1, -2), True, 0),  # what goes out comes back in 150 m: a roundabout
    ],
)
def test_a_guess_lights_wide_roads_that_join_at_an_angle(tmp_path, heading, lane_ids, back, heads):
    def link(end, name, contact):
        return f'<{end} elementType="road" elementId="{name}" contactPoint="{contact}"/>'

    into = '<successor elementType="junction" elementId="5"/>'
    plain = section(0.0, *map(lane, lane_ids))
    through = section(0.0, *(lane(i, predecessor=i, successor=i) for i in lane_ids))
    on = link("successor", "0", "start") if back else ""
    parts = [
        road("0", 50.0, plain, links=into),
        road("1", 50.0, plain, links=into, x=60.0, y=-60.0, heading=heading),
        road("9", 50.0, through if back else plain, links=on, x=70.0),
    ]
    connections = ""
    for k, (x, y, turn) in enumerate(((50.0, 0.0, 0.0), (60.0, -10.0, 0.785))):
        ends = link("predecessor", str(k), "end") + link("successor", "9", "start")
        line = geometry(20.0, x=x, y=y, heading=turn)
        parts.append(road(str(20 + k), 20.0, through, links=ends, line=line, junction="5"))
        pairs = "".join(f'<laneLink from="{i}" to="{i}"/>' for i in lane_ids)
        connections += (
            f'<connection id="{k}" incomingRoad="{k}" connectingRoad="{20 + k}" '
            f'contactPoint="start">{pairs}</connection>'
        )
    text = opendrive(*parts, f'<junction id="5">{connections}</junction>')
    signals = load(text, tmp_path, signals="synthesise").signals
    assert list(signals.kind) == [SignalKind.LIGHT] * heads


def test_none_means_none_and_does_not_warn(tmp_path):
    assert len(load(crossing(), tmp_path, signals="none").signals.kind) == 0


def test_a_map_without_signals_warns_each_time_also_from_the_cache(tmp_path):
    for _ in range(2):
        with pytest.warns(UserWarning, match="carries no traffic signals"):
            load(crossing(), tmp_path, signals=None)


def test_a_street_without_junctions_needs_no_signals(tmp_path):
    assert len(load(one_street(), tmp_path, signals=None).signals.kind) == 0


def test_the_shipped_sidecar_fits_the_real_town05(shared, tmp_path):
    town = load_town(shared / "data/xodr/Town05.xodr", "town05", cache_folder=tmp_path)
    signals, lanes = town.signals, town.lanes
    lit = {town.junction_names[j] for j in np.flatnonzero(signals.groups)}
    assert len(lit) == 15
    assert lit.isdisjoint({"245", "334", "685", "224", "924", "1162"})
    assert sorted(signals.groups)[6:] == [3] * 5 + [4] * 10
    signed = {town.junction_names[j] for j in signals.junction[signals.kind == SignalKind.STOP]}
    assert signed == {"245", "334", "685", "224", "924", "1162"}
    assert np.count_nonzero(signals.kind == SignalKind.STOP) == 4 + 4 + 4 + 3
    ruled = np.isin(signals.stop_signal, np.flatnonzero(signals.kind == SignalKind.LIGHT))
    assert np.count_nonzero(ruled) == 113  # driving approach lanes, counted in the facts
    assert (lanes.kind[signals.stop_lane] == LaneKind.DRIVING).all()
    # The stems of the three Ts: the link to the D road, the link to the left loop, the D road.
    for name, x, y in (("224", 144, 2), ("924", -259, -2), ("1162", 40, 141)):
        (head,) = np.flatnonzero(signals.junction == town.junction_names.index(name))
        stops = signals.stop_pose[signals.stop_signal == head]
        assert np.hypot(stops[:, 0] - x, stops[:, 1] - y).max() < 4.0, name


def test_a_sidecar_replaces_the_limits_that_the_maps_editor_left(shared, tmp_path):
    path = shared / "data" / "xodr" / "Town05.xodr"
    town = load_town(path, "town05", cache_folder=tmp_path)
    driving = town.lanes.kind == LaneKind.DRIVING
    limits = set(np.round(town.lanes.speed_limit_mps[driving] * 3.6, 3).tolist())
    assert limits == {30.0, 50.0, 80.0}


def test_a_speed_limit_without_a_number_is_refused(tmp_path):
    path = sidecar(tmp_path, speed_limits=[{"map_kmh": "fast", "kmh": 50}])
    with pytest.raises(
        ValueError, match=r"speed_limits\[0\]\.map_kmh: expected a number, got 'fast'"
    ):
        load(crossing(), tmp_path, signals=path)
