"""`driveinsight warm-up`: afterwards nobody waits for kernels or maps."""

from __future__ import annotations

from di_envs.files import caches
from leaderboard.commands.cli import main


def test_it_says_what_it_has_done_and_where_it_is_kept(capsys):
    assert main(["warm-up"]) == 0
    said = capsys.readouterr().out
    for what in ("the shipped maps and routes", "a drive with every sensor", "many worlds at once"):
        assert f"{what}: " in said
    kept = caches.cache_folders("kernels")[0]
    assert str(kept.parent) in "".join(said.split("\n"))
    assert any(kept.rglob("stepping.step_worlds*"))


def test_where_nothing_can_be_kept_it_does_nothing(monkeypatch, capsys):
    monkeypatch.setattr(caches, "writable_cache", lambda part: None)
    assert main(["warm-up"]) == 1
    assert capsys.readouterr().out == ""
