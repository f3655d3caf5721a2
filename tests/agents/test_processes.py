"""Work in processes: results in order, no more under way than asked, and nobody left behind."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
from itertools import count
from pathlib import Path

import pytest

from agents.processes import how_it_ended, in_order, processes
from tests.agents import jobs_of_processes as jobs
from tests.leaderboard.commands.test_containers import as_nobody, run_in

TOP = Path(__file__).parents[2]
PATIENCE_S = 60.0


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (3, "ended by itself with exit code 3"),
        (-signal.SIGKILL, "was killed by SIGKILL"),
        (-35, "was killed by signal 35"),
    ],
)
def test_it_is_said_how_a_process_ended_even_by_a_signal_without_a_name(code, said):
    assert how_it_ended(code) == said


class Noted:
    """A pool that does jobs as their results are wanted, and notes what it is asked."""

    def __init__(self):
        self.under_way, self.most, self.left = 0, 0, []

    def submit(self, work, job, /):
        self.under_way += 1
        self.most = max(self.most, self.under_way)
        return NotedJob(self, work, job)


class NotedJob:
    def __init__(self, pool, work, job):
        self.pool, self.work, self.job = pool, work, job

    def result(self):
        self.pool.under_way -= 1
        return self.work(self.job)

    def cancel(self):
        self.pool.left.append(self.job)
        return self.job % 2 == 1  # the even ones have begun


def test_results_come_in_the_order_of_the_jobs_whatever_is_done_first():
    with processes(2) as pool:
        assert list(in_order(pool, jobs.squared, range(5), ahead=3)) == [0, 1, 4, 9, 16]


def test_no_more_jobs_are_under_way_than_asked_and_of_endless_ones_none_is_skipped():
    pool = Noted()
    results = in_order(pool, lambda number: number, count(), ahead=3)
    assert [next(results) for _ in range(10)] == list(range(10))
    results.close()
    assert pool.most == 3
    assert pool.left == [10, 11]  # 9 was yielded, and no other asked for yet


def test_what_was_begun_in_vain_is_told_and_what_was_not_is_left():
    told = []
    results = in_order(
        Noted(), lambda number: 1 // (number - 2), count(), ahead=5, in_vain=told.append
    )
    assert [next(results), next(results)] == [-1, -1]
    results.close()
    # 2 and 4 had begun, 3 and 5 had not; 2 failed, which with one process it would not have
    assert told == [0]


def test_an_error_in_a_job_is_raised_with_the_trace_of_its_process():
    with processes(1) as pool:
        results = in_order(pool, jobs.three_has_no_square, range(2, 9), ahead=2)
        assert next(results) == 4
        with pytest.raises(ValueError, match="there is no square of 3") as caught:
            next(results)
    assert "in three_has_no_square" in str(caught.value.__cause__)


def test_a_process_that_dies_is_said_to_have_died():
    with processes(1) as pool:
        results = in_order(pool, jobs.two_dies, [1, 2, 3], ahead=1)
        assert next(results) == 1
        with pytest.raises(ChildProcessError, match="died: it was killed"):
            next(results)


def test_ctrl_c_is_for_the_parent():
    with processes(1) as pool:
        assert list(in_order(pool, jobs.interrupted, [1, 2], ahead=1)) == [1, 2]


SCRIPT = """
from agents.processes import processes
from tests.agents.jobs_of_processes import squared_with_variables

if __name__ == "__main__":
    with processes(1) as pool:
        print(pool.submit(squared_with_variables, 3).result())
"""


def test_a_process_takes_no_module_from_the_working_folder(tmp_path):
    (tmp_path / "ours").mkdir()
    script, folder = tmp_path / "ours" / "script.py", tmp_path / "received"
    script.write_text(SCRIPT)
    folder.mkdir()
    (folder / "multiprocessing.py").write_text("open('PWN', 'w')")
    words = [sys.executable, str(script)]
    done = subprocess.run(
        words,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(TOP)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "(9, None)\n", done.stderr
    assert os.listdir(folder) == ["multiprocessing.py"]


LOOK = """
import os
from agents.processes import keep_others_out

def looked():
    if os.fork() == 0:
        try:
            open(f"/proc/{os.getppid()}/mem", "rb").close()
            print("open", flush=True)
        except PermissionError:
            print("shut", flush=True)
        os._exit(0)
    os.wait()

looked()
keep_others_out()
looked()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is no /proc")
def test_no_child_reads_the_memory_of_the_process_of_the_world(tmp_path):
    words = [*as_nobody(), sys.executable, "-c", LOOK]
    done = run_in(tmp_path, words, DRIVEINSIGHT_CACHE=str(tmp_path))
    assert done.stdout.split()[-1:] == ["shut"], done.stderr


def test_all_processes_are_started_by_one_rule():
    """Others end with the pipe that they read: a film's encoder, who helps to compile, and the
    agent of a file for CARLA."""
    starts = re.compile(r"ProcessPoolExecutor\(|get_context\(|Popen\(|os\.fork|\.Pool\(")
    found = {
        path.relative_to(TOP).as_posix()
        for package in ("di_envs", "agents", "wrappers", "leaderboard")
        for path in (TOP / package).rglob("*.py")
        if starts.search(path.read_text(encoding="utf-8"))
    }
    exporting = "leaderboard/exporting/carla_file.py"
    reading = {"leaderboard/running/video.py", "di_envs/numerics/together.py", exporting}
    assert found == {"agents/processes.py", *reading}


def read_all(pipe: int, size: int) -> bytes:
    """So many bytes, or fewer if all who had the pipe open are gone; fails if neither comes."""
    found = b""
    while len(found) < size:
        ready, _, _ = select.select([pipe], [], [], PATIENCE_S)
        assert ready, f"after {found!r} nothing came and somebody still lives"
        part = os.read(pipe, 1)
        if not part:
            break
        found += part
    return found


def test_of_a_parent_that_is_killed_no_child_lives_on_idle_or_busy(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    pipe = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    held = os.open(tmp_path / "pipe", os.O_WRONLY)  # until the children have it open too
    parent = subprocess.Popen(
        [sys.executable, "-m", "tests.agents.jobs_of_processes", str(tmp_path / "pipe")],
        cwd=TOP,
        env={**os.environ, "PYTHONPATH": str(TOP)},
        stderr=subprocess.DEVNULL,
    )
    assert read_all(pipe, 2) == b"xx"
    os.close(held)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    assert read_all(pipe, 1) == b""
    os.close(pipe)
