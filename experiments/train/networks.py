"""The two networks: a small one-stage detector with YOLOX's head, and DeepLabV3+ on MobileNetV3-small."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from fdslam.torchvision_compat import import_torchvision

import_torchvision()
from torchvision.models import mobilenet_v3_small  # noqa: E402 (needs the line above)

STRIDES = (8, 16, 32)  # of the detector's three grids, pixels


def conv(cin: int, cout: int, kernel: int = 3, stride: int = 1, dilation: int = 1, groups: int = 1) -> nn.Sequential:
    """Return convolution, batch norm and hardswish that keep the size but for the stride."""
    pad = dilation * (kernel // 2)
    layer = nn.Conv2d(cin, cout, kernel, stride, pad, dilation, groups, bias=False)
    return nn.Sequential(layer, nn.BatchNorm2d(cout, momentum=0.03), nn.Hardswish(inplace=True))


def separable(cin: int, cout: int, kernel: int = 3, dilation: int = 1) -> nn.Sequential:
    """Return a depthwise convolution followed by a pointwise one."""
    return nn.Sequential(conv(cin, cin, kernel, dilation=dilation, groups=cin), conv(cin, cout, 1))


class Residual(nn.Module):
    """x + f(x) with a 1×1 and a 3×3 convolution."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.body = nn.Sequential(conv(width, width, 1), conv(width, width))

    def forward(self, x: Tensor) -> Tensor:
        """Keep the shape [N, width, h, w]."""
        return x + self.body(x)


class Split(nn.Module):
    """Cross-stage partial block (Wang et al., CVPRW 2020): half the channels pass ``depth`` residual blocks."""

    def __init__(self, cin: int, cout: int, depth: int) -> None:
        super().__init__()
        half = cout // 2
        self.past, self.through, self.join = conv(cin, half, 1), conv(cin, half, 1), conv(2 * half, cout, 1)
        self.blocks = nn.Sequential(*(Residual(half) for _ in range(depth)))

    def forward(self, x: Tensor) -> Tensor:
        """[N, cin, h, w] to [N, cout, h, w]."""
        return self.join(torch.cat([self.past(x), self.blocks(self.through(x))], 1))


class Pyramid(nn.Module):
    """Spatial pyramid of three 5×5 maxima, one after the other: it sees the whole image at stride 32."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.squeeze, self.join = conv(width, width // 2, 1), conv(2 * width, width, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Keep the shape [N, width, h, w]."""
        parts = [self.squeeze(x)]
        for _ in range(3):
            parts.append(F.max_pool2d(parts[-1], 5, 1, 2))
        return self.join(torch.cat(parts, 1))


class Head(nn.Module):
    """One level's decoupled head: a box, whether something is there, and what it is."""

    def __init__(self, cin: int, width: int, classes: int) -> None:
        super().__init__()
        self.stem = conv(cin, width, 1)
        self.where = nn.Sequential(separable(width, width), separable(width, width))
        self.what = separable(width, width)
        self.box, self.object, self.kind = nn.Conv2d(width, 4, 1), nn.Conv2d(width, 1, 1), nn.Conv2d(width, classes, 1)
        nn.init.constant_(self.object.bias, -4.6)  # almost nowhere is an object
        nn.init.zeros_(self.box.weight)
        nn.init.constant_(self.box.bias, 0.0)

    def forward(self, x: Tensor) -> Tensor:
        """[N, cin, h, w] to [N, h·w, 5 + classes]: tx, ty, tw, th and the logits."""
        x = self.stem(x)
        where, what = self.where(x), self.what(x)
        return torch.cat([self.box(where), self.object(where), self.kind(what)], 1).flatten(2).transpose(1, 2)


class Detector(nn.Module):
    """A one-stage detector without anchors: CSP backbone, path-aggregating neck, decoupled heads.

    Args:
        classes: number of kinds.
        widths: channels at the strides 2, 4, 8, 16 and 32; the neck has the width of stride 8.
    """

    def __init__(self, classes: int, widths: tuple[int, int, int, int, int] = (16, 32, 64, 96, 160)) -> None:
        super().__init__()
        a, b, c, d, e = widths
        self.early = nn.Sequential(conv(3, a, 3, 2), conv(a, b, 3, 2), Split(b, b, 1), conv(b, c, 3, 2), Split(c, c, 2))
        self.middle = nn.Sequential(conv(c, d, 3, 2), Split(d, d, 2))
        self.late = nn.Sequential(conv(d, e, 3, 2), Pyramid(e), Split(e, e, 1))
        self.lift5, self.lift4 = conv(e, c, 1), conv(c, c, 1)
        self.down4, self.down3 = Split(d + c, c, 1), Split(c + c, c, 1)
        self.shrink3, self.shrink4 = conv(c, c, 3, 2), conv(c, c, 3, 2)
        self.up4, self.up5 = Split(c + c, c, 1), Split(c + c, c, 1)
        self.heads = nn.ModuleList(Head(c, c, classes) for _ in STRIDES)

    def forward(self, x: Tensor) -> Tensor:
        """Return the raw predictions of every cell of the grids.

        Args:
            x: float32 [N, 3, H, W], BGR 0..255; H and W multiples of 32.

        Returns:
            float32 [N, n, 5 + classes], n = HW/64 + HW/256 + HW/1024, rows of each grid from the finest to the
            coarsest: centre = (t[0:2] + cell) · stride, size = exp(t[2:4]) · stride, logits of object and kinds.
        """
        c3 = self.early((x - 114.0) / 58.0)
        c4 = self.middle(c3)
        c5 = self.lift5(self.late(c4))
        p4 = self.lift4(self.down4(torch.cat([c4, F.interpolate(c5, scale_factor=2.0)], 1)))
        p3 = self.down3(torch.cat([c3, F.interpolate(p4, scale_factor=2.0)], 1))
        n4 = self.up4(torch.cat([self.shrink3(p3), p4], 1))
        n5 = self.up5(torch.cat([self.shrink4(n4), c5], 1))
        return torch.cat([head(level) for head, level in zip(self.heads, (p3, n4, n5), strict=True)], 1)


class DeepLabV3Plus(nn.Module):
    """DeepLabV3+ (Chen et al., ECCV 2018) on a MobileNetV3-small whose last stage is dilated, so of stride 16.

    Narrower than the original throughout: five labels of a synthetic world need little, and a CPU has to train it.

    Args:
        classes: number of labels.
        width: channels of the pyramid and the decoder.
        low: channels of the low-level features.
    """

    def __init__(self, classes: int, width: int = 96, low: int = 24) -> None:
        super().__init__()
        features = mobilenet_v3_small(weights=None, dilated=True, reduced_tail=True).features
        self.early, self.late = features[:2], features[2:]  # strides 4 and 16
        self.point = conv(self.late[-1][0].out_channels, width, 1)
        self.atrous = nn.ModuleList(separable(width, width, dilation=d) for d in (6, 12, 18))
        self.pool = nn.Sequential(nn.Conv2d(width, width, 1), nn.Hardswish(inplace=True))
        self.project = nn.Sequential(conv(5 * width, width, 1), nn.Dropout(0.1), nn.Conv2d(width, 64, 1))
        self.low = conv(16, low, 1)
        self.decoder = nn.Sequential(separable(64 + low, 64), separable(64, 64), nn.Conv2d(64, classes, 1))

    def forward(self, x: Tensor) -> Tensor:
        """Return the logits of every pixel.

        Args:
            x: float32 [N, 3, H, W], RGB 0..255; H and W multiples of 16.

        Returns:
            float32 [N, classes, H, W].
        """
        early = self.early((x - 114.0) / 58.0)
        deep = self.point(self.late(early))
        parts = [deep, *(branch(deep) for branch in self.atrous)]
        whole = self.pool(deep.mean((2, 3), keepdim=True))
        joined = self.project(torch.cat([*parts, whole.expand_as(deep)], 1))
        up = F.interpolate(joined, scale_factor=4.0, mode="bilinear", align_corners=False)
        logits = self.decoder(torch.cat([up, self.low(early)], 1))
        return F.interpolate(logits, scale_factor=4.0, mode="bilinear", align_corners=False)
