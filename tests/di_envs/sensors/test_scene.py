"""The scene: rasters that say what the lane network says, and scenery that stands off the road."""

from __future__ import annotations

import math

import numpy as np
import pytest

from di_envs.sensors.scene.actor_boxes import DETAIL_M
from di_envs.sensors.scene.actor_parts import PARTS, Role
from di_envs.sensors.scene.boxes import Material
from di_envs.sensors.scene.raster import TEXEL_M
from di_envs.sensors.scene.scene import ROOM, box_buffer, build_scene, collect_boxes, scene_of
from di_envs.sensors.scene.tags import PALETTE, Tag
from di_envs.town.lanes import LaneKind, LightState
from di_envs.town.loading import load_town
from di_envs.world.state import ActorKind, views_of
from di_envs.world.struck import DOWN, footprint
from di_envs.world.world import World, WorldConfig


@pytest.fixture(scope="module")
def town():
    return load_town("town05")


@pytest.fixture(scope="module")
def scene(town):
    return scene_of(town)


def texels_at(raster, xy):
    """Red, green, blue and tag at places, of the finest level."""
    column, row = ((xy - raster.origin) / TEXEL_M).astype(int).T
    texels = raster.texels[row * raster.width[0] + column]
    colour = np.stack([texels & 255, (texels >> 8) & 255, (texels >> 16) & 255], axis=1)
    return colour.astype(int), (texels >> 24) & 31


def lane_points(town, kind, *, elevated=False):
    lanes = town.lanes
    chosen = (lanes.kind[lanes.point_lane] == kind) & ((lanes.points[:, 2] > 0.05) == elevated)
    return np.flatnonzero(chosen)


def test_every_tag_has_a_colour_to_look_at():
    assert len(PALETTE) == max(Tag) + 1


def test_the_middle_of_each_driving_lane_is_road(town, scene):
    points = town.lanes.points[lane_points(town, LaneKind.DRIVING)]
    _, tags = texels_at(scene.ground, points[:, :2])
    assert np.isin(tags, (Tag.ROADS, Tag.ROAD_LINES)).all()  # crosswalks and stop lines are lines
    assert (tags == Tag.ROADS).mean() > 0.85


def test_the_middle_of_the_elevated_lanes_is_road_on_the_deck(town, scene):
    points = town.lanes.points[lane_points(town, LaneKind.DRIVING, elevated=True)]
    assert len(points) > 1000
    _, tags = texels_at(scene.deck, points[:, :2])
    assert (tags == Tag.ROADS).all()


def test_below_the_deck_the_streets_are_drawn_too(town, scene):
    """Three streets pass below the ring: places that are road in both rasters, 10 m apart."""
    points = town.lanes.points[lane_points(town, LaneKind.DRIVING, elevated=True)]
    _, tags = texels_at(scene.ground, points[:, :2])
    assert 0.02 < (tags == Tag.ROADS).mean() < 0.5


def test_sidewalks_outside_junctions_are_sidewalk(town, scene):
    lanes = town.lanes
    index = lane_points(town, LaneKind.SIDEWALK)
    index = index[lanes.junction[lanes.point_lane[index]] < 0]
    _, tags = texels_at(scene.ground, lanes.points[index, :2])
    assert (tags == Tag.SIDEWALKS).mean() > 0.99


def test_the_left_edge_of_a_street_is_yellow_and_the_right_one_white(town, scene):
    lanes = town.lanes
    index = lane_points(town, LaneKind.DRIVING)
    lane = lanes.point_lane[index]
    # not at a lane's first and last metres, where stop lines and the next road are drawn
    within = (index - lanes.first[lane] > 8) & (lanes.first[lane] + lanes.count[lane] - index > 8)
    outside = (lanes.junction[lane] < 0) & within
    for side, inset, neighbour in ((-1.0, 0.18, lanes.left), (1.0, 0.12, lanes.right)):
        rows = index[outside & (neighbour[lane] < 0)]
        points, reach = lanes.points[rows], side * (lanes.width_m[rows] / 2.0 - inset)
        right = np.stack([-np.sin(points[:, 3]), np.cos(points[:, 3])], axis=1)
        colour, tags = texels_at(scene.ground, points[:, :2] + right * reach[:, None])
        assert (tags == Tag.ROAD_LINES).mean() > 0.95
        yellow = colour[:, 0] - colour[:, 2] > 40
        assert (yellow.mean() > 0.9) if side < 0 else (yellow.mean() < 0.02)


def test_broken_lines_are_a_third_paint(town, scene):
    """Dashes of 3 m every 9 m."""
    lanes = town.lanes
    index = lane_points(town, LaneKind.DRIVING)
    lane = lanes.point_lane[index]
    broken = (lanes.junction[lane] < 0) & (lanes.right[lane] >= 0) & (lanes.change[index] & 2 != 0)
    points, reach = lanes.points[index[broken]], lanes.width_m[index[broken]] / 2.0
    right = np.stack([-np.sin(points[:, 3]), np.cos(points[:, 3])], axis=1)
    _, tags = texels_at(scene.ground, points[:, :2] + right * reach[:, None])
    assert (tags == Tag.ROAD_LINES).mean() == pytest.approx(1 / 3, abs=0.06)


def test_a_stop_line_lies_before_the_end_of_its_lane(town, scene):
    pose = town.signals.stop_pose
    ahead = np.stack([np.cos(pose[:, 3]), np.sin(pose[:, 3])], axis=1)
    _, on = texels_at(scene.ground, pose[:, :2] - 0.2 * ahead)
    _, before = texels_at(scene.ground, pose[:, :2] - 1.2 * ahead)
    assert (on == Tag.ROAD_LINES).all()
    assert (before == Tag.ROADS).mean() > 0.95


def test_nothing_stands_on_a_lane_or_a_sidewalk(town, scene):
    """The feet of buildings, trunks and lamp posts, and the pillars, against every lane point."""
    boxes, points = scene.boxes, town.lanes.points
    low = boxes.centre[:, 2] - boxes.half[:, 2] < 2.0
    solid = np.isin(boxes.tag, (Tag.BUILDINGS, Tag.VEGETATION, Tag.POLES, Tag.BRIDGE))
    flat = points[points[:, 2] < 0.05]
    width = town.lanes.width_m[points[:, 2] < 0.05]
    paved = np.isin(
        town.lanes.kind[town.lanes.point_lane[points[:, 2] < 0.05]],
        (LaneKind.DRIVING, LaneKind.SIDEWALK, LaneKind.BIKING, LaneKind.PARKING),
    )
    checked = 0
    for row in np.flatnonzero(low & solid & (boxes.material != Material.DECK)):
        c, s = math.cos(boxes.yaw[row]), math.sin(boxes.yaw[row])
        d = flat[:, :2] - boxes.centre[row, :2]
        outside_x = np.abs(c * d[:, 0] + s * d[:, 1]) - boxes.half[row, 0]
        outside_y = np.abs(c * d[:, 1] - s * d[:, 0]) - boxes.half[row, 1]
        gap = np.maximum(outside_x, outside_y)
        driving = town.lanes.kind[town.lanes.point_lane[points[:, 2] < 0.05]] == LaneKind.DRIVING
        lanes_apart = (gap[driving] - width[driving] / 2.0).min()
        assert lanes_apart > -0.05, (Tag(boxes.tag[row]).name, boxes.centre[row])
        if boxes.tag[row] != Tag.POLES:  # far poles of lights stand on the kerb of a sidewalk
            apart = (gap[paved] - width[paved] / 2.0).min()
            assert apart > -0.05, (Tag(boxes.tag[row]).name, boxes.centre[row])
        checked += 1
    assert checked > 400


def test_decks_leave_no_gap_below_the_elevated_lanes(town, scene):
    """Every quarter of a metre along them some deck lies below, its top within 2 cm of the lane."""
    lanes, boxes = town.lanes, scene.boxes
    decks = np.flatnonzero(boxes.material == Material.DECK)
    index = lane_points(town, LaneKind.DRIVING, elevated=True)
    index = index[lanes.point_lane[np.minimum(index + 1, len(lanes.points) - 1)]
                  == lanes.point_lane[index]]  # fmt: skip
    checked = 0
    for share in (0.0, 0.25, 0.5, 0.75):
        points = (1.0 - share) * lanes.points[index, :3] + share * lanes.points[index + 1, :3]
        points = points[points[:, 2] > 0.5]
        nearest = np.full(len(points), np.inf)
        for deck in decks:
            c, s = math.cos(boxes.yaw[deck]), math.sin(boxes.yaw[deck])
            pitch = math.tan(boxes.pitch[deck])
            along = c * (points[:, 0] - boxes.centre[deck, 0])
            along += s * (points[:, 1] - boxes.centre[deck, 1])
            across = c * (points[:, 1] - boxes.centre[deck, 1])
            across -= s * (points[:, 0] - boxes.centre[deck, 0])
            over = boxes.half[deck, 2] / math.cos(boxes.pitch[deck])
            top = boxes.centre[deck, 2] + over + pitch * along
            reach = boxes.half[deck, 0] * math.cos(boxes.pitch[deck])
            below = (np.abs(along) <= reach) & (np.abs(across) <= boxes.half[deck, 1])
            nearest = np.where(below, np.minimum(nearest, np.abs(top - points[:, 2])), nearest)
        assert nearest.max() < 0.02, (share, int((nearest > 0.02).sum()), points[nearest.argmax()])
        checked += len(points)
    assert checked > 4000


def test_the_same_town_gives_the_same_scene_again(town, scene):
    again = build_scene(town)
    for ours, theirs in zip(scene.boxes, again.boxes, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(scene.ground.texels, again.ground.texels)
    assert scene_of(town) is scene


def test_a_scene_cannot_be_written(scene):
    with pytest.raises(ValueError, match="read-only"):
        scene.boxes.centre[0] = 0.0


def collected(world, scene, ego=0, range_m=120.0):
    boxes = box_buffer()
    collect_boxes(scene, world.view.state, ego, range_m, boxes)
    return boxes


@pytest.fixture
def world(town):
    made = World(town, WorldConfig(vehicles=120, walkers=60))
    made.reset(3, [])
    return made


def test_actors_fill_their_own_boxes_and_the_ego_is_left_out(world, scene):
    boxes, state = collected(world, scene), world.view.state
    count = int(boxes.count[0])
    assert 200 < count < ROOM
    assert 1 not in boxes.instance[:count]
    for actor in np.unique(boxes.instance[:count])[1:] - 1:
        rows = np.flatnonzero(boxes.instance[:count] == actor + 1)
        top = (boxes.centre[rows, 2] + boxes.half[rows, 2]).max()
        assert top == pytest.approx(state.z[actor] + state.height[actor], abs=0.05)
        c, s = math.cos(state.yaw[actor]), math.sin(state.yaw[actor])
        along = (boxes.centre[rows, 0] - state.x[actor]) * c
        along += (boxes.centre[rows, 1] - state.y[actor]) * s
        reach = (along + boxes.half[rows, 0]).max()
        assert reach == pytest.approx(state.half_length[actor], rel=0.55)
        assert reach < state.half_length[actor] * 1.05 + 0.1


def test_one_lamp_of_each_head_is_lit_in_the_colour_of_its_light(world, scene, town):
    snapshot = world.save()
    views_of(snapshot.record).light[:] = LightState.GREEN
    world.restore(snapshot)
    boxes = collected(world, scene, range_m=1000.0)
    count = int(boxes.count[0])
    lamps = (boxes.material[:count] == Material.LAMP) & (boxes.tag[:count] == Tag.TRAFFIC_LIGHT)
    assert lamps.sum() * 3 == scene.lamps.signal.size
    assert (boxes.colour[:count][lamps].argmax(axis=1) == 1).all()


def test_brake_lights_and_indicators_shine(world, scene):
    snapshot = world.save()
    state = views_of(snapshot.record)
    (car, *_) = np.flatnonzero(state.kind == ActorKind.CAR)[1:]
    state.x[0], state.y[0] = state.x[car] - 5.0, state.y[car]
    state.brake_light[:], state.indicator[:] = 0, 0
    state.brake_light[car], state.indicator[car], state.tick[...] = 1, -1, 0
    world.restore(snapshot)
    boxes = collected(world, scene)
    count = int(boxes.count[0])
    lit = (boxes.material[:count] == Material.LAMP) & (boxes.instance[:count] == car + 1)
    assert lit.sum() == 4  # two brake lights, two indicators on the left


def test_far_away_only_large_parts_are_drawn_and_small_ones_that_shine(world, scene):
    snapshot = world.save()
    state = views_of(snapshot.record)
    (car, *_) = np.flatnonzero(state.kind == ActorKind.CAR)[1:]
    state.brake_light[:], state.indicator[:], state.tick[...] = 0, 0, 0
    drawn = []
    for away_m, side in ((5.0, 0), (DETAIL_M + 5.0, 0), (DETAIL_M + 5.0, 1)):
        state.x[0], state.y[0] = state.x[car] - away_m, state.y[car]
        state.indicator[car] = side
        world.restore(snapshot)
        boxes = collected(world, scene)
        drawn.append(int((boxes.instance[: int(boxes.count[0])] == car + 1).sum()))
    # body, glass, roof, 2 tail lights; 4 wheels, 2 headlights, 4 indicators; 2 of them on the right
    assert drawn == [5 + 10, 5, 5 + 2]


@pytest.mark.parametrize(
    ("kind", "tags"),
    [
        (ActorKind.CAR, {Tag.CAR}),
        (ActorKind.BICYCLE, {Tag.BICYCLE, Tag.RIDER}),
        (ActorKind.MOTORCYCLE, {Tag.MOTORCYCLE, Tag.RIDER}),
        (ActorKind.WALKER, {Tag.PEDESTRIANS}),
    ],
)
def test_who_sits_on_two_wheels_is_a_rider(kind, tags):
    parts = slice(PARTS.start[kind], PARTS.start[kind + 1])
    assert set(PARTS.tag[parts]) == tags
    skin = PARTS.role[parts] == Role.SKIN
    assert kind == ActorKind.CAR or set(PARTS.tag[parts][skin]) <= {Tag.RIDER, Tag.PEDESTRIANS}


def test_too_many_boxes_for_the_room_are_left_out(world, scene):
    from di_envs.sensors.scene.boxes import empty_boxes

    boxes = empty_boxes(50)
    collect_boxes(scene, world.view.state, 0, 500.0, boxes)
    assert boxes.count[0] == 50


@pytest.mark.parametrize(
    ("kind", "tag", "size"),
    [
        (ActorKind.DEBRIS, Tag.STATIC, (1.0, 0.9, 0.08)),
        (ActorKind.VENDING_MACHINE, Tag.DYNAMIC, (0.45, 0.55, 1.9)),
    ],
)
def test_props_of_scenarios_fill_their_boxes_and_carry_carlas_tags(world, scene, kind, tag, size):
    snapshot = world.save()
    state = views_of(snapshot.record)
    prop = int(np.flatnonzero(state.kind == ActorKind.CAR)[-1])
    state.x[prop], state.y[prop], state.z[prop] = state.x[0] + 10.0, state.y[0], 0.25
    state.yaw[prop], state.kind[prop] = math.pi / 2.0, kind
    state.half_length[prop], state.half_width[prop], state.height[prop] = size
    world.restore(snapshot)
    boxes = collected(world, scene)
    rows = np.flatnonzero(boxes.instance[: boxes.count[0]] == prop + 1)
    assert (boxes.tag[rows] == tag).all()
    centre, half = boxes.centre[rows], boxes.half[rows]
    half = np.stack([half[:, 1], half[:, 0], half[:, 2]], axis=1)  # it is turned by a right angle
    low, high = (centre - half).min(axis=0), (centre + half).max(axis=0)
    middle, reach = np.array([state.x[prop], state.y[prop]]), np.array([size[1], size[0]])
    np.testing.assert_allclose(low[:2], middle - reach, atol=0.25)
    np.testing.assert_allclose(high[:2], middle + reach, atol=0.25)
    assert low[2] == pytest.approx(0.25, abs=0.01)
    assert high[2] == pytest.approx(0.25 + size[2], abs=0.01)


@pytest.mark.parametrize(
    ("kind", "size", "lying"),
    [
        (ActorKind.WALKER, (0.25, 0.3, 1.8), (0.9, 0.3, 0.5)),  # along its heading
        (ActorKind.BICYCLE, (0.9, 0.3, 1.6), (0.9, 0.8, 0.6)),  # on its side
    ],
)
def test_who_was_knocked_down_lies(world, scene, kind, size, lying):
    snapshot = world.save()
    state = views_of(snapshot.record)
    who = int(np.flatnonzero(state.kind == ActorKind.CAR)[-1])
    state.x[who], state.y[who], state.z[who] = state.x[0] + 10.0, state.y[0], 0.25
    state.yaw[who], state.kind[who] = 0.0, kind
    state.half_length[who], state.half_width[who], state.height[who] = size
    state.walk_waiting[who] = DOWN
    world.restore(snapshot)
    boxes = collected(world, scene)
    rows = np.flatnonzero(boxes.instance[: boxes.count[0]] == who + 1)
    centre, half = boxes.centre[rows], boxes.half[rows]
    low, high = (centre - half).min(axis=0), (centre + half).max(axis=0)
    assert footprint(state, who) == pytest.approx(lying[:2])
    middle, reach = np.array([state.x[who], state.y[who]]), np.array(lying[:2])
    np.testing.assert_allclose(low[:2], middle - reach, atol=0.15)
    np.testing.assert_allclose(high[:2], middle + reach, atol=0.15)
    assert low[2] >= 0.25 - 0.01
    assert high[2] == pytest.approx(0.25 + lying[2], abs=0.15)
