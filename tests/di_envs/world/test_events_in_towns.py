"""Every stop line of a town fines whoever runs it, by its own rule, and nobody else."""

import numpy as np
import pytest

from di_envs.town.lanes import LightState, SignalKind
from di_envs.town.loading import load_town
from di_envs.town.queries import pose_at
from di_envs.world.dynamics import locate_ego
from di_envs.world.events.watching import begin_events, detect_events
from di_envs.world.state import Capacity, EventKind, state_dtype, views_of
from tests.di_envs.world.small_world import make_routes, make_state, rows

STEP_M = 0.5


def way_through(lanes, lane):
    """Poses from 30 m before a lane's end (or its start) to 30 m behind it, on one way ahead."""
    path = [lane]
    while sum(lanes.length_m[path[1:]]) < 30.0:
        first = lanes.successor_start[path[-1]]
        if first == lanes.successor_start[path[-1] + 1]:
            break
        path.append(int(lanes.successor[first]))
    poses = []
    for k, part in enumerate(path):
        begin = max(lanes.length_m[part] - 30.0, 0.0) if k == 0 else 0.0
        poses += [pose_at(lanes, part, s) for s in np.arange(begin, lanes.length_m[part], STEP_M)]
    return np.array(poses)


def fines(town, state, poses, light):
    """What an ego is fined for that drives along poses at 10 m/s under lights that stand still."""
    routes, out = make_routes(poses), rows()
    begin_events(state, 0)
    state.light[:] = light
    state.speed[0] = 10.0
    n = 0
    for x, y, z, yaw in poses[:-1]:
        state.tick[()] += 1
        state.x[0], state.y[0], state.z[0], state.yaw[0] = x, y, z, yaw
        locate_ego(state, town.lanes, 0)
        n = detect_events(state, town.lanes, town.signals, routes, 0, 1, out, n)
    return [(EventKind(int(row[0])), int(row[6])) for row in out[:n]]


def town_of(name, shared):
    if name == "real":
        return load_town(shared / "data" / "xodr" / "Town05.xodr", signals="town05")
    return load_town(name)


@pytest.mark.parametrize("name", ["toy", "town05", "real"])
def test_every_stop_line_fines_who_runs_it(name, request):
    town = town_of(name, request.getfixturevalue("shared") if name == "real" else None)
    signals = town.signals
    small = make_state()
    junctions, heads = signals.groups.size, signals.kind.size
    state = views_of(np.zeros(1, state_dtype(Capacity(1, 0, 0, 0, junctions, heads))))
    for size in ("half_length", "half_width", "height"):
        getattr(state, size)[0] = getattr(small, size)[0]
    missed = []
    for line in range(signals.stop_lane.size):
        signal = int(signals.stop_signal[line])
        poses = way_through(town.lanes, signals.stop_lane[line])
        under_red = fines(town, state, poses, LightState.RED)
        under_green = fines(town, state, poses, LightState.GREEN)
        expected = {
            SignalKind.LIGHT: [(EventKind.RED_LIGHT, signal), (EventKind.RED_LIGHT_WIDE, signal)],
            SignalKind.STOP: [(EventKind.STOP_SIGN, signal)],
        }.get(SignalKind(signals.kind[signal]), [])
        allowed = expected if signals.kind[signal] == SignalKind.STOP else []
        if under_red != expected or under_green != allowed:
            missed.append((line, SignalKind(signals.kind[signal]).name, under_red, under_green))
    assert signals.stop_lane.size > 0
    assert missed == []
