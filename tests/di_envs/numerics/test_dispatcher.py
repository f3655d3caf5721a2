"""Kernels compile for what they are called with and no more, in two processes where that helps."""

from __future__ import annotations

import operator
import sys

import numpy as np
import pytest
from numba.core import event as numba_event
from numba.core import registry, types
from numba.core.compiler import Flags, run_frontend
from numba.core.typed_passes import type_inference_stage
from numba.core.typing.context import BaseContext

from di_envs.files import caches
from di_envs.numerics import together
from di_envs.numerics.ingredients import _Asked
from di_envs.numerics.kernels import bind, kernel, made_of, prepare
from di_envs.numerics.keyed_random import keyed_hash, normal, uniform
from di_envs.world import step
from leaderboard.running.warming import drive_a_little

KEY = (types.uint64, types.int64, types.int64, types.int64)


def drawn(seed, key):
    return uniform(seed, key, 0, 0) + normal(seed, key, 1, 0)


def fresh():
    """The kernel as a new process has it: nothing is compiled yet."""
    return made_of(lambda seed, key: [(uniform, KEY), (normal, KEY)])(kernel(drawn))


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """Caches that hold nothing."""
    monkeypatch.setenv(caches.ASKED, str(tmp_path / "asked"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    return tmp_path / "asked"


def kept(folder, name):
    return {path.name for path in folder.rglob(f"{name}*.nbc")}


def test_numbers_and_narrow_integers_compile_nothing_of_their_own():
    @kernel
    def twice(number):
        return 2 * number

    @kernel
    def many(small):
        number = 0  # a number to Numba, then an integer: twice the work, once
        for _ in range(3):
            number = twice(number) + twice(small) + twice(True) + twice(np.int32(1))
        return number + twice(1.5)

    # Each round: twice itself, -14, 2 and 2
    assert many(np.int8(-7)) == 3.0 + -(2**3 - 1) * 10
    assert {str(given) for (given,) in twice.within.overloads} == {"int64", "bool", "float64"}
    assert not twice.overloads, "nothing calls it from Python"


def test_integers_without_a_sign_stay_what_they_are():
    @kernel
    def high(number):
        return number >> np.uint64(63)

    @kernel
    def ask(number):
        return high(number)

    assert ask(np.uint64(2**63)) == 1


def test_another_process_compiles_the_parts_and_is_heard_of(empty):
    heard = []

    class Heard(numba_event.Listener):
        def on_start(self, event):
            heard.append(event.data["dispatcher"].py_func.__name__)

        def on_end(self, event):
            pass

    function, arguments = fresh(), (np.uint64(3), 5)
    with numba_event.install_listener("numba:compile", Heard()):
        prepare(function, lambda: arguments)
        (begun,) = function._begun.values()
        begun._thread.join()  # no part is left for this process
    assert {"uniform", "normal", "keyed_hash"} <= set(heard)
    parts = kept(empty, "keyed_random.uniform") | kept(empty, "keyed_random.normal")
    assert len(parts) == 2
    assert bind(function, *arguments)(*arguments) == pytest.approx(drawn(*arguments), abs=0)
    assert not function._begun


def test_who_has_done_all_parts_compiles_the_whole(empty):
    compiled = []

    class Compiled(numba_event.Listener):
        def on_start(self, event):
            compiled.append(event)

        def on_end(self, event):
            pass

    function = made_of(lambda *_: [(uniform, KEY), (keyed_hash, KEY)])(kernel(normal.py_func))
    arguments = (np.uint64(3), 5, 0, 0)
    prepare(function, lambda: arguments)
    (begun,) = function._begun.values()
    begun._thread.join()
    with numba_event.install_listener("numba:compile", Compiled()):
        assert bind(function, *arguments)(*arguments) == normal(*arguments)
    assert not compiled, "this process had only to load it"


def test_a_product_of_two_numbers_is_given_its_type_once(monkeypatch):
    asked = []
    resolve = BaseContext.resolve_function_type

    def ask(context, function, args, kws):
        asked.append((function, tuple(args)))
        return resolve(context, function, args, kws)

    @kernel
    def square(number):
        return number * number

    @kernel
    def cube(number):
        return square(number) * number

    monkeypatch.setattr(BaseContext, "resolve_function_type", ask)
    assert cube(np.complex64(2j)) == np.complex64(-8j)
    assert asked.count((operator.mul, (types.complex64, types.complex64))) <= 1


def test_flags_are_to_numba_what_they_were():
    flags = Flags()
    flags.nrt, flags.error_model = True, "numpy"
    told = _Asked(flags).copy()
    assert told == flags
    assert hash(told) == hash(flags)
    assert told == _Asked(flags).copy()
    assert told != _Asked(Flags()).copy()
    assert told.nrt
    assert told.summary() == flags.summary().replace("Flags", "_Told")


def test_the_other_process_ends_when_nobody_listens_any_more():
    helper = together._helper()
    helper.stdout.close()
    helper.stdin.close()
    assert helper.wait(timeout=60) is not None


@pytest.mark.parametrize("program", ["nothing-is-called-so", sys.executable])
def test_without_another_process_this_one_does_it_all(program, empty, monkeypatch):
    monkeypatch.setattr(sys, "executable", program)
    monkeypatch.setattr(together, "_HELP", "raise SystemExit(3)")
    arguments = (np.uint64(3), 5)
    assert bind(fresh(), *arguments)(*arguments) == drawn(*arguments)


def test_what_is_compiled_already_starts_nothing(empty, monkeypatch):
    arguments = (np.uint64(3), 5)
    bind(fresh(), *arguments)
    monkeypatch.setattr(together, "_helper", lambda: pytest.fail("a process was started"))
    again = fresh()
    prepare(again, lambda: arguments)
    assert bind(again, *arguments)(*arguments) == drawn(*arguments)


def test_a_tick_calls_its_parts_with_the_types_that_are_said():
    """Else they would be compiled twice, once in vain."""
    drive_a_little()
    given = next(iter(step.advance.overloads))
    calls = called_by(step.advance, given)
    for part, said in step._parts_of_advance(*given):
        assert said in calls[part]


def called_by(kernel, given):
    """The kernels that one calls, as Numba finds, with the types of their arguments."""
    target = registry.cpu_target
    found = type_inference_stage(
        target.typing_context, target.target_context, run_frontend(kernel.py_func), given, None
    )
    calls = {}
    for call, signature in found.calltypes.items():
        called = found.typemap[call.func.name] if getattr(call, "op", "") == "call" else None
        if isinstance(called, types.Dispatcher):
            calls.setdefault(called.dispatcher, set()).add(signature.args)
    return calls
