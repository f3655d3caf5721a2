"""The report's page: its data is the replay's, it asks for nothing, and it says what is missing."""

from __future__ import annotations

import dataclasses
import io
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from rich.console import Console

from di_envs.drawing.outlines import BRIDGE_M
from di_envs.suites import load_suite
from di_envs.town.loading import load_town
from di_envs.world.kinds import ActorKind
from di_envs.world.struck import DOWN
from leaderboard.commands.cli import main
from leaderboard.pages.report_page import ReportError, make_report, report_page, write_report
from leaderboard.pages.town_svg import CLOSE_M, CM, line_path, simplified, town_svg
from leaderboard.records.blocks import read_block
from leaderboard.records.record import OUT_OF_TIME
from leaderboard.records.results import read_run, write_run
from leaderboard.replaying.film import ABOVE, LIES, NEAR_M
from leaderboard.replaying.replay import replay, replay_env
from leaderboard.running.jobs import RunSpec
from leaderboard.running.runner import evaluate
from tests.leaderboard.pages.headless_browser import browser_page, find_browser

TOY = load_suite("toy")
ROUTES = tuple(spec.route_id for spec in TOY.specs()[:2])
BUSY = {"suite": "toy", "traffic": 8, "walkers": 4, "route_ids": ROUTES}
PAGE_BYTES = 400_000  # of two short routes in the toy town


class Elements(HTMLParser):
    """All start tags of a page with their attributes."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def of(self, tag):
        return [attributes for name, attributes in self.found if name == tag]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A drive into the traffic: collisions, a red light, lanes left."""
    folder = tmp_path_factory.mktemp("run")
    spec = RunSpec(agent="random", options=BUSY)
    evaluate(spec, [0], suite=TOY, folder=folder, console=Console(file=io.StringIO()))
    return folder


@pytest.fixture(scope="module")
def run(folder):
    return read_run(folder)


@pytest.fixture(scope="module")
def made(run):
    return make_report(run)


@pytest.fixture(scope="module")
def page(made):
    return made[0]


@pytest.fixture(scope="module")
def page_file(page, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_report(path, page)
    return path


def script_of(page, identity):
    return re.search(rf'<script[^>]* id="{identity}">(.*?)</script>', page, re.DOTALL)[1]


def test_the_pages_positions_are_the_replays_to_a_centimetre(run, page):
    record = run.routes[0]
    meta, columns = read_block(script_of(page, f"block-{record.index}"))
    at = {int(tick): moment for moment, tick in enumerate(columns["tick"])}
    starts = np.cumsum([0, *columns["track_count"]])
    seen = 0
    for step in replay(run, record, env=replay_env(run)):
        state = step.view.state
        moment = at.pop(int(state.tick))
        for name in ("x", "y"):
            assert abs(columns[f"ego_{name}"][moment] - getattr(state, name)[0]) < 0.0051
        assert np.cos(columns["ego_yaw"][moment] - state.yaw[0]) > 1 - 1e-6
        assert abs(columns["ego_speed"][moment] - state.speed[0]) < 0.0051
        assert abs(columns["score"][moment] - step.info["driving_score"]) < 0.0051
        if step.control is not None:
            assert abs(columns["steer"][moment] - step.control[1]) < 0.00051
        near = np.hypot(state.x - state.x[0], state.y - state.y[0]) < NEAR_M
        lively = (state.kind != ActorKind.ABSENT) & (state.kind != ActorKind.PROP)
        expected = set(np.flatnonzero(near & lively)) - {0}
        first = columns["track_moment"]
        tracks = np.flatnonzero((first <= moment) & (moment < first + columns["track_count"]))
        assert set(columns["track_actor"][tracks]) == expected
        for track in tracks.astype(int):
            actor = int(columns["track_actor"][track])
            row = int(starts[track] + moment - first[track])
            assert abs(columns["actor_x"][row] - state.x[actor]) < 0.0051
            assert abs(columns["actor_y"][row] - state.y[actor]) < 0.0051
            assert np.cos(columns["actor_yaw"][row] - state.yaw[actor]) > 1 - 1e-6
            flags = int(columns["actor_flags"][row])
            assert bool(flags & ABOVE) == (state.z[actor] > BRIDGE_M)
            assert bool(flags & LIES) == (state.walk_waiting[actor] == DOWN)
            assert meta["kinds"][int(columns["track_kind"][track])] == (
                ActorKind(int(state.kind[actor])).name.lower()
            )
            seen += 1
        lights = {}
        for when, light, shows in zip(
            columns["light_moment"], columns["light"], columns["light_state"], strict=True
        ):
            if when <= moment:
                lights[int(light)] = int(shows)
        assert lights == {i: s for i, s in enumerate(state.light.tolist()) if i in lights or s}
    assert not at
    assert seen > 100
    assert columns["completion"][-1] == pytest.approx(step.info["route_completion"], abs=0.0051)


def test_the_page_asks_for_nothing(page):
    elements = Elements(page)
    for tag, attributes in elements.found:
        assert not {"src", "srcset", "action", "data", "poster"} & attributes.keys(), tag
        assert attributes.get("href", "#").startswith("#"), (tag, attributes)
    assert not elements.of("link")
    assert not re.search(r"https?://|//cdn|@import|url\(|fetch\(|XMLHttpRequest|import\(", page)
    policy = next(meta for meta in elements.of("meta") if "http-equiv" in meta)
    assert policy["content"].startswith("default-src 'none'")


def test_tables_can_be_read_without_script_and_say_how_they_are_sorted(run, page):
    elements = Elements(page)
    assert [table["id"] for table in elements.of("table")] == ["routes", "events"]
    assert all(table["class"] == "sortable" for table in elements.of("table"))
    headings = elements.of("th")
    assert all(heading["data-sort"] in ("number", "text") for heading in headings)
    for record in run.routes:
        assert f'data-value="{record.score.driving_score}"' in page
    counted = sum(event.kind.name == "RED_LIGHT" for r in run.routes for event in r.events)
    assert page.count('<g class="mark kind-red_light">') == counted
    marks = [a for a in elements.of("a") if "aria-label" in a]
    assert len(marks) == page.count('<g class="mark kind-') > 3
    assert all(re.fullmatch(r"#route=\S+&seed=0&t=[\d.]+", mark["href"]) for mark in marks)


def test_a_small_runs_page_is_small(page):
    assert len(page) < PAGE_BYTES


def test_names_cannot_break_the_page(run):
    odd = dataclasses.replace(run, agent="</script><b>&\"'")
    page, _ = make_report(odd, ROUTES[:1])
    assert "<b>" not in page
    assert "&lt;/script&gt;&lt;b&gt;&amp;" in page


def test_only_the_chosen_routes_are_on_the_page_and_a_wrong_id_lists_them(run):
    page, films = make_report(run, ROUTES[1:])
    assert [film.record.route_id for film in films] == [ROUTES[1]]
    assert "This page is about 1 of the 2 routes x seeds." in page
    with pytest.raises(ReportError, match=f"no route 77; it has: {', '.join(ROUTES)}"):
        make_report(run, ["77"])


def test_a_lost_route_is_shown_as_lost_and_has_no_replay(run):
    first = dataclasses.replace(run.routes[0], status=OUT_OF_TIME, reason="a step took 61 s")
    lost = dataclasses.replace(run, routes=(first, run.routes[1]))
    page, films = make_report(lost)
    assert [bool(film.block) for film in films] == [False, True]
    assert "lost: Wall-clock limit" in page
    assert "a step took 61 s" in page
    head = json.loads(script_of(page, "report"))
    assert head["routes"][0]["block"] is None


def test_a_record_that_the_replay_does_not_follow_is_not_shown_as_one(run):
    record = run.routes[0]
    moved = (*record.trace[:4], (record.trace[4][0], 0.0, *record.trace[4][2:]), *record.trace[5:])
    other = dataclasses.replace(run, routes=(dataclasses.replace(record, trace=moved),))
    page, films = make_report(other)
    assert films[0].problem.startswith("cannot be replayed here: at 2 s the replay is ")
    assert "cannot be replayed here: at 2 s" in page


def test_a_run_of_other_versions_says_that_bits_may_differ(run):
    other = dataclasses.replace(run, versions={**run.versions, "numpy": "1.0"})
    page, _ = make_report(other, ROUTES[:1])
    assert re.search(r"Replayed on numpy [\d.]+, not 1.0 in the run: bits may differ", page)
    assert "Replayed on" not in make_report(run, ROUTES[:1])[0]


def test_what_was_done_to_the_world_stands_before_the_figures(run):
    first = dataclasses.replace(run.routes[0], interventions=("change:weather=HardRainNoon@t=1",))
    page, films = make_report(dataclasses.replace(run, routes=(first,)))
    assert films[0].block  # weather moves nobody
    assert "what the agent saw: change:weather=HardRainNoon@t=1." in page


def test_an_unfinished_run_says_what_is_missing(run):
    half = dataclasses.replace(run, routes=run.routes[:1])
    assert "Not complete: 1 of 2 routes x seeds were driven." in make_report(half)[0]
    with pytest.raises(ReportError, match="no route of the run is finished yet"):
        make_report(dataclasses.replace(run, routes=()))


def test_the_command_writes_the_page_beside_the_run_and_says_so(folder, capsys):
    assert main(["report", str(folder)]) == 0
    said = capsys.readouterr().out
    assert re.fullmatch(
        r"Written: \S+report.html \(0\.\d MB, replays of 2 of 2 routes\), open it in a browser\n",
        said,
    )
    assert (folder / "report.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_the_page_names_refused_routes_and_what_else_is_to_be_known(run, made):
    run = dataclasses.replace(
        run,
        refused={"7": "Route '7': no way leads from keypoint 0 to keypoint 1 <here>"},
        notes=("2 scenarios of type Ghost were left out",),
    )
    page = report_page(run, made[1], load_town("toy"))
    notes = re.findall(r'<p class="note">(.*?)</p>', page)
    assert (
        "Route 7 could not be planned and is in no mean: "
        "no way leads from keypoint 0 to keypoint 1 &lt;here&gt;"
    ) in notes
    assert "2 scenarios of type Ghost were left out" in notes


def test_a_half_written_run_and_a_wrong_route_are_refused(folder, run, tmp_path, capsys):
    assert main(["report", str(tmp_path)]) == 2
    assert "driveinsight.json" in capsys.readouterr().err
    assert main(["report", str(folder), "--route-ids", "77"]) == 2
    assert "no route 77" in capsys.readouterr().err
    write_run(tmp_path / "half", run)
    route = tmp_path / "half" / "routes" / "0000.json"
    route.write_text(route.read_text(encoding="utf-8")[:500], encoding="utf-8")
    assert main(["report", str(tmp_path / "half")]) == 2
    assert "not whole JSON" in capsys.readouterr().err
    assert not (tmp_path / "half" / "report.html").exists()


def test_a_simplified_line_keeps_its_ends_and_stays_close():
    angle = np.linspace(0.0, np.pi, 200)
    arc = np.stack([20 * np.cos(angle), 20 * np.sin(angle)], axis=1)
    fewer = simplified(arc)
    assert len(fewer) < 40
    assert fewer[0].tolist() == arc[0].tolist()
    assert fewer[-1].tolist() == arc[-1].tolist()
    chords = np.linalg.norm(np.diff(fewer, axis=0), axis=1)
    sagitta = 20 - np.sqrt(20**2 - (chords / 2) ** 2)
    assert sagitta.max() < 1.05 * CLOSE_M
    straight = np.stack([np.linspace(0, 9, 50), np.zeros(50)], axis=1)
    assert simplified(straight).tolist() == [[0.0, 0.0], [9.0, 0.0]]


def test_a_path_is_whole_centimetres_from_its_first_point():
    points = np.array([[1.0, -2.0], [1.5, -2.25], [1.5, -2.25], [0.0, 0.0]])
    assert line_path(points) == "M100 -200l50-25-150 225"
    assert line_path(points[:2], closed=True) == "M100 -200l50-25z"


def test_every_lane_line_and_stop_line_is_on_the_map():
    town = load_town(TOY.town_path, TOY.signals)
    elements = Elements(town_svg(town)).of("path")
    stops = [path for path in elements if path["class"] == "stop"]
    assert len(stops) == town.signals.stop_lane.size
    lights = {int(path["data-light"]) for path in stops if "data-light" in path}
    assert lights == set(town.signals.stop_signal[town.signals.kind[town.signals.stop_signal] == 1])
    assert {"driving", "sidewalk", "bar", "solid", "broken"} <= {path["class"] for path in elements}
    boxes = [tuple(map(int, path["data-box"].split())) for path in elements if "data-box" in path]
    low, high = np.min(boxes, axis=0)[:2] / CM, np.max(boxes, axis=0)[2:] / CM
    points = town.lanes.points[:, :2]
    assert (points.min(axis=0) >= low).all()
    assert (points.max(axis=0) <= high).all()


# ---- in a browser


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    browser = find_browser()
    if browser is None:
        pytest.skip("no Chromium on the path: the page is not looked at")
    with browser_page(browser, tmp_path_factory.mktemp("profile")) as tab:
        yield tab


def test_a_browser_opens_the_moment_that_the_address_names(tab, page_file):
    tab.open(page_file, f"#route={ROUTES[1]}&seed=0&t=1.5")
    assert tab.script("document.body.dataset.shown") == f"{ROUTES[1]} 0 1.50"
    assert tab.script("document.getElementById('now-time').textContent") == "1.5 s"
    assert tab.complaints() == []
    assert {request.partition("#")[0] for request in tab.requests()} == {page_file.as_uri()}


def test_a_browser_shows_the_ego_where_the_replay_has_it(tab, page_file, run):
    tab.open(page_file, f"#route={ROUTES[0]}&seed=0&t=2.0")
    row = next(row for row in run.routes[0].trace if row[0] == 2.0)
    at = f"""driveinsight.blocks.read(document.getElementById('block-{run.routes[0].index}')
        .textContent).then((data) => {{ const now = driveinsight.film.of(data).at(2.0);
        return [now.ego.x, now.ego.y, now.ego.speed, now.actors.length]; }})"""
    x, y, speed, others = tab.script(at)
    assert (x, y, speed) == pytest.approx((row[1], row[2], row[5]), abs=0.006)
    assert others > 0
    painted = """(() => { const canvas = document.getElementById('canvas');
        const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        return new Set(new Uint32Array(data.buffer)).size; })()"""
    assert tab.script(painted) > 10  # colours: streets, lines, lights, actors


def test_a_browser_sorts_the_routes_by_a_click_on_a_heading(tab, page_file, run):
    tab.open(page_file)
    scores = """[...document.querySelectorAll('#routes tbody tr')]
        .map((row) => parseFloat(row.cells[2].dataset.value))"""
    click = "document.querySelectorAll('#routes th button')[2].click()"
    expected = sorted(record.score.driving_score for record in run.routes)
    assert tab.script(scores) == expected  # worst first
    tab.script(click)
    assert tab.script(scores) == expected[::-1]
    sorts = "document.querySelectorAll('#routes th')[2].getAttribute('aria-sort')"
    assert tab.script(sorts) == "descending"


def test_a_browser_jumps_to_an_infraction_and_steps_by_keys(tab, page_file, run):
    tab.open(page_file)
    link = "document.querySelector('#marks a')"
    href = tab.script(f"{link}.getAttribute('href')")
    time_s = float(href.rpartition("t=")[2])
    tab.script(
        f"{link}.dispatchEvent(new MouseEvent('click', {{bubbles: true, cancelable: true}}))"
    )
    tab.wait(f"document.body.dataset.shown.endsWith(' {time_s:.2f}')")
    shows = "document.getElementById('now-time').textContent"
    assert tab.script(shows) == f"{time_s:.1f} s"
    tab.script("document.activeElement.blur()")
    tab.key("ArrowLeft")
    assert float(tab.script("document.getElementById('scrub').value")) == pytest.approx(
        time_s - 0.1, abs=0.03
    )
    tab.key("Home")
    assert tab.script(shows) == "0.0 s"
    tab.key(" ")
    tab.wait("parseFloat(document.getElementById('scrub').value) > 0.2")
    assert tab.script("document.getElementById('play').getAttribute('aria-label')") == "Pause"
    assert tab.complaints() == []
