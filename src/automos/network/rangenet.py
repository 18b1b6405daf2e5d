"""RangeNet++'s shape (Milioto et al., IROS 2019): a Darknet encoder that shrinks images in azimuth only."""

from __future__ import annotations

from itertools import pairwise

from torch import Tensor, nn

_BLOCKS = (1, 2, 8, 8, 4)
"""Residual blocks of the stages of Darknet-53."""


def _conv(inputs: int, outputs: int, kernel: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride=(1, stride), padding=kernel // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.LeakyReLU(0.1),
    )


class _Residual(nn.Module):
    def __init__(self, channels: int):
        super().__init__()
        self.body = nn.Sequential(_conv(channels, channels // 2, 1), _conv(channels // 2, channels, 3))

    def forward(self, x: Tensor) -> Tensor:
        return x + self.body(x)


class _Stage(nn.Sequential):
    """Half the width, twice the channels, `n` residual blocks."""

    def __init__(self, inputs: int, outputs: int, n: int, dropout: float):
        super().__init__(
            _conv(inputs, outputs, 3, stride=2), *(_Residual(outputs) for _ in range(n)), nn.Dropout2d(dropout)
        )


class _Grow(nn.Module):
    """Twice the width, joined with the encoder's picture by a sum."""

    def __init__(self, inputs: int, outputs: int, dropout: float):
        super().__init__()
        self.grow = nn.Sequential(
            nn.ConvTranspose2d(inputs, outputs, (1, 4), stride=(1, 2), padding=(0, 1), bias=False),
            nn.BatchNorm2d(outputs),
            nn.LeakyReLU(0.1),
        )
        self.refine = nn.Sequential(_Residual(outputs), nn.Dropout2d(dropout))

    def forward(self, x: Tensor, skip: Tensor) -> Tensor:
        return self.refine(self.grow(x)) + skip


class RangeNet(nn.Module):
    """Logits (B, classes, H, W) for images (B, inputs, H, W); W is a multiple of 32."""

    def __init__(self, inputs: int, classes: int, channels: int = 32, dropout: float = 0.01):
        """Take the channels of the first layer: 32 gives Darknet-53."""
        super().__init__()
        widths = [channels * 2**i for i in range(len(_BLOCKS) + 1)]
        self.start = _conv(inputs, channels, 3)
        self.down = nn.ModuleList(
            _Stage(a, b, n, dropout) for a, b, n in zip(widths, widths[1:], _BLOCKS, strict=False)
        )
        self.up = nn.ModuleList(_Grow(b, a, dropout) for a, b in reversed(list(pairwise(widths))))
        self.head = nn.Conv2d(channels, classes, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        """Return the logits."""
        x = self.start(x)
        skips = []
        for down in self.down:
            skips.append(x)
            x = down(x)  # (B, 2c, H, W / 2)
        for up, skip in zip(self.up, reversed(skips), strict=True):
            x = up(x, skip)
        return self.head(x)
