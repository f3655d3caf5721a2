"""What language models answer is read as data: the forms, and everything else by its fault."""

from __future__ import annotations

import json

import numpy as np
import pytest

from agents.llm.answers import LONGEST, AnswerError, Follow, Stop, read_answer


def test_the_three_forms_are_read():
    places = [[2.0, 0.0], [4, -0.5]]
    found = read_answer(json.dumps({"waypoints": places}))
    assert found.places.dtype == np.float32
    assert found.places.tolist() == places
    assert read_answer('{"manoeuvre": "follow", "speed_mps": 6}') == Follow(speed_mps=6.0)
    assert read_answer(' {"manoeuvre": "stop"}\n') == Stop()


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        (None, "expected text; got None"),
        ("I would stop.", "one JSON object"),
        ('```json\n{"manoeuvre": "stop"}\n```', "one JSON object"),
        ('{"manoeuvre": "stop"} because it is red', "one JSON object"),
        ("[1, 2]", "a JSON object"),
        ('{"manoeuvre": "stop", "manoeuvre": "stop"}', "twice"),
        ('{"manoeuvre": "stop", "why": "red"}', "waypoints alone, or a manoeuvre"),
        ('{"manoeuvre": "reverse"}', "waypoints alone, or a manoeuvre"),
        ('{"manoeuvre": "follow"}', "waypoints alone, or a manoeuvre"),
        ('{"manoeuvre": "follow", "speed_mps": NaN}', "NaN is no number"),
        ('{"manoeuvre": "follow", "speed_mps": -1}', "from 0 to 40; got -1"),
        ('{"manoeuvre": "follow", "speed_mps": true}', "from 0 to 40; got True"),
        ('{"manoeuvre": "follow", "speed_mps": 1e999}', "from 0 to 40; got inf"),
        ('{"waypoints": [[1, 0]]}', "2 to 8 waypoints"),
        ('{"waypoints": [[1, 0], [2]]}', r"\[ahead, right\]; got \[2\]"),
        ('{"waypoints": [[1, 0], [2, "a"]]}', "from -100 to 100; got 'a'"),
        ('{"waypoints": [[1, 0], [2, 101]]}', "from -100 to 100; got 101"),
        ("[" * 3000, "one JSON object"),
        ("x" * (LONGEST + 1), "at most 4000 characters; got 4001"),
    ],
)
def test_anything_else_is_refused_with_what_was_expected(answer, fault):
    with pytest.raises(AnswerError, match=fault) as error:
        read_answer(answer)
    assert "Answer with one JSON object and nothing else" in str(error.value)
    assert len(str(error.value)) < 700
