"""Policies from a repository on the Hub: found in its layout on this machine, loaded strictly."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import pytest
import torch

import driveinsight
from agents import AgentSpecError, load_agent
from agents.driveinsight.config import config_named
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained
from agents.hub import HubError, local_folder
from agents.networks.weights import WeightsError
from agents.ownership import code_of_others
from agents.versions import agent_version
from agents.zoo.pretrained import from_pretrained, push_to_hub, uploaded

hub = pytest.importorskip("huggingface_hub", reason="needs the extra hub")
constants = pytest.importorskip("huggingface_hub.constants")

COMMIT = "c0ffee" + "0" * 34


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A small policy's folder, as `driveinsight train` writes it."""
    folder = tmp_path_factory.mktemp("trained")
    torch.manual_seed(0)
    save_pretrained(Policy(config_named("route-only")), folder, "# Mine\n")
    return folder


@pytest.fixture
def repository(trained, tmp_path, monkeypatch):
    """The same as the Hub's cache holds it: blobs, a ref, and a snapshot of links; no network."""
    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path))
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", True)
    top = tmp_path / "models--me--mine"
    snapshot = top / "snapshots" / COMMIT
    snapshot.mkdir(parents=True)
    (top / "refs").mkdir()
    (top / "refs" / "main").write_text(COMMIT)
    (top / "blobs").mkdir()
    for name, content in uploaded(trained).items():
        (top / "blobs" / f"blob-{name}").write_bytes(content)
        (snapshot / name).symlink_to(Path("../../blobs") / f"blob-{name}")
    return snapshot


@pytest.mark.parametrize("place", ["hf:me/mine", f"hf:me/mine@{COMMIT}"])
def test_a_repository_in_the_cache_is_the_policy_that_was_saved(repository, trained, place):
    found, kept = from_pretrained(place).state_dict(), from_pretrained(trained).state_dict()
    assert found.keys() == kept.keys()
    assert all(torch.equal(found[name], kept[name]) for name in kept)
    assert local_folder(place) == repository


def test_the_table_of_agents_drives_it_under_the_version_that_its_folder_has(repository, trained):
    agent = load_agent("driveinsight:hf:me/mine")
    assert agent.policy.config.name == "route-only"
    assert agent_version("driveinsight:hf:me/mine") == agent_version(f"driveinsight:{trained}")
    assert code_of_others("driveinsight:hf:me/mine") == ""


def test_what_else_lies_in_a_repository_is_neither_named_nor_run(repository):
    (repository / "model.py").write_text("raise SystemExit('run')")
    (repository / "weights.pkl").write_bytes(pickle.dumps("not read"))
    assert isinstance(from_pretrained("hf:me/mine"), Policy)
    assert set(uploaded(repository)) == {"config.json", "weights.safetensors", "README.md"}


def test_another_networks_weights_are_refused(repository):
    config = json.loads((repository / "config.json").read_text())
    (repository / "config.json").unlink()
    config["planner"]["layers"] += 1
    (repository / "config.json").write_text(json.dumps(config))
    with pytest.raises(WeightsError, match="does not fit"):
        from_pretrained("hf:me/mine")
    with pytest.raises(WeightsError, match="does not fit"):
        push_to_hub(repository, "me/mine")


@pytest.mark.parametrize("place", ["hf:me/other", f"hf:me/mine@{'1' * 40}"])
def test_what_is_not_there_says_what_to_do(repository, place):
    with pytest.raises(HubError, match=r"cannot be reached.*connect, or give a folder"):
        local_folder(place)
    with pytest.raises(AgentSpecError, match="not on this machine"):
        load_agent(f"driveinsight:{place}")


def test_what_is_no_repository_says_what_one_is():
    with pytest.raises(HubError, match="expected hf:OWNER/REPO"):
        local_folder("hf:a/b/c")


def test_to_push_without_a_network_says_so(repository, trained):
    with pytest.raises(HubError, match="is there a network"):
        push_to_hub(trained, "me/mine")


def test_a_card_says_what_the_hub_sorts_it_by(trained):
    card = uploaded(trained, license="mit")["README.md"].decode()
    data = hub.ModelCard(card).data
    assert data.library_name == "driveinsight"
    assert data.license == "mit"
    assert "autonomous-driving" in data.tags
    assert card.endswith("# Mine\n")
    assert card.count("library_name") == 1


def test_a_shipped_policy_goes_by_its_name_and_others_are_refused():
    assert driveinsight.from_pretrained("driveinsight").config.name == "driveinsight"
    with pytest.raises(WeightsError, match="did you mean 'driveinsight'"):
        from_pretrained("driveinsigt")
    with pytest.raises(WeightsError, match="there is no folder or network 'runs/nothing'"):
        from_pretrained("runs/nothing")
