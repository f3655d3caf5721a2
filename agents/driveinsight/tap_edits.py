"""Edits of what is inside the policy: `mask:bev,p=0.3`, the text form of edits, on its taps.

    drop:bev                BEV tokens are zeroed behind their encoder, as dropout did in training
    zero:TAP                the activation is zeros; `zero:bev` is the fused BEV map
    mask:TAP,p=0.3          each cell of a map, or token, is zeroed at random, at every decision
    noise:TAP,sigma=0.1     Gaussian noise on every number
    delay:bev,steps=50      what passed fifty decisions ago: right in kind, wrong for this moment
    identity:TAP            nothing is changed

A tap is named as `tap_names` has it, such as `perception.memory.bev` or `prompt.taps.routing`;
`bev` is short for where the planner takes the BEV from.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from typing_extensions import Self

from agents.networks.taps import Edit, editing, tap_names
from di_envs.config import check_name
from di_envs.edits.conditions import ALWAYS, Condition
from di_envs.edits.text import EditError, EditText
from di_envs.numerics.keyed_arrays import keyed_normals, keyed_uniforms, stream_of

BEV = "bev"
_BEV_MAP = "perception.memory.bev"
_BEV_TOKENS = "bev.tokens"
_AT_TOKENS = ("drop", "delay")  # verbs that take `bev` where the planner does
# What each verb must be told, up to where it goes, and what one may write
_AMOUNTS = {
    "drop": "", "zero": "", "identity": "", "mask": "p", "noise": "sigma", "delay": "steps",
}  # fmt: skip
_MOST = {"": 0.0, "p": 1.0, "sigma": float("inf"), "steps": float("inf")}
_EXAMPLES = {"": "", "p": ",p=0.3", "sigma": ",sigma=0.3", "steps": ",steps=50"}

# What passed an edit's tap at each of the last decisions, newest first, in the order of the calls
Passed = tuple[tuple[Tensor, ...], ...]


@dataclass(frozen=True, kw_only=True)
class DecisionMoment:
    """What draws are keyed by, and what conditions ask about.

    Attributes:
        seed: Of the episode.
        decision: How many came before.
        time_s: Game time.
    """

    seed: int
    decision: int
    time_s: float


@dataclass(frozen=True, kw_only=True)
class TapEdit:
    """One edit of one tap.

    Attributes:
        verb: What is done.
        tap: The tap's full name.
        amount: Of a mask or of noise, or how many decisions a delay goes back.
        when: While it holds; of time alone.
        stream: What its draws are keyed by.
    """

    verb: str
    tap: str
    amount: float = 0.0
    when: Condition = ALWAYS
    stream: int = 0

    @classmethod
    def of(cls, text: EditText, policy: nn.Module) -> tuple[Self, ...]:
        """The edits that a text is, one for each of its targets.

        Raises:
            EditError: If the policy has no such tap, or the text cannot be read.
        """
        try:
            check_name(text.verb, _AMOUNTS, "edit of an activation")
        except ValueError as error:
            raise EditError(f"'{text}': {error}") from error
        name = _AMOUNTS[text.verb]
        text.refuse_settings_but((name, "seed") if name else ())
        if text.value is not None or (name and name not in text.settings):
            raise EditError(f"'{text}': write {text.verb}:{text.target}{_EXAMPLES[name]}")
        amount = text.number(name) if name else 0.0
        if not 0.0 <= amount <= _MOST[name]:
            raise EditError(f"'{text}': {name} lies in [0, {_MOST[name]:g}], not {amount:g}")
        if name == "steps" and amount != int(amount):
            raise EditError(f"'{text}': steps is a whole number, not {amount:g}")
        when = Condition.of(text.when)
        when.refuse_names_but(("t",), "inside a policy")
        stream = stream_of(f"tap edit {text.verb}:{text.target} {dict(text.settings)}")
        return tuple(
            cls(verb=text.verb, tap=tap, amount=amount, when=when, stream=stream)
            for tap in (_tap(target, text, policy) for target in text.target.split("+"))
        )

    def at(self, moment: DecisionMoment) -> Edit:
        """What it does to an activation at a moment."""

        def edit(activation: Tensor) -> Tensor:
            match self.verb:
                case "drop" | "zero":
                    return torch.zeros_like(activation)
                case "mask":
                    return activation * self._kept(moment, activation)
                case "noise":
                    return activation + self.amount * self._noise(moment, activation)
                case _:
                    return activation

        return edit

    def _kept(self, moment: DecisionMoment, activation: Tensor) -> Tensor:
        """1 or 0 for each cell of a (B, C, X, Y) map, or each row of another activation."""
        shape = activation.shape
        part = (shape[0], *shape[2:]) if len(shape) == 4 else shape[:-1]
        drawn = keyed_uniforms(moment.seed, self.stream, moment.decision, tuple(part))
        kept = _like(drawn >= self.amount, activation)
        return kept[:, None] if len(shape) == 4 else kept[..., None]

    def _noise(self, moment: DecisionMoment, activation: Tensor) -> Tensor:
        shape = tuple(activation.shape)
        return _like(keyed_normals(moment.seed, self.stream, moment.decision, shape), activation)


@dataclass
class EditedDecision:
    """One decision of a network that is edited, and what passes the taps of edits that delay.

    Attributes:
        edits: All edits of the network.
        moment: When it decides.
        before: What passed each edit's tap at the decisions before; empty at the first.
    """

    edits: Sequence[TapEdit]
    moment: DecisionMoment
    before: tuple[Passed, ...] = ()
    _now: list[list[Tensor]] = field(init=False)

    def __post_init__(self) -> None:
        self.before = self.before or ((),) * len(self.edits)
        self._now = [[] for _ in self.edits]

    @contextmanager
    def of(self, network: nn.Module) -> Iterator[None]:
        """Puts the edits that hold in the way of the network's taps, in their order."""
        chains: dict[str, list[Edit]] = {}
        for number, edit in enumerate(self.edits):
            holds = edit.when.holds({"t": self.moment.time_s})
            if edit.verb == "delay":
                chains.setdefault(edit.tap, []).append(self._delay(number, holds))
            elif holds:
                chains.setdefault(edit.tap, []).append(edit.at(self.moment))
        with editing(network, {tap: _chained(chain) for tap, chain in chains.items()}):
            yield

    @property
    def passed(self) -> tuple[Passed, ...]:
        """What the next decision must know as `before`."""
        return tuple(
            ((tuple(now), *before)[: int(edit.amount)]) if edit.verb == "delay" else ()
            for edit, now, before in zip(self.edits, self._now, self.before, strict=True)
        )

    def _delay(self, number: int, holds: bool) -> Edit:
        before, now = self.before[number], self._now[number]
        steps = int(self.edits[number].amount)

        def edit(activation: Tensor) -> Tensor:
            now.append(activation)
            if not (holds and before and steps):
                return activation
            # until there is anything so old, what the episode began with
            return before[min(steps, len(before)) - 1][len(now) - 1].clone()

        return edit


def _chained(chain: Sequence[Edit]) -> Edit:
    def edit(activation: Tensor) -> Tensor:
        for each in chain:
            activation = each(activation)
        return activation

    return edit


def _tap(target: str, text: EditText, policy: nn.Module) -> str:
    known = tap_names(policy)
    if target == BEV and _BEV_TOKENS in known:
        return _BEV_TOKENS if text.verb in _AT_TOKENS else _BEV_MAP
    try:
        check_name(target, known, "tap of the policy")
    except ValueError as error:
        raise EditError(f"'{text}': {error}") from error
    return target


def _like(drawn: NDArray[np.float64] | NDArray[np.bool_], activation: Tensor) -> Tensor:
    return torch.from_numpy(drawn).to(activation.device, activation.dtype)
