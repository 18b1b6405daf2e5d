"""SalsaNext (Cortinhal et al., ISVC 2020): context, dilated residual encoder, pixel-shuffle decoder."""

from itertools import pairwise

import torch
from torch import Tensor, nn


class _Conv(nn.Sequential):
    """Convolution that keeps the size, leaky ReLU, batch norm."""

    def __init__(self, inputs: int, outputs: int, kernel: int = 3, dilation: int = 1):
        super().__init__(
            nn.Conv2d(inputs, outputs, kernel, padding=dilation * (kernel - 1) // 2, dilation=dilation),
            nn.LeakyReLU(),
            nn.BatchNorm2d(outputs),
        )


class _Context(nn.Module):
    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.shortcut = nn.Sequential(nn.Conv2d(inputs, outputs, 1), nn.LeakyReLU())
        self.near = _Conv(outputs, outputs)
        self.far = _Conv(outputs, outputs, dilation=2)

    def forward(self, x: Tensor) -> Tensor:
        x = self.shortcut(x)
        return x + self.far(self.near(x))


class _Dilated(nn.Module):
    """Three convolutions of growing reach, seen together."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.first = _Conv(inputs, outputs)
        self.second = _Conv(outputs, outputs, dilation=2)
        self.third = _Conv(outputs, outputs, kernel=2, dilation=2)
        self.joined = _Conv(3 * outputs, outputs, kernel=1)

    def forward(self, x: Tensor) -> Tensor:
        a = self.first(x)
        b = self.second(a)
        return self.joined(torch.cat([a, b, self.third(b)], dim=1))


class _Down(nn.Module):
    """A residual block, and its picture at half the size."""

    def __init__(self, inputs: int, outputs: int, dropout: float):
        super().__init__()
        self.shortcut = nn.Sequential(nn.Conv2d(inputs, outputs, 1), nn.LeakyReLU())
        self.block = _Dilated(inputs, outputs)
        self.shrink = nn.Sequential(nn.Dropout2d(dropout), nn.AvgPool2d(3, stride=2, padding=1))

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        x = self.shortcut(x) + self.block(x)
        return x, self.shrink(x)


class _Up(nn.Module):
    """Twice the size by pixel shuffle, joined with the encoder's picture of that size."""

    def __init__(self, inputs: int, skipped: int, outputs: int, dropout: float):
        super().__init__()
        self.grow = nn.Sequential(nn.PixelShuffle(2), nn.Dropout2d(dropout))
        self.block = nn.Sequential(nn.Dropout2d(dropout), _Dilated(inputs // 4 + skipped, outputs))

    def forward(self, x: Tensor, skip: Tensor) -> Tensor:
        return self.block(torch.cat([self.grow(x), skip], dim=1))


class SalsaNext(nn.Module):
    """Logits (B, classes, H, W) for images (B, inputs, H, W); H and W are multiples of 16."""

    def __init__(self, inputs: int, classes: int, channels: int = 32, dropout: float = 0.2):
        """Take the channels of the first layer: 32 is the published size, 8 the narrow one."""
        super().__init__()
        c = channels
        self.context = nn.Sequential(_Context(inputs, c), _Context(c, c), _Context(c, c))
        widths = (c, 2 * c, 4 * c, 8 * c, 8 * c)
        self.down = nn.ModuleList(_Down(a, b, dropout if i else 0.0) for i, (a, b) in enumerate(pairwise(widths)))
        self.bottom = nn.ModuleList([nn.Conv2d(8 * c, 8 * c, 1), _Dilated(8 * c, 8 * c)])
        skips, outputs = (8 * c, 8 * c, 4 * c, 2 * c), (4 * c, 4 * c, 2 * c, c)
        inputs_up = (8 * c, *outputs)
        self.up = nn.ModuleList(_Up(a, b, o, dropout) for a, b, o in zip(inputs_up, skips, outputs, strict=False))
        self.head = nn.Conv2d(c, classes, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Return the logits."""
        x = self.context(x)  # (B, c, H, W)
        skips = []
        for down in self.down:
            full, x = down(x)
            skips.append(full)
        x = nn.functional.leaky_relu(self.bottom[0](x)) + self.bottom[1](x)  # (B, 8c, H / 16, W / 16)
        for up, skip in zip(self.up, reversed(skips), strict=True):
            x = up(x, skip)
        return self.head(x)
