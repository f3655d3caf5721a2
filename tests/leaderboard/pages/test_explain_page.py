"""The page of an explained route: its numbers are the arrays', and it asks for nothing."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

from leaderboard.commands.cli import main
from leaderboard.explaining.route import explain_route
from leaderboard.pages.explain_page import explain_page
from leaderboard.pages.looks import GREYS, gradient_step
from leaderboard.records.blocks import read_block
from leaderboard.records.results import write_run
from tests.leaderboard.pages.headless_browser import browser_page, find_browser
from tests.leaderboard.short_drives import short_run
from tests.leaderboard.untrained import save_untrained

DECISIONS = 16
BUSY = {"traffic": 8, "walkers": 4}
EDITS = ("set:speed=20", "drop:routing")
TABLES = {"routing": 2, "obstacles": 8, "traffic_lights": 4, "stop_signs": 3}  # columns but `valid`


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("policy")
    save_untrained(folder, "tiny")
    return short_run(f"driveinsight:{folder}", DECISIONS, interventions=("drop:map@t>1",), **BUSY)


@pytest.fixture(scope="module")
def explained(run):
    route = run.routes[0].route_id
    return explain_route(run, route, at_s=0.8, what_if="; ".join(EDITS), ahead_s=0.5)


@pytest.fixture(scope="module")
def page(explained):
    return explain_page(explained)


@pytest.fixture(scope="module")
def page_file(page, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "explain.html"
    path.write_text(page, encoding="utf-8")
    return path


def script_of(page, identity):
    return re.search(rf'<script[^>]* id="{identity}">(.*?)</script>', page, re.DOTALL)[1]


def block_of(page, identity):
    return read_block(script_of(page, identity))[1]


def test_the_page_asks_for_nothing(page):
    assert not re.search(r"https?://|//cdn|@import|url\(|fetch\(|XMLHttpRequest|import\(", page)
    assert not re.search(r"\s(src|srcset|href|action|poster)=", page)
    assert "default-src 'none'" in page


def test_the_pages_gradients_attention_and_waypoints_are_the_arrays(explained, page):
    looks = block_of(page, "looks")
    count = len(explained.times_s)
    assert looks["tick"] * 0.05 == pytest.approx(explained.times_s)
    step = gradient_step(explained.gradient)
    layers, heads = explained.attention.shape[1:3]
    for g in range(len(explained.groups)):
        for c, name in enumerate("xy"):
            shown = looks[f"gradient_{name}_{g}"]
            assert np.abs(shown - explained.gradient[:, g, c]).max() <= 0.51 * step
        shares = looks[f"attention_{g}"].reshape(layers, heads, count)
        assert np.abs(shares.transpose(2, 0, 1) - explained.attention[..., g]).max() <= 0.51 / 4096
    for c, name in enumerate("xy"):
        shown = looks[f"waypoints_{name}"].reshape(-1, count).T
        assert np.abs(shown - explained.waypoints[..., c]).max() <= 0.00051
    for c, name in enumerate(("throttle", "steer", "brake")):
        assert np.abs(looks[name] - explained.controls[:, c]).max() <= 0.00051
    head = json.loads(script_of(page, "explanation"))
    assert head["groups"] == list(explained.groups)
    assert head["waypoints"] == explained.waypoints.shape[1]


def test_the_pages_activation_maps_are_the_arrays_to_a_grey_level(explained, page):
    head = json.loads(script_of(page, "explanation"))
    assert [entry["name"] for entry in head["maps"]] == ["bev", "camera_front"]
    for entry in head["maps"]:
        block, values = block_of(page, entry["block"]), explained.maps[entry["name"]].values
        assert block["peak"] == pytest.approx(values.max(axis=(1, 2)), rel=1e-3)
        strength = np.abs(explained.gradient).max(axis=2)
        of_bev = strength[:, explained.groups.index("bev")] / strength.max(axis=1)
        assert block["share"] == pytest.approx(of_bev, abs=1e-4)
        assert entry["share"] == pytest.approx(of_bev.max())
        assert entry["peak"] == pytest.approx(values.max())
        cells = block["cells"].reshape(-1, entry["rows"], entry["columns"])
        shares = values / values.max(axis=(1, 2), keepdims=True)
        assert np.abs(cells - shares).max() <= 0.51 / GREYS


def test_what_the_page_says_was_told_is_what_was_told(explained, page):
    told = block_of(page, "told")
    seen = explained.seen
    assert told["command"].tolist() == seen["command"].tolist()
    assert told["speed"] == pytest.approx(seen["speed"][:, 0], abs=0.0051)
    assert told["target_x"] == pytest.approx(seen["target_point"][:, 0], abs=0.0051)
    given = told["present"].reshape(-1, 9)
    assert given.tolist() == seen["prompt_present"].tolist()
    assert given[:, 3].tolist() == [1, 1, 1, 1, 1, 1, 0, 0]  # without the map after a second
    for name, width in TABLES.items():
        valid = seen[name][..., -1] > 0
        assert told[f"{name}_count"].tolist() == valid.sum(axis=1).tolist()
        columns = [key for key in told if key.startswith(f"{name}_") and key != f"{name}_count"]
        assert len(columns) == width
        for index, key in enumerate(columns):
            assert told[key] == pytest.approx(seen[name][..., index][valid], abs=0.0051)


def test_the_pages_map_is_the_told_one_in_the_worlds_frame(explained, page):
    told = block_of(page, "told")
    starts = np.cumsum([0, *told["line_count"]]).astype(int)
    place = 0
    for i, (x, y, yaw) in enumerate(explained.poses):
        for row in explained.seen["map"][i]:
            row = row[row[:, 3] > 0]
            if not len(row):
                continue
            line = int(told["map_line"][place])
            place += 1
            ahead, right = row[:, 0], row[:, 1]
            shown = [told[f"line_{c}"][starts[line] : starts[line + 1]] for c in "xy"]
            assert shown[0] == pytest.approx(
                x + np.cos(yaw) * ahead - np.sin(yaw) * right, abs=0.11
            )
            assert shown[1] == pytest.approx(
                y + np.sin(yaw) * ahead + np.cos(yaw) * right, abs=0.11
            )
            assert told["line_kind"][line] == row[0, 2]
    assert place == len(told["map_line"]) > 100
    assert len(told["line_count"]) < place / 4  # each is written once


def test_the_pages_pictures_are_the_arrays(explained, page):
    sizes = block_of(page, "image-sizes")["bytes"].astype(int)
    data = base64.b64decode(script_of(page, "images"))
    assert data == b"".join(explained.images)
    assert sizes.tolist() == [len(image) for image in explained.images]


def test_every_future_is_on_the_page_and_in_its_table(explained, page):
    head = json.loads(script_of(page, "explanation"))["what_if"]
    assert [answer["edit"] for answer in head["answers"]] == ["", *EDITS]
    for number, answer in enumerate((explained.what_if.base, *explained.what_if.answers)):
        shown = head["answers"][number]
        assert shown["waypoints"] == pytest.approx(answer.look.response.waypoints, abs=6e-5)
        assert shown["control"] == pytest.approx(answer.control, abs=6e-5)
        film = block_of(page, f"future-{number}")
        assert film["tick"].tolist() == [16, 18, 20, 22, 24, 26]
        assert film["steer"][1:] == pytest.approx(answer.future.controls[:, 1], abs=0.00051)
    assert block_of(page, "told-1")["speed"] == 20.0
    assert block_of(page, "told-2")["present"][2] == 0
    assert page.count("<td>set:speed=20</td>") == 1


def test_what_is_missing_and_what_was_edited_stand_before_the_pictures(explained, page):
    assert "With what was done to the world, or to what the agent saw: drop:map@t&gt;1." in page
    none = dataclasses.replace(explained, what_if=None, missing=("No <maps>: none.",))
    bare = explain_page(none)
    assert '<p class="note">No &lt;maps&gt;: none.</p>' in bare
    assert json.loads(script_of(bare, "explanation"))["what_if"] is None


def test_a_notebook_shows_the_page_in_a_frame_of_its_own(explained, page):
    shown = explain_page(explained)._repr_html_()
    assert shown.startswith("<iframe srcdoc=")
    assert "<script" not in shown
    assert shown.count('"') == 2 * len(re.findall(r'\w+="', shown))


def test_the_command_writes_the_page_says_what_is_missing_and_names_the_next_step(tmp_path, capsys):
    run = short_run("constant", 6)
    write_run(tmp_path, run)
    route = run.routes[0].route_id
    assert main(["explain", str(tmp_path), "--route", route]) == 0
    said = capsys.readouterr().out
    assert "No waypoints, gradients, attention or activation maps: agent 'constant' has no" in said
    assert re.search(
        r"Written: \S+explain-\S+\.html \(\d\.\d MB, 3 looks at 0\.6 s of driving", said
    )
    assert '--at 0.3 --what-if "drop:routing; set:speed=0"' in said
    page = (tmp_path / f"explain-{route}.html").read_text(encoding="utf-8")
    assert "looked into" not in page.partition("<section")[0] or "note" in page
    moved = ["--agent", "constant:throttle", "--output", str(tmp_path / "other.html")]
    assert main(["explain", str(tmp_path), "--route", route, *moved]) == 2
    assert "is not to be had here" in capsys.readouterr().err
    assert main(["explain", str(tmp_path), "--route", "nowhere"]) == 2
    assert "no route nowhere with seed 0" in capsys.readouterr().err
    assert main(["explain", str(tmp_path / "none"), "--route", route]) == 2
    assert "driveinsight.json" in capsys.readouterr().err


def test_the_python_of_the_page_about_it_runs(run, tmp_path, monkeypatch, capsys):
    text = (Path(__file__).parents[3] / "docs" / "explain_page.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    monkeypatch.chdir(tmp_path)
    write_run(Path("results/mine"), run)
    exec(code, {})  # our own text
    assert "drop:routing [" in capsys.readouterr().out
    assert Path("why.html").stat().st_size > 100_000


# ---- in a browser


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    browser = find_browser()
    if browser is None:
        pytest.skip("no Chromium on the path: the page is not looked at")
    with browser_page(browser, tmp_path_factory.mktemp("profile")) as tab:
        yield tab


def test_a_browser_shows_the_moment_of_the_address_with_its_numbers(tab, page_file, explained):
    tab.open(page_file, "#t=1.25")
    tab.wait("document.getElementById('front').dataset.shown === '6'")
    assert tab.script("document.body.dataset.shown") == "1.25"
    numbers = "[...document.querySelectorAll('#rows .numbers > span')].map((one) => one.innerText)"
    shown = np.array([float(text) for text in tab.script(numbers)]).reshape(-1, 2)
    assert shown == pytest.approx(explained.gradient[6], rel=0.06, abs=1e-6)
    dropped = (
        "[...document.querySelectorAll('#told-now .dropped dt')].map((one) => one.textContent)"
    )
    assert tab.script(dropped) == ["map"]
    assert tab.complaints() == []
    assert {request.partition("#")[0] for request in tab.requests()} == {page_file.as_uri()}


def test_a_browser_shows_it_in_a_notebooks_frame_too(tab, explained, tmp_path):
    path = tmp_path / "notebook.html"
    script = "document.querySelector('iframe').onload = () => { document.body.dataset.shown = ''; }"
    path.write_text(
        f"<body>{explain_page(explained)._repr_html_()}<script>{script}</script>", encoding="utf-8"
    )
    before = len(tab.complaints())
    tab.open(path)
    tab.script("new Promise((done) => setTimeout(done, 700))")  # it names no address after 0.4 s
    assert tab.complaints()[before:] == []


INERTIAL = """
from agents.base import Requirements, make_control


class Inertial:
    requires = Requirements(observations=("inertial",))

    def start(self, plan, seed):
        return None

    def act(self, observation, memory):
        return make_control(0.4 if observation["speed"][0] < 5.0 else 0.0, 0.0, 0.0), None

    def close(self):
        pass
"""


def test_a_browser_shows_what_there_is_of_an_agent_without_prompt_and_policy(tab, tmp_path):
    (tmp_path / "inertial.py").write_text(INERTIAL)
    run = short_run(f"{tmp_path / 'inertial.py'}:Inertial", 8)
    explained = explain_route(
        run, run.routes[0].route_id, at_s=0.4, what_if="set:speed=20", ahead_s=0.4
    )
    assert "Nothing is drawn of what the agent is told" in explained.missing[1]
    path = tmp_path / "explain.html"
    path.write_text(explain_page(explained), encoding="utf-8")
    before = len(tab.complaints())
    tab.open(path)
    assert tab.script("document.body.dataset.shown") == "0.40"
    hidden = "[...document.querySelectorAll('.layers label')].map((one) => one.hidden)"
    assert tab.script(hidden) == [True] * 4
    assert tab.script("document.getElementById('responses').hidden")
    captions = "[...document.querySelectorAll('.pane figcaption')].map((one) => one.innerText)"
    base, fast = tab.script(captions)
    assert base.startswith("throttle 0.40")
    assert fast.startswith("throttle 0.00")
    assert tab.complaints()[before:] == []


COLOURS = """((id) => { const canvas = document.getElementById(id);
    const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return new Set(new Uint32Array(data.buffer)).size; })"""


def test_a_browser_draws_what_is_told_and_hides_it_when_asked(tab, page_file):
    tab.open(page_file, "#t=0.5")
    tab.wait("document.getElementById('front').dataset.shown === '2'")
    frame = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    picture = "document.getElementById('canvas').toDataURL()"
    tab.script(frame)
    for name in ("told", "path", "bev"):
        before = tab.script(picture)
        tab.script(f"document.getElementById('show-{name}').click()")
        tab.script(frame)
        assert tab.script(picture) != before, name
    assert tab.script(f"{COLOURS}('front')") > 100


def test_a_browser_moves_the_cursor_along_the_rows_and_the_futures(tab, page_file):
    tab.open(page_file, "#t=0.2")
    left = "parseFloat(document.querySelector('#rows .cursor').style.left)"
    before = tab.script(left)
    tab.key("ArrowRight")
    tab.wait("document.getElementById('now-time').textContent === '0.3 s'")
    assert tab.script(left) > before
    assert tab.script("document.querySelectorAll('.pane').length") == 3
    panes = "[...document.querySelectorAll('.pane canvas')].map((one) => one.toDataURL())"
    start = tab.script(panes)
    tab.script(
        "{ const bar = document.getElementById('futures-scrub'); bar.value = 1.3;"
        " bar.dispatchEvent(new Event('input')); }"
    )
    assert tab.script("document.getElementById('what-if').dataset.shown") == "1.30"
    assert all(one != other for one, other in zip(start, tab.script(panes), strict=True))
    assert tab.complaints() == []
