"""What a cell most likely holds, said by who was trained with classes of unequal weight."""

from __future__ import annotations

import torch

from agents.driveinsight.semantics import CLASS_WEIGHTS, BevClass, likeliest


def test_the_weights_of_training_are_taken_back():
    """Where three in ten are a vehicle, weighted entropy learns it as likelier than the road."""
    shares = torch.zeros(len(BevClass))
    shares[BevClass.ROAD], shares[BevClass.VEHICLE], shares[BevClass.OTHER] = 0.6, 0.3, 0.1
    weighted = shares * torch.tensor(CLASS_WEIGHTS)
    learnt = (weighted / weighted.sum()).clamp(min=1e-9).log()  # brings weighted entropy lowest
    logits = learnt[None, :, None, None].expand(1, -1, 2, 3)
    assert (logits.argmax(dim=1) == BevClass.VEHICLE).all()
    assert (likeliest(logits) == BevClass.ROAD).all()
    assert likeliest(logits).shape == (1, 2, 3)
