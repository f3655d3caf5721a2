"""A damaged map is a town or one ValueError that names the file: no other error, hang or flood."""

from __future__ import annotations

import copy
import tracemalloc
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from di_envs.town.loading import load_town
from tests.di_envs.town.small_maps import crossing

LIGHT = (
    '<objects><object id="3" type="crosswalk" s="70" t="0" hdg="0" zOffset="0"><outline>'
    '<cornerLocal u="0" v="-4" z="0"/><cornerLocal u="3" v="-4" z="0"/>'
    '<cornerLocal u="3" v="4" z="0"/><cornerLocal u="0" v="4" z="0"/></outline></object></objects>'
    '<signals><signal id="70" name="Light" type="1000001" s="79" t="-5" orientation="-">'
    '<validity fromLane="-1" toLane="-1"/></signal></signals>'
)
MORE = (
    '<elevationProfile><elevation s="0" a="1" b="0.01" c="0" d="0"/></elevationProfile>'
    '<lateralProfile><superelevation s="0" a="0.02" b="0" c="0" d="0"/>'
    '<crossfall side="both" s="0" a="0.01" b="0" c="0" d="0"/></lateralProfile>'
    '<lanes><laneOffset s="0" a="0.1" b="0" c="0" d="0"/>'
)
WHOLE = (
    crossing(2, signals=LIGHT)
    .replace("<lanes>", MORE, 2)
    .replace("<planView>", '<type s="0"><speed max="30" unit="mph"/></type><planView>', 2)
    .replace("<line/>", '<spiral curvStart="0" curvEnd="0.001"/>', 1)
    .replace("<line/>", '<paramPoly3 bU="80" aV="0" cV="1" pRange="normalized"/>', 1)
    .replace("<line/>", '<poly3 a="0" b="0" c="0.0001" d="0"/>', 1)
    .replace("<line/>", '<arc curvature="0.0001"/>', 1)
    .replace("<header>", "<header><geoReference>+lat_0=49 +lon_0=8</geoReference>")
    .replace("</link><width", '</link><roadMark sOffset="0" type="broken"/><width', 4)
    .replace(
        "</junction>",
        '<controller id="500" sequence="0"/></junction>'
        '<controller id="500"><control signalId="70"/></controller>',
    )
)
HEAD, WIDTH, TAIL = WHOLE.rpartition('<width sOffset="0" a="3.5"')
WHOLE = f'{HEAD}<border sOffset="0" a="-7"{TAIL}'  # of the last road's lane -2
VALUES = (
    *(
        "",
        "x",
        "nan",
        "inf",
        "-inf",
        "1e300",
        "-1e300",
        "1e12",
        "1e9",
        "-1e9",
        "99999999999999999999",
    ),
    *("1e5", "-1e5", "5000", "-300", "100", "-1", "0", "1", "2", "-2", "0.5", "1e-9", "start", "Ü"),
)


def elements(root):
    """All elements below the root with their parents."""
    return [(parent, child) for parent in root.iter() for child in parent]


@st.composite
def damaged_maps(draw):
    """The map with one to three numbers, attributes or elements changed, removed or repeated."""
    root = ET.fromstring(WHOLE)
    for _ in range(draw(st.integers(1, 3))):
        places = elements(root)
        if not places:
            break
        parent, child = places[draw(st.integers(0, len(places) - 1))]
        what = draw(st.sampled_from(("value", "value", "value", "attribute", "tag", "repeat")))
        if what == "tag":
            parent.remove(child)
        elif what == "repeat":
            parent.append(copy.deepcopy(child))
        elif child.attrib:
            key = draw(st.sampled_from(sorted(child.attrib)))
            if what == "attribute":
                del child.attrib[key]
            else:
                child.set(key, draw(st.sampled_from(VALUES)))
    return ET.tostring(root, encoding="unicode")


def town_or_refusal(content, folder, signals):
    """A town whose numbers are numbers, or None where it was refused by name."""
    path, refusal = folder / "small.xodr", None
    path.write_bytes(content)
    try:
        town = load_town(path, signals, cache_folder=folder / "cache")
    except ValueError as error:
        refusal = error
    if refusal is not None:
        assert type(refusal) is ValueError
        assert "small.xodr" in str(refusal)
        return None
    lanes = town.lanes
    for array in (*lanes, *town.signals, *town.crosswalks):
        assert np.isfinite(array).all()
    assert (lanes.length_m > 0.0).all()
    assert (lanes.speed_limit_mps > 0.0).all()
    return town


def test_the_undamaged_map_is_a_town(tmp_path):
    town = town_or_refusal(WHOLE.encode(), tmp_path, None)
    assert town is not None
    assert len(town.road_names) == 8
    assert len(town.signals.kind) == 1
    assert len(town.crosswalks.width_m) == 1


@pytest.mark.filterwarnings("ignore:.*carries no traffic signals")
@settings(
    max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)
@given(text=damaged_maps(), signals=st.sampled_from([None, "synthesise"]))
def test_a_damaged_map_is_a_town_or_one_refusal_within_a_few_hundred_megabytes(
    tmp_path, text, signals
):
    tracemalloc.start()
    try:
        town_or_refusal(text.encode(), tmp_path, signals)
        assert tracemalloc.get_traced_memory()[1] < 700e6
    finally:
        tracemalloc.stop()


@settings(
    max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)
@given(cut=st.integers(0, len(WHOLE)), junk=st.binary(max_size=6), kept=st.booleans())
def test_a_file_that_is_cut_or_overwritten_is_a_town_or_one_refusal(tmp_path, cut, junk, kept):
    content = WHOLE.encode()
    rest = content[cut + len(junk) :] if kept else b""
    town_or_refusal(content[:cut] + junk + rest, tmp_path, "none")
