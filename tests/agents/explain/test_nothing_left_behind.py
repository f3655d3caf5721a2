"""Looking changes nothing: hooks, gradients, modes, threads and weights are left as found."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from agents.explain.look import look_at
from agents.explain.protocol import Anatomy, NotExplainableError, TokenGroup
from agents.explain.randomisation import shuffled
from agents.explain.responses import responses_at
from tests.agents.explain.toy_policies import LinearNet, ToyAgent

SEEN = {"way": torch.ones(1, 2), "others": torch.ones(1, 2, 2)}
ANATOMY = Anatomy(groups={"way": TokenGroup(tap="way"), "others": TokenGroup(tap="others")})


class Breaking(LinearNet):
    def forward(self, way: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
        super().forward(way, others)
        raise RuntimeError("in the middle of it")


def state_of(net: nn.Module) -> list[object]:
    """All that a look could leave behind."""
    hooks = [len(module._forward_hooks) + len(module._backward_hooks) for module in net.modules()]
    return [
        hooks,
        [module.training for module in net.modules()],
        [parameter.requires_grad for parameter in net.parameters()],
        [None if p.grad is None else p.grad.tolist() for p in net.parameters()],
        [parameter.tolist() for parameter in net.parameters()],
        torch.get_num_threads(),
        torch.is_grad_enabled(),
    ]


def prepared(net: nn.Module) -> nn.Module:
    """A net in the middle of somebody's work: modes mixed, one gradient there, one frozen."""
    net.train()
    net.others.eval()
    net.a.grad = torch.tensor([7.0, 8.0])
    net.b.requires_grad_(False)
    net.way.register_forward_hook(lambda module, inputs, output: None)
    return net


def test_a_look_leaves_everything_as_it_was():
    net = prepared(LinearNet())
    before = state_of(net)
    responses_at(ToyAgent(net, ANATOMY), SEEN, None)
    assert state_of(net) == before


def test_also_when_the_policy_fails():
    net = prepared(Breaking())
    before = state_of(net)
    with pytest.raises(RuntimeError, match="in the middle"):
        responses_at(ToyAgent(net, ANATOMY), SEEN, None)
    assert state_of(net) == before


def test_also_when_a_tap_is_unknown():
    net = prepared(LinearNet())
    before = state_of(net)
    groups = {"way": TokenGroup(tap="way"), "other": TokenGroup(tap="other")}
    with pytest.raises(NotExplainableError, match="did you mean 'others'"):
        responses_at(ToyAgent(net, Anatomy(groups=groups)), SEEN, None)
    assert state_of(net) == before


def test_shuffled_weights_are_put_back_also_after_an_exception():
    net = prepared(LinearNet())
    before = state_of(net)

    def break_while_shuffled() -> None:
        with shuffled(nn.ModuleDict({"net": net}), ["net"], 1):
            assert sorted(net.b.reshape(-1).tolist()) == [1.0, 2.0, 2.0, 4.0]
            raise RuntimeError

    with pytest.raises(RuntimeError):
        break_while_shuffled()
    assert state_of(net) == before


def test_dropout_of_a_net_in_training_does_not_blur_the_look():
    net = LinearNet().train()
    agent = ToyAgent(net, ANATOMY)
    first = responses_at(agent, SEEN, None)
    assert (first.gradient == responses_at(agent, SEEN, None).gradient).all()
    assert net.dropout.training


@pytest.mark.parametrize("around", [torch.no_grad, torch.inference_mode])
def test_a_caller_without_gradients_gets_them_all_the_same(around):
    agent = ToyAgent(LinearNet(), ANATOMY)
    with around():
        gradient = responses_at(agent, SEEN, None).gradient
    assert gradient[0, 0] == pytest.approx(7.5)


def test_frozen_weights_are_no_obstacle():
    net = LinearNet().requires_grad_(False)
    assert responses_at(ToyAgent(net, ANATOMY), SEEN, None).gradient[1, 1] == pytest.approx(7.5)


class InPlace(LinearNet):
    """Changes what passed a tap in place, as ReLUs do."""

    def forward(self, way: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
        passed = self.way(way)
        passed *= -1.0
        return (passed.sum() * torch.ones(1, 2)) + self.others(others).sum()


def test_what_passed_a_tap_may_be_changed_in_place_behind_it():
    seen = {name: value.clone() for name, value in SEEN.items()}
    response = responses_at(ToyAgent(InPlace(), ANATOMY), seen, None)
    assert response.gradient[0, 0] == pytest.approx(2.0**0.5)
    assert seen["way"].tolist() == [[1.0, 1.0]]


class Nothing:
    pass


def test_an_agent_that_cannot_be_explained_is_told_how():
    with pytest.raises(NotExplainableError, match=r"no method explainable\(\).*docs/explaining"):
        look_at(Nothing(), {}, None)


def test_a_policy_without_taps_is_refused():
    with pytest.raises(NotExplainableError, match="names no taps"):
        look_at(ToyAgent(LinearNet(), Anatomy()), SEEN, None)


def test_waypoints_cut_off_the_graph_are_refused():
    class Cut(LinearNet):
        def forward(self, way: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
            return super().forward(way, others).detach()

    with pytest.raises(NotExplainableError, match="not part of torch's graph"):
        responses_at(ToyAgent(Cut(), ANATOMY), SEEN, None)


def test_waypoints_of_another_shape_are_refused():
    class Flat(LinearNet):
        def forward(self, way: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
            return super().forward(way, others).flatten()

    with pytest.raises(NotExplainableError, match=r"\(T, 2\).*not \(4,\)"):
        responses_at(ToyAgent(Flat(), ANATOMY), SEEN, None)


def test_a_tap_that_nothing_passes_is_named():
    groups = {"way": TokenGroup(tap="way"), "never": TokenGroup(tap="dropout")}

    class Around(LinearNet):
        def forward(self, way: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
            return self.way(way) + self.others(others).sum()

    with pytest.raises(NotExplainableError, match="nothing passed tap 'dropout'"):
        responses_at(ToyAgent(Around(), Anatomy(groups=groups)), SEEN, None)


def test_a_tap_that_is_passed_twice_is_named():
    class Twice(LinearNet):
        def forward(self, way: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
            return self.way(self.way(way)) + self.others(others).sum()

    with pytest.raises(NotExplainableError, match="tap 'way' was passed twice"):
        responses_at(ToyAgent(Twice(), ANATOMY), SEEN, None)


def test_a_tap_that_hands_on_a_tuple_is_named():
    class Pair(nn.Module):
        def forward(self, value: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
            return value, value

    net = LinearNet()
    net.way = Pair()
    with pytest.raises(NotExplainableError, match="tap 'way' hands on tuple"):
        responses_at(ToyAgent(net, ANATOMY), SEEN, None)
