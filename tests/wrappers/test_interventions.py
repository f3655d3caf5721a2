"""Observation edits: values with a text form, what each does to the numbers, what is refused."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from di_envs.edits.conditions import Condition
from di_envs.edits.text import EditError
from di_envs.observation import observation_space
from di_envs.presets import Form
from di_envs.prompt import COMPONENTS
from di_envs.route_env import RouteEnv
from wrappers.interventions import EDITS, ObservationEdit, ObservationEditing, setting
from wrappers.interventions.context import EditContext
from wrappers.interventions.losing import Blackout, Delay, Mask, Thin
from wrappers.interventions.presence import Clear, Drop, Identity, Zero
from wrappers.interventions.table import read_observation_edits
from wrappers.interventions.values import Noise, Recolour, Replace, SetValue, Shift

SPACE = observation_space(("prompt", "inertial", "camera", "lidar", "odometry"), cameras="rl")
EXAMPLES = (
    "drop:routing", "zero:routing", "clear:obstacles", "set:speed=10", "noise:map,sigma=0.5",
    "mask:map,p=0.3", "recolour:lights=red@t>5", "shift:routing+target_point,lateral=3.5",
    "replace:command=LEFT", "blackout:camera_front", "thin:lidar,keep=0.25", "delay:speed,steps=5",
    "identity:all", "set:target_point,x=30,y=0@junction<20m", "recolour:lights=green,from=red",
    "drop:map+speed@t>5&t<9", "noise:camera_front,sigma=8", "mask:camera_front,p=0.5",
    "noise:imu+speed_history,sigma=0.1", "noise:lidar,sigma=0.2", "blackout:cameras",
    "zero:all@route>50%", "clear:lidar+command", "shift:map,ahead=-2", "delay:all,steps=2",
    "noise:odometry,sigma=1,seed=4",
)  # fmt: skip
NUMBERS = st.floats(0.0, 1.0)
WHEN = st.sampled_from(("", "t>5", "t>5&t<9", "junction<20m")).map(Condition.of)


def some(*names):
    return st.lists(st.sampled_from(names), min_size=1, max_size=3, unique=True).map(tuple)


VALUES = st.one_of(
    st.builds(Identity, targets=some(*SPACE.spaces, "all"), when=WHEN),
    st.builds(Drop, targets=some(*COMPONENTS, "lights"), when=WHEN),
    st.builds(Zero, targets=some(*SPACE.spaces, "all", "cameras"), when=WHEN),
    st.builds(Clear, targets=some("routing", "map", "obstacles", "lidar", "command"), when=WHEN),
    st.builds(SetValue, targets=some("speed", "speed_history"), number=NUMBERS, when=WHEN),
    st.builds(
        SetValue, targets=some("obstacles"), when=WHEN,
        columns=st.sampled_from(((("vx", 2.5),), (("x", -3.0), ("y", 0.25)))),
    ),
    st.builds(Noise, targets=some("map", "speed", "lidar", "imu"), sigma=NUMBERS, when=WHEN),
    st.builds(Mask, targets=some("map", "routing", "camera_front"), p=NUMBERS, when=WHEN),
    st.builds(
        Shift, targets=some("routing", "target_point", "map"), when=WHEN,
        lateral_m=st.floats(-300.0, 300.0), ahead_m=st.floats(-300.0, 300.0),
    ),
    st.builds(
        Recolour, targets=some("lights"), colour=st.sampled_from(("red", "none")),
        seen=st.none() | st.just("green"), when=WHEN,
    ),
    st.builds(Replace, targets=some("command"), command=st.sampled_from(("NONE", "LEFT"))),
    st.builds(Blackout, targets=some("cameras", "camera_front"), when=WHEN),
    st.builds(Thin, targets=some("lidar"), keep=NUMBERS, seed=st.integers(0, 9), when=WHEN),
    st.builds(Delay, targets=some("speed", "map", "all"), steps=st.integers(0, 4), when=WHEN),
)  # fmt: skip


def moment(decision=60, junction_m=10.0, seed=5):
    return EditContext(
        seed=seed,
        tick=2 * decision,
        decision=decision,
        time_s=0.1 * decision,
        route_completion=40.0,
        junction_m=junction_m,
    )


def edited(text, observation, context=None, space=None):
    editing = ObservationEditing(text, space or SPACE)
    return editing.apply(observation, context or moment(), editing.start())[0]


@pytest.fixture(scope="module")
def seen():
    """What there is to see 4 s into a drive on a street with others and lights."""
    env = RouteEnv(
        suite="town05_tiny", cameras="rl", traffic=60,
        observations=("prompt", "inertial", "camera", "lidar", "odometry"),
    )  # fmt: skip
    observation, _ = env.reset(seed=3, options={"route": 0})
    for _ in range(40):
        observation, *_ = env.step(np.array([0.5, 0.0, 0.0], np.float32))
    assert (observation["obstacles"][:, -1] > 0).sum() > 2
    assert (observation["traffic_lights"][:, -1] > 0).any()
    return observation


@pytest.mark.parametrize("text", EXAMPLES)
def test_the_usual_texts_stay_as_they_are(text):
    assert "; ".join(map(str, read_observation_edits(text))) == text


@given(edits=st.lists(VALUES, max_size=3))
def test_edits_survive_the_way_through_their_text(edits):
    assert read_observation_edits("; ".join(map(str, edits))) == tuple(edits)


def test_every_edit_has_an_example():
    assert {text.partition(":")[0] for text in EXAMPLES} == set(EDITS)


@settings(max_examples=60, deadline=None)
@given(edits=st.lists(VALUES, max_size=3), decision=st.integers(0, 99))
def test_what_is_shown_stays_in_its_space_and_what_was_given_as_it_was(seen, edits, decision):
    before = {name: np.copy(value) for name, value in seen.items()}
    for value in seen.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    editing = ObservationEditing(edits, SPACE)
    shown, _ = editing.apply(seen, moment(decision), editing.start())
    assert SPACE.contains(dict(shown))
    for name, value in before.items():
        assert np.array_equal(value, seen[name])
        assert np.asarray(shown[name]).dtype == value.dtype


@pytest.mark.parametrize("text", ["", "identity:all", "drop:routing@t>99", "shift:map,ahead=0"])
def test_what_edits_nothing_changes_no_bit(seen, text):
    shown = edited(text, seen)
    for name, value in seen.items():
        assert np.array_equal(shown[name], value), name


def test_the_three_ways_to_take_a_component_away_differ(seen):
    dropped, zeroed, cleared = (
        edited(f"{verb}:routing", seen) for verb in ("drop", "zero", "clear")
    )
    flag = COMPONENTS.index("routing")
    assert dropped["prompt_present"].tolist() == [int(n != flag) for n in range(len(COMPONENTS))]
    assert np.array_equal(dropped["routing"], seen["routing"])
    assert zeroed["prompt_present"].all()
    assert cleared["prompt_present"].all()
    assert not zeroed["routing"][:, :-1].any()
    assert np.array_equal(zeroed["routing"][:, -1], seen["routing"][:, -1])
    assert not cleared["routing"].any()


def test_a_route_shifted_to_the_right_lies_beside_itself():
    routing = np.zeros((50, 4), np.float32)
    routing[:3] = [[1.0, 0.0, 0.0, 1.0], [2.0, 0.0, 0.0, 1.0], [2.0, 1.0, np.pi / 2, 1.0]]
    space = gymnasium.spaces.Dict({"routing": SPACE["routing"]})
    shown = edited("shift:routing,lateral=3.5", {"routing": routing}, space=space)["routing"]
    # Ahead is right of nothing: of a point that looks to the right, right is behind.
    expected = [[1.0, 3.5], [2.0, 3.5], [-1.5, 1.0]]
    np.testing.assert_allclose(shown[:3, :2], expected, atol=1e-6)
    assert not shown[3:].any()


def test_lights_are_recoloured_both_ways(seen):
    lights = seen["traffic_lights"].copy()
    lights[:3, 3:] = [[1, 1], [2, 1], [3, 1]]
    lights[3:] = 0
    given_ = {**seen, "traffic_lights": lights}
    assert edited("recolour:lights=red", given_)["traffic_lights"][:4, 3].tolist() == [3, 3, 3, 0]
    green = edited("recolour:lights=green,from=red", given_)["traffic_lights"]
    assert green[:4, 3].tolist() == [1, 2, 1, 0]


def test_values_are_set_where_there_are_rows(seen):
    shown = edited("set:speed=10; set:obstacles,vx=0,vy=0", seen)
    assert shown["speed"].tolist() == [10.0]
    there = seen["obstacles"][:, -1] > 0
    assert not shown["obstacles"][:, 5:7].any()
    assert np.array_equal(shown["obstacles"][there, :5], seen["obstacles"][there, :5])


def test_noise_has_its_spread_and_moves_only_what_is_there(seen):
    shown = edited("noise:map,sigma=0.5", seen)["map"]
    moved = (shown - seen["map"]).astype(np.float64)
    there = seen["map"][..., -1] > 0
    assert not moved[~there].any()
    assert not moved[..., 2:].any()
    assert moved[there][:, :2].std() == pytest.approx(0.5, abs=0.05)


def test_noise_on_an_image_is_normal_number_by_number_and_anew_in_each_world():
    grey = np.full(SPACE["camera_front"].shape, 128, np.uint8)
    editing = ObservationEditing("noise:camera_front,sigma=8", SPACE)
    contexts = [moment(seed=5), moment(seed=6)]
    alone = [
        editing.apply({"camera_front": grey}, context, editing.start())[0]["camera_front"]
        for context in contexts
    ]
    moved = alone[0].astype(np.float64) - 128.0
    assert moved.mean() == pytest.approx(0.0, abs=0.1)
    assert moved.std() == pytest.approx(8.0, abs=0.1)
    assert (np.abs(moved) <= 8.0).mean() == pytest.approx(0.712, abs=0.01)  # Phi(8.5/8), both sides
    flat = moved.ravel()
    for apart in (1, 2, 3, grey.shape[1] * 3):
        assert abs(np.corrcoef(flat[:-apart], flat[apart:])[0, 1]) < 0.02
    assert abs(np.corrcoef(flat, alone[1].ravel())[0, 1]) < 0.02

    both = EditContext(
        **{
            part.name: np.array([getattr(context, part.name) for context in contexts])
            for part in dataclasses.fields(EditContext)
        }
    )
    seen = {"camera_front": np.stack([grey, grey])}
    together, _ = editing.apply(seen, both, editing.start())
    assert np.array_equal(together["camera_front"], np.stack(alone))


def test_the_share_that_is_lost_is_the_one_that_was_asked_for(seen):
    thinned = edited("thin:lidar,keep=0.25", seen)["lidar"]
    hit = seen["lidar"].any(axis=1)
    kept = thinned.any(axis=1)
    assert not (kept & ~hit).any()
    assert kept.sum() / hit.sum() == pytest.approx(0.25, abs=0.04)
    masked = edited("mask:map,p=0.5", seen)["map"]
    lost = [not row.any() for row in masked]
    assert 16 < sum(lost) < 48
    assert all(
        not row.any() or np.array_equal(row, old)
        for row, old in zip(masked, seen["map"], strict=True)
    )


def test_a_masked_image_is_black_in_blocks_and_a_blacked_out_one_everywhere(seen):
    image = edited("mask:camera_front,p=0.5", seen)["camera_front"]
    blocks = image[:80, :80].reshape(5, 16, 5, 16, 3).any(axis=(1, 3, 4))
    assert 5 < blocks.sum() < 20
    assert not edited("blackout:cameras", seen)["camera_front"].any()


def test_the_command_is_replaced(seen):
    shown = edited("replace:command=LEFT", seen)["command"]
    assert (shown, type(shown)) == (1, np.int64)


def test_what_is_seen_late_is_what_was_seen_before():
    space = gymnasium.spaces.Dict({"speed": SPACE["speed"]})
    editing = ObservationEditing("delay:speed,steps=2", space)
    memory, shown = editing.start(), []
    for decision, speed in enumerate((1.0, 2.0, 3.0, 4.0, 5.0)):
        given_ = {"speed": np.array([speed], np.float32)}
        now, memory = editing.apply(given_, moment(decision), memory)
        shown.append(float(now["speed"][0]))
    assert shown == [1.0, 1.0, 1.0, 2.0, 3.0]


def test_a_delay_remembers_what_came_before_it_held():
    space = gymnasium.spaces.Dict({"speed": SPACE["speed"]})
    editing = ObservationEditing("delay:speed,steps=2@t>0.25", space)
    memory, shown = editing.start(), []
    for decision in range(5):
        given_ = {"speed": np.array([float(decision)], np.float32)}
        now, memory = editing.apply(given_, moment(decision), memory)
        shown.append(float(now["speed"][0]))
    assert shown == [0.0, 1.0, 2.0, 1.0, 2.0]


def test_edits_are_made_one_after_the_other(seen):
    assert edited("set:speed=10; zero:speed", seen)["speed"].tolist() == [0.0]
    assert edited("zero:speed; set:speed=10", seen)["speed"].tolist() == [10.0]
    twice = edited("shift:map,ahead=1; shift:map,ahead=2", seen)["map"]
    np.testing.assert_allclose(twice, edited("shift:map,ahead=3", seen)["map"], atol=1e-4)


def test_draws_depend_on_the_edit_the_seed_and_the_tick_and_on_nothing_else(seen):
    text = "noise:map,sigma=0.5"
    one = edited(text, seen)["map"]
    assert np.array_equal(one, edited(text, seen)["map"])
    assert np.array_equal(one, edited(f"zero:speed; {text}@t>1", seen)["map"])
    for other in (
        edited(text, seen, moment(decision=61)),
        edited(text, seen, moment(seed=6)),
        edited(f"{text},seed=1", seen),
    ):
        assert not np.array_equal(one, other["map"])


@pytest.mark.parametrize("text", [each for each in EXAMPLES if "camera" not in each])
def test_many_worlds_get_what_each_gets_alone_to_the_bit(seen, text):
    editing = ObservationEditing(text, SPACE)
    other = {name: np.zeros_like(value) for name, value in seen.items()}
    worlds = (seen, other, seen)
    rows = {name: np.stack([world[name] for world in worlds]) for name in seen}
    batch = EditContext(
        seed=np.array([5, 5, 8]), tick=np.array([120, 120, 80]), decision=np.array([60, 60, 40]),
        time_s=np.array([6.0, 6.0, 4.0]), route_completion=np.array([40.0, 60.0, 60.0]),
        junction_m=np.array([10.0, np.inf, 30.0]),
    )  # fmt: skip
    together, _ = editing.apply(rows, batch, editing.start())
    for row, world in enumerate(worlds):
        fields = {
            name: getattr(batch, name)[row] for name in EditContext.__slots__ if name != "ego"
        }
        alone, _ = editing.apply(world, EditContext(**fields), editing.start())
        for name, value in alone.items():
            assert np.array_equal(together[name][row], value), (row, name)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("dop:routing", "did you mean 'drop'"),
        ("drop:rooting", "did you mean 'routing'"),
        ("drop:lidar", "only components of the prompt have a flag"),
        ("clear:speed", "a zero is a value of speed like any other"),
        ("set:speed", "does not say what to set"),
        ("set:speed=fast", "is a number, not 'fast'"),
        ("set:speed=1000", r"speed lies in \[-100, 100\], not 1000"),
        ("set:routing=3", r"name its columns \(x, y, yaw, valid\)"),
        ("set:routing,z=3", "Unknown column of routing 'z'"),
        ("set:obstacles,valid=1", "an edit makes no row appear"),
        ("noise:map", "does not say its sigma"),
        ("noise:map,sigma=-1", r"sigma lies in \[0, inf\], not -1"),
        ("noise:command,sigma=1", "holds no places, speeds or images"),
        ("noise:map,sgima=1", "did you mean 'sigma'"),
        ("mask:map,p=1.5", r"p lies in \[0, 1\], not 1.5"),
        ("mask:lidar,p=0.5", "write thin:lidar,keep=0.5"),
        ("thin:map,keep=0.5", "map has no rays"),
        ("thin:lidar,keep=nan", r"keep lies in \[0, 1\]"),
        ("recolour:lights=blue", "Unknown colour of a light 'blue'"),
        ("recolour:routing=red", "write recolour:lights=red"),
        ("replace:command=LEFTT", "did you mean 'LEFT'"),
        ("blackout:map", "map is no camera's image"),
        ("blackout:camera_frnt", "did you mean 'camera_front'"),
        ("delay:speed,steps=1.5", "steps is a whole number, not '1.5'"),
        ("drop:routing=3", "takes no '=3'"),
        ("drop:routing@later", "cannot read the condition"),
        ("shift:speed,lateral=1", "speed holds no places to move"),
        ("nowhere.Edit:map", "nowhere cannot be imported"),
        ("wrappers.interventions.edit.Draws:map", "no ObservationEdit called Draws"),
    ],
)
def test_what_cannot_be_done_is_refused_with_what_can(text, message):
    with pytest.raises(EditError, match=message):
        ObservationEditing(text, SPACE)


def test_a_flag_that_the_agent_does_not_see_cannot_be_cleared():
    with pytest.raises(EditError, match="sees no prompt_present"):
        ObservationEditing("drop:speed", observation_space(("inertial",)))


@dataclass(frozen=True, kw_only=True)
class Scale(ObservationEdit):
    """An edit of a user's own, which may leave the space."""

    verb = f"{__name__}.Scale"
    by: float = setting("by")

    def edited(self, name, value, draws, context):
        return value * self.by


def test_an_edit_of_ones_own_is_found_by_its_place_in_code_and_kept_in_the_space(seen):
    text = f"{__name__}.Scale:speed_history+routing,by=1000"
    (edit,) = read_observation_edits(text)
    assert (edit, str(edit)) == (Scale(targets=("speed_history", "routing"), by=1000.0), text)
    shown = edited(text, seen)
    assert SPACE.contains(dict(shown))
    assert shown["routing"][0, 0] == 100.0
    (same,) = read_observation_edits("scale:speed,by=2", {**EDITS, "scale": Scale})
    assert same == Scale(targets=("speed",), by=2.0)


def test_an_edit_of_ones_own_that_makes_no_numbers_is_told_so(seen):
    with np.errstate(over="ignore", invalid="ignore"), pytest.raises(EditError, match="not finite"):
        edited([Scale(targets=("routing",), by=1e308)], {**seen, "routing": seen["routing"] * 1e3})


@pytest.mark.parametrize("preset", ["box", "flat"])
def test_what_a_preset_shows_is_not_edited(preset):
    space = Form(observation_space(("prompt",)), preset).space
    with pytest.raises(EditError, match=r"without a preset|expected a Dict"):
        ObservationEditing("drop:routing", space)
