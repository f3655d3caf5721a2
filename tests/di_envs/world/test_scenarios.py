"""What triggers scenarios, and what they do tick by tick, on a straight street."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from di_envs.prompt import OBSTACLES
from di_envs.prompt_surroundings import fill_obstacles
from di_envs.town.lanes import LightState
from di_envs.world.scenarios.tables import AHEAD, DONE
from di_envs.world.state import ActorKind, EventKind
from di_envs.world.world import World, WorldConfig
from tests.di_envs.world.scenario_street import FROM_NORTH, FROM_WEST, Street

GREEN, YELLOW, RED = LightState.GREEN, LightState.YELLOW, LightState.RED
FIRST = 1 + 3  # slots: an ego, three poles
WALKER, CYCLIST = 0, 5  # seeds with which a walker, or a cyclist, steps out from behind something


def of_kind(events, kind):
    return [event for event in events if event.kind == kind]


# triggers


def test_a_scenario_begins_when_the_nearest_route_point_is_within_a_metre_and_a_half():
    street = Street((10, "", 30))
    for x in range(28):
        street.lead(float(x))
    street.lead(28.4)  # nearest: 28, 2 m away
    assert street.events == []
    street.lead(28.6)  # nearest: 29
    (event,) = street.events
    assert (event.kind, event.value, event.other, event.x) == (EventKind.SCENARIO, 10.0, 0, 30.0)
    assert street.state.counts[0, EventKind.SCENARIO] == 1


def test_a_scenario_runs_once():
    street = Street((10, "", 3))
    for x in (0.0, 2.0, 4.0, 3.0, 2.0, 4.0):
        street.lead(x)
    assert len(street.events) == 1


def test_who_passes_by_beside_the_route_triggers_it_too():
    street = Street((10, "", 40))
    for x in range(45):
        with street.edit() as state:
            state.x[0], state.y[0], state.yaw[0] = float(x), 3.5, 0.0
        street.wait(0.05)
    assert len(of_kind(street.events, EventKind.SCENARIO)) == 1
    assert Street((10, "", 42)).lead(20.0).scenario_step[0] == AHEAD


def test_two_that_are_triggered_together_both_run():
    street = Street((3, "", 3), (1, "", 4))
    street.lead(0.0)
    street.lead(3.0, ticks=2)
    assert [event.value for event in street.events] == [3.0, 1.0]
    kinds = street.state.kind[FIRST:].tolist()
    assert kinds[1:] == [ActorKind.VENDING_MACHINE, *[ActorKind.DEBRIS] * 3]


def test_without_triggers_a_record_has_no_slots_for_them():
    capacity = Street().world.view.capacity
    assert (capacity.triggers, capacity.scenario_actors) == (0, 0)
    assert Street((1, "", 4)).world.view.capacity.actors == capacity.actors + 3


# 1: control loss


def on_debris(seed=0, ego=0, egos=1, ticks=40):
    street = Street((1, "", 2), seed=seed, egos=egos)
    street.lead(1.0, ego=ego)
    steer, throttle = [], []
    for _ in range(ticks):
        state = street.lead(15.9, ego=ego)
        steer.append(float(state.steer_noise[ego]))
        throttle.append(float(state.throttle_noise[ego]))
    return np.array(steer), np.array(throttle)


def test_over_debris_steering_is_off_by_0_055_and_throttle_by_0_03():
    steer, throttle = on_debris(ticks=200)
    assert abs(steer.mean()) == pytest.approx(0.055, abs=0.004)
    assert steer.std() == pytest.approx(0.015, abs=0.003)
    assert abs(throttle.mean()) == pytest.approx(0.03, abs=0.003)
    assert throttle.std() == pytest.approx(0.01, abs=0.002)


def test_signs_differ_between_seeds_and_noise_between_egos():
    signs = {float(np.sign(on_debris(seed)[0].mean())) for seed in range(4)}
    assert signs == {-1.0, 1.0}
    assert on_debris(egos=2, ego=1)[0].std() != on_debris(egos=2)[0].std()


def test_debris_acts_within_two_metres_and_turns_the_car():
    street = Street((1, "", 2))
    street.lead(1.0)
    assert street.lead(13.9).steer_noise[0] == 0.0  # 2.1 m before the patch at 16
    noise = float(street.lead(14.2).steer_noise[0])
    assert noise != 0.0
    assert np.sign(street.state.wheel[0]) == np.sign(noise)
    assert street.lead(18.3).steer_noise[0] == 0.0


def test_debris_is_no_collision_and_is_gone_110_metres_on():
    street = Street((1, "", 2))
    for x in np.arange(1.0, 111.0):
        street.lead(x, speed=5.0)
    assert (street.state.kind[FIRST:] == ActorKind.DEBRIS).all()
    for x in np.arange(111.0, 114.0):
        street.lead(x)
    assert (street.state.kind[FIRST:] == ActorKind.ABSENT).all()
    assert street.state.scenario_step[0] == DONE
    assert of_kind(street.events, EventKind.COLLISION_STATIC) == []


# 3 and 4: somebody crosses


def test_somebody_steps_out_at_once_and_is_gone_beyond_the_far_side():
    street = Street((3, "", 5), seed=WALKER)
    street.lead(0.0)
    state = street.lead(5.0)
    assert state.kind[FIRST : FIRST + 2].tolist() == [ActorKind.WALKER, ActorKind.VENDING_MACHINE]
    assert (state.x[FIRST], state.y[FIRST]) == (19.0, pytest.approx(7.0))
    street.wait(0.1)  # a tick to see that the ego is near enough, then he walks
    assert street.state.speed[FIRST] == pytest.approx(4.2)
    before = float(street.state.y[FIRST])
    street.wait(2.0)
    assert street.state.y[FIRST] == pytest.approx(before - 8.4)
    assert street.state.x[FIRST] == pytest.approx(19.0)
    street.wait(2.0)
    assert (street.state.kind[FIRST:] == ActorKind.ABSENT).all()
    assert street.state.scenario_step[0] == DONE


def test_one_in_four_rides_a_bicycle_by_key():
    kinds = []
    for seed in range(40):
        street = Street((3, "", 5), seed=seed)
        street.lead(0.0)
        kinds.append(int(street.lead(5.0).kind[FIRST]))
    assert set(kinds) == {ActorKind.WALKER, ActorKind.BICYCLE}
    assert 3 <= kinds.count(ActorKind.BICYCLE) <= 17
    assert kinds[WALKER] == ActorKind.WALKER
    assert kinds[CYCLIST] == ActorKind.BICYCLE


@pytest.mark.parametrize(
    ("seed", "collision"),
    [(WALKER, EventKind.COLLISION_WALKER), (CYCLIST, EventKind.COLLISION_VEHICLE)],
)
def test_who_drives_on_hits_him_and_that_counts_by_what_he_is(seed, collision):
    street = Street((3, "", 5), seed=seed)
    x, speed = 0.0, 7.5
    while x < 40.0:
        street.lead(x, speed)  # 11.5 m to him in 1.5 s: he has come 6.4 m, into its way
        x += speed * 0.05
    assert len(of_kind(street.events, collision)) == 1


def test_a_walker_who_was_knocked_down_lies_for_ten_seconds():
    street = Street((3, "", 5), seed=WALKER)
    x = 0.0
    while not of_kind(street.events, EventKind.COLLISION_WALKER) and x < 40.0:
        street.lead(x, 7.5)
        x += 0.375
    street.lead(40.0)  # leaves him
    street.wait(9.8)
    assert street.state.kind[FIRST] == ActorKind.WALKER
    street.wait(0.3)
    assert street.state.kind[FIRST] == ActorKind.ABSENT


def test_he_does_not_walk_into_the_side_of_a_car_that_stands_and_gives_up_after_ten_seconds():
    street = Street((3, "", 5), seed=WALKER)
    street.lead(0.0)
    street.lead(5.0)
    street.lead(19.0)  # right before him
    street.wait(5.0)
    assert street.state.y[FIRST] > 1.0642 + 0.25
    assert street.state.speed[FIRST] == 0.0
    assert of_kind(street.events, EventKind.COLLISION_WALKER) == []
    street.wait(7.0)
    assert street.state.kind[FIRST] == ActorKind.ABSENT


def test_who_is_taken_away_ends_his_scenario_and_before_it_began_it_never_does():
    street = Street((3, "", 5), (3, "", 40), seed=WALKER)
    street.lead(0.0)
    street.lead(5.0)
    street.world.remove_actor(FIRST)
    street.wait(0.1)
    assert street.state.scenario_step.tolist() == [DONE, AHEAD]
    street.world.remove_actor(FIRST + 2)
    for x in range(6, 45):
        street.lead(float(x))
    assert (street.state.kind[FIRST:] == ActorKind.ABSENT).all()
    assert len(of_kind(street.events, EventKind.SCENARIO)) == 1


def test_he_is_told_in_the_prompt_and_the_machine_is_not():
    street = Street((3, "", 5), seed=WALKER)
    street.lead(0.0)
    street.lead(5.0)
    street.wait(0.5)
    out = np.zeros((OBSTACLES, 9), np.float32)
    state = street.state
    pose = np.array([state.x[0], state.y[0], state.yaw[0]])
    fill_obstacles(state, 0, pose, 0.0, out)
    assert out[:, 8].sum() == 1
    assert out[0, 7] == ActorKind.WALKER
    assert out[0, 6] == pytest.approx(-4.2)  # to the left


def test_he_is_an_obstacle_in_highway_env():
    pytest.importorskip("highway_env")
    from di_envs.highway.conversion import to_highway_road

    for seed in (WALKER, CYCLIST):
        street = Street((3, "", 5), seed=seed)
        street.lead(0.0)
        street.lead(5.0)
        road = to_highway_road(street.world.view)
        assert len(road.objects) == 1


def test_the_cyclist_waits_until_the_ego_is_near_then_crosses_at_ten_metres_a_second():
    street = Street((4, "S4left", 60))
    for x in range(0, 108):
        street.lead(float(x))
    state = street.state
    assert (state.kind[FIRST], state.speed[FIRST]) == (ActorKind.BICYCLE, 0.0)
    assert (state.x[FIRST], state.y[FIRST]) == (129.0, pytest.approx(3.5))
    street.lead(109.0)  # 13 + 7.35 m before it
    state = street.lead(109.0)
    assert state.speed[FIRST] == 10.0
    street.wait(0.6)  # 7.35 m take 15 ticks of half a metre
    assert street.state.kind[FIRST] == ActorKind.BICYCLE
    street.wait(0.15)
    assert street.state.kind[FIRST] == ActorKind.ABSENT


def test_where_somebody_stands_already_the_scenario_moves_along_the_road():
    street = Street((3, "", 5), seed=WALKER)
    with street.edit() as state:
        state.x[2], state.y[2] = 19.2, 7.0  # a pole, 0.3 m wide
    street.lead(0.0)
    state = street.lead(5.0)
    assert state.x[FIRST] == pytest.approx(19.0 + 2 * 0.4)


# 7 to 9: lights


def shown(street):
    return [int(street.state.light[signal]) for signal in (FROM_WEST, FROM_NORTH)]


def at_the_line():
    street = Street((7, "S7left", 70))
    for x in range(0, 88):
        street.lead(float(x))
    return street


def test_the_egos_arm_is_green_until_ten_metres_before_the_junction():
    street = at_the_line()
    assert shown(street) == [GREEN, RED]
    street.wait(30.0)  # turns stand still
    assert shown(street) == [GREEN, RED]
    street.lead(89.9)
    street.wait(0.05)
    assert shown(street) == [GREEN, RED]
    street.lead(90.1)
    street.wait(0.05)
    assert shown(street) == [YELLOW, RED]


def test_yellow_lasts_two_seconds_and_red_as_long_as_the_distance_of_the_lights_says():
    street = at_the_line()
    street.lead(91.0)
    colours = []
    for _ in range(200):
        street.wait(0.05)
        colours.append(tuple(shown(street)))
    assert colours.count((YELLOW, RED)) == 40
    assert colours.count((RED, GREEN)) == round((1.5 + 0.04 * math.hypot(13.0, 15.0)) / 0.05)
    assert colours[-1] == (GREEN, GREEN)


def test_turns_go_on_where_they_stood_once_the_ego_has_left():
    street = at_the_line()
    street.lead(91.0)
    ticks = int(street.state.phase_ticks[0])
    street.wait(10.0)
    for x in range(92, 119):
        street.lead(float(x))
    assert shown(street) == [GREEN, GREEN]
    assert street.state.held_by[0] == 1
    street.lead(120.0)
    assert street.state.held_by[0] == 0
    assert (street.state.forced_light == 0).all()
    assert int(street.state.phase_ticks[0]) == ticks
    street.wait(0.05)
    assert int(street.state.phase_ticks[0]) == ticks + 1


def test_an_ego_that_never_goes_loses_its_lights_after_three_minutes():
    street = at_the_line()
    street.wait(170.0)
    assert street.state.held_by[0] == 1
    street.wait(30.0)
    assert street.state.held_by[0] == 0


def test_an_ego_that_is_taken_away_gives_its_lights_back():
    street = at_the_line()
    street.world.remove_actor(0)
    street.wait(0.05)
    assert (street.state.held_by[0], street.state.scenario_step[0]) == (0, DONE)


def test_two_egos_play_with_the_same_lights_one_after_the_other():
    street = Street((7, "S7left", 70), egos=2)
    for x in range(0, 80):
        street.lead(float(x))
        street.lead(float(max(x - 8, 0)), ego=1)
    assert street.state.held_by[0] == 1
    for x in range(80, 122):
        street.lead(float(x))
    street.wait(0.1)
    assert street.state.held_by[0] == 2
    assert [event.ego for event in of_kind(street.events, EventKind.SCENARIO)] == [0, 1]


# the state


THERE = np.arange(0.0, 125.0)


def all_at_once(seed=0):
    return Street((1, "", 3), (3, "", 5), (7, "S7left", 70), (4, "S4left", 75), seed=seed)


def drive_on(street, xs):
    for x in xs:
        street.lead(float(x), speed=8.0)
    return street.world.save().record.tobytes()


def test_a_world_saved_in_the_middle_of_scenarios_goes_on_with_the_same_bits():
    street, snapshots = all_at_once(), {}
    for cut, x in enumerate(THERE):
        snapshots[cut] = street.world.save()
        drive_on(street, (x,))
    end = street.world.save().record.tobytes()
    other = all_at_once(seed=5)
    for cut in (6, 12, 92, 100, 117):
        other.world.restore(snapshots[cut])
        assert drive_on(other, THERE[cut:]) == end


PROGRAM = """
import hashlib, sys
sys.path.insert(0, sys.argv[1])
from tests.di_envs.world.test_scenarios import THERE, all_at_once, drive_on
print(hashlib.sha256(drive_on(all_at_once(), THERE)).hexdigest())
"""


def test_a_fresh_process_sees_the_same_bits():
    here = hashlib.sha256(drive_on(all_at_once(), THERE)).hexdigest()
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(Path(__file__).parents[3])],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == here


def test_a_snapshot_of_other_scenarios_is_refused_by_a_world_of_another_kind():
    snapshot = all_at_once().world.save()
    other = World(Street().world.town, WorldConfig(vehicles=0, walkers=1))
    with pytest.raises(ValueError, match="layout"):
        other.restore(snapshot)
