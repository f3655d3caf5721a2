"""Policies on the Hugging Face Hub: `hf:OWNER/REPO` as a folder of this machine.

Of a repository only the files of a policy are fetched: its configuration, its weights and its card.
They are text and numbers; nothing of them is run, and what else lies beside them stays there.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from agents import POLICY_FILES

HUB = "hf:"
CARD = "README.md"
FILES = (*POLICY_FILES, CARD)
_METADATA = """\
---
library_name: driveinsight
pipeline_tag: robotics
tags:
- autonomous-driving
- end-to-end-driving
- closed-loop
- gymnasium
---

"""


class HubError(ValueError):
    """A repository that cannot be had, or not be written to; the message says what to do."""


def local_folder(place: str | Path) -> Path:
    """The folder that a place is, once it is on this machine.

    What was fetched before is used as it is, without asking anybody, so that all processes of a run
    see the same files; `@REVISION` (a commit, a tag, a branch) names another one.

    Args:
        place: A folder, or `hf:OWNER/REPO[@REVISION]`.

    Raises:
        HubError: If it is on the Hub and cannot be had.
    """
    text = str(place)
    if not text.startswith(HUB):
        return Path(place)
    name, _, revision = text.removeprefix(HUB).partition("@")
    hub = hub_package(text)
    for offline in (True, False):
        try:
            return Path(
                hub.snapshot_download(
                    name,
                    revision=revision or None,
                    allow_patterns=list(FILES),
                    local_files_only=offline,
                )
            )
        except hub.errors.LocalEntryNotFoundError as error:
            if not offline:
                raise HubError(
                    f"'{text}' is not on this machine, and the Hub cannot be reached "
                    f"({_first_line(error)}): connect, or give a folder"
                ) from error
        except (ValueError, OSError, hub.errors.HfHubHTTPError) as error:
            raise HubError(
                f"'{text}' cannot be had ({_first_line(error)}): expected hf:OWNER/REPO or "
                f"hf:OWNER/REPO@REVISION; of a private one `hf auth login` first"
            ) from error
    raise AssertionError("the second turn returns or raises")


def is_on_hub(spec: str) -> bool:
    """Whether the files that an agent's specification names are in a repository on the Hub."""
    return spec.partition(":")[2].startswith(HUB)


def hub_package(what: str) -> ModuleType:
    """`huggingface_hub`.

    Args:
        what: Needs it.

    Raises:
        HubError: If it is not installed.
    """
    try:
        import huggingface_hub
    except ImportError as error:
        raise HubError(
            f"'{what}' needs huggingface_hub: pip install 'driveinsight[hub]' ({error})"
        ) from error
    import huggingface_hub.errors

    return huggingface_hub


def with_metadata(card: str) -> str:
    """A card with what the Hub sorts it by, unless it says that already."""
    return card if card.startswith("---\n") else _METADATA + card


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]
