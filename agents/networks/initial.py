"""What weights begin as, where torch's own choice is too small."""

from __future__ import annotations

from torch import nn


def begin_as_he(network: nn.Module) -> None:
    """Weights of linear layers and convolutions as He et al. draw them, and biases of 0; in place.

    By torch's own a layer with a ReLU passes on a sixth of what its input varies by: after ten of
    them without a norm or a shortcut biases alone are left, which tell no two samples apart.
    Source: He et al., Delving Deep into Rectifiers, ICCV 2015.
    """
    for module in network.modules():
        if isinstance(module, nn.Linear | nn.Conv2d):
            nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
            if module.bias is not None:
                nn.init.zeros_(module.bias)
