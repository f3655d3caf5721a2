"""Pixels to numbers about 0."""

from __future__ import annotations

from torch import Tensor

_MIDDLE, _SPREAD = 120.0, 60.0


def normalised(images: Tensor) -> Tensor:
    """(B, 3, H, W) of 0..255 to real numbers, most of them within -2..2."""
    return (images.float() - _MIDDLE) / _SPREAD
