"""The stage that takes a policy that comes with the package, for others to go on from."""

from __future__ import annotations

import shutil
from dataclasses import dataclass

from agents.driveinsight.agent import SHIPPED
from agents.training.recipes.kinds import POLICY_FOLDER, Made, Progress, StageRun
from di_envs.config import check_name


@dataclass(frozen=True, kw_only=True)
class ShippedStage:
    """A policy that comes with the package.

    Attributes:
        policy: Its name, as of an agent.
    """

    policy: str

    def __post_init__(self) -> None:
        check_name(self.policy, shipped_policies(), "policy that comes with the package")


def shipped_policies() -> tuple[str, ...]:
    """Names of the policies of the paper's kind whose weights are here."""
    return tuple(sorted(path.name for path in SHIPPED.iterdir() if path.is_dir()))


def run_shipped(run: StageRun) -> Made:
    """Copies it."""
    name = run.settings.policy
    shutil.copytree(SHIPPED / name, run.folder / POLICY_FOLDER, dirs_exist_ok=True)
    run.tell(Progress(done=1, total=1, unit="policies"))
    return Made(samples=0, said=f"{name}, as shipped")
