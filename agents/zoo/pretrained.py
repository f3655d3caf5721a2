"""`from_pretrained` and `push_to_hub`: policies and systems of the zoo, to the Hub and back."""

from __future__ import annotations

from pathlib import Path

import agents
from agents import AGENTS, POLICY_FILES
from agents.driveinsight.model import Policy
from agents.hub import CARD, FILES, HUB, HubError, hub_package, local_folder, with_metadata
from agents.networks.weights import WeightsError
from agents.zoo.system import SystemModel
from agents.zoo.weights import load_network
from di_envs.files.names import name_hint


def from_pretrained(place: str | Path) -> Policy | SystemModel:
    """A trained network, on the CPU, ready to drive.

    Args:
        place: Name of a shipped one, such as `driveinsight`; a folder that `driveinsight train`
            wrote; or `hf:OWNER/REPO[@REVISION]`, a repository with such a folder's files.

    Raises:
        WeightsError: If there is none, or a file is broken, or is of another network.
        HubError: If it is on the Hub and cannot be had.
    """
    return load_network(_folder_of(place))


def push_to_hub(
    folder: Path | str,
    repository: str,
    *,
    license: str = "",
    private: bool = False,
    message: str = "A policy of DriveInsight",
) -> str:
    """Uploads a policy's folder: its configuration, weights and card, and nothing else.

    Args:
        folder: That `driveinsight train` wrote, or the name of a shipped one.
        repository: `OWNER/REPO`; made if there is none.
        license: For the card, such as `mit`; empty to say none.
        private: Whether a repository that is made is.
        message: Of the commit.

    Returns:
        The commit's address.

    Raises:
        WeightsError: If the folder cannot be loaded strictly: such a one is not uploaded.
        HubError: If the Hub refuses it or cannot be reached.
    """
    source = _folder_of(folder)
    load_network(source)
    hub = hub_package("push_to_hub")
    name = repository.removeprefix(HUB)
    try:
        api = hub.HfApi()
        api.create_repo(name, private=private, exist_ok=True)
        done = api.create_commit(
            name,
            operations=[
                hub.CommitOperationAdd(path_in_repo=each, path_or_fileobj=content)
                for each, content in uploaded(source, license).items()
            ],
            commit_message=message,
        )
    except Exception as error:  # whatever its HTTP library raises: there are many, of any version
        raise HubError(
            f"'{name}' cannot be written to ({error}): is it OWNER/REPO, is there a network, and "
            f"did `hf auth login` give a token that may write?"
        ) from error
    return str(done.commit_url)


def uploaded(folder: Path, license: str = "") -> dict[str, bytes]:
    """The files of a policy's repository by name; the card brings what the Hub sorts it by."""
    card = folder / CARD
    text = with_metadata(card.read_text(encoding="utf-8") if card.is_file() else "")
    if license:
        text = text.replace("---\n", f"---\nlicense: {license}\n", 1)
    files = {name: (folder / name).read_bytes() for name in FILES if name != CARD}
    return {**files, CARD: text.encode()}


def _folder_of(place: str | Path) -> Path:
    """Where the files of a place are; a folder with the name of a shipped network is `./NAME`."""
    shipped = {
        name: Path(agents.__file__).parent / entry.data
        for name, entry in AGENTS.items()
        if entry.data_files == POLICY_FILES
    }
    if place in shipped:
        if not shipped[str(place)].is_dir():
            raise WeightsError(f"'{place}' is not trained: this version comes without its weights")
        return shipped[str(place)]
    folder = local_folder(place)
    if not folder.is_dir():
        hint = name_hint(place, shipped)
        raise WeightsError(f"there is no folder or network '{place}'; {hint}; or hf:OWNER/REPO")
    return folder
