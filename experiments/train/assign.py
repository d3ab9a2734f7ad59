"""Which cells of the detector's grids answer for which object, and the loss that follows."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from experiments.train.networks import STRIDES

TOP = 10  # cells that answer for an object, at most
SHARPNESS = 6.0  # power of the IoU in the alignment of a cell with an object


def grids(height: int, width: int, device: torch.device) -> tuple[Tensor, Tensor]:
    """Return the cells (x, y) [n, 2] of the grids, row by row from the finest, and their strides [n, 1], pixels."""
    cells, strides = [], []
    for s in STRIDES:
        y, x = torch.meshgrid(torch.arange(height // s), torch.arange(width // s), indexing="ij")
        cells.append(torch.stack([x, y], -1).reshape(-1, 2))
        strides.append(torch.full((cells[-1].shape[0], 1), s))
    return torch.cat(cells).float().to(device), torch.cat(strides).float().to(device)


def decoded(raw: Tensor, cells: Tensor, strides: Tensor) -> Tensor:
    """Return the boxes [..., n, 4] xyxy in pixels of raw predictions [..., n, >= 4]."""
    middle = (raw[..., :2] + cells) * strides
    half = raw[..., 2:4].clamp(max=6).exp() * strides / 2
    return torch.cat([middle - half, middle + half], -1)


def overlap(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor]:
    """Return IoU and complete IoU (Zheng et al., AAAI 2020) of boxes [..., 4] xyxy that broadcast."""
    size_a, size_b = a[..., 2:] - a[..., :2], b[..., 2:] - b[..., :2]
    both = (torch.minimum(a[..., 2:], b[..., 2:]) - torch.maximum(a[..., :2], b[..., :2])).clamp(min=0).prod(-1)
    iou = both / (size_a.prod(-1) + size_b.prod(-1) - both).clamp(min=1e-6)
    around = torch.maximum(a[..., 2:], b[..., 2:]) - torch.minimum(a[..., :2], b[..., :2])
    apart = ((a[..., :2] + a[..., 2:]) - (b[..., :2] + b[..., 2:])).square().sum(-1) / 4
    shape = (size_b[..., 0] / size_b[..., 1].clamp(min=1e-3)).atan() - (
        size_a[..., 0] / size_a[..., 1].clamp(min=1e-3)
    ).atan()
    v = shape.square() * (4 / torch.pi**2)
    with torch.no_grad():
        weight = v / (1 - iou + v).clamp(min=1e-6)
    return iou, iou - apart / around.square().sum(-1).clamp(min=1e-6) - weight * v


@torch.no_grad()
def assign(
    raw: Tensor, boxes: Tensor, cells: Tensor, strides: Tensor, classes: Tensor, true: Tensor, clear: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Let the cells that already predict an object best answer for it (Feng et al., TOOD, ICCV 2021).

    Args:
        raw: [N, n, 5 + c] predictions.
        boxes: [N, n, 4] the same decoded.
        cells: [n, 2]; strides: [n, 1].
        classes: [N, k] kinds of the objects.
        true: [N, k, 4] their boxes, pixels.
        clear: [N, k] whether an object is asked for; others, and the padding, are not.

    Returns:
        The object that each cell answers for [N, n], -1: none; the quality [N, n] that it should name, 0..1; and
        whether what a cell says counts at all [N, n]: not where it looks at something that is not asked for.
    """
    points = ((cells + 0.5) * strides)[None, None]  # [1, 1, n, 2]
    low, high = true[:, :, None, :2], true[:, :, None, 2:]
    inside = ((points > low) & (points < high)).all(-1)  # [N, k, n]
    near = ((points - (low + high) / 2).abs() < strides[:, 0, None] * 0.75).all(-1)  # small ones hold no centre
    iou = overlap(boxes[:, None], true[:, :, None])[0]
    kinds = raw[..., 5:].sigmoid().transpose(1, 2)  # [N, c, n]
    kind = kinds.gather(1, classes[:, :, None].expand(-1, -1, raw.shape[1]))
    score = raw[..., 4].sigmoid()[:, None] * kind
    align = score.sqrt() * iou.pow(SHARPNESS)
    align = torch.where((inside | near) & clear[:, :, None], align + 1e-9, 0.0)
    best = align.topk(min(TOP, align.shape[2]), dim=2)
    chosen = torch.zeros_like(align).scatter(2, best.indices, 1.0).bool() & (align > 0)
    rival = torch.where(chosen, iou + 1e-6, -1.0)
    most, owner = rival.max(1)  # [N, n]: of several objects the one of the largest IoU
    owner = torch.where(most > 0, owner, -1)
    mine = torch.arange(true.shape[1], device=true.device)[None, :, None] == owner[:, None]
    align = torch.where(mine, align, 0.0)
    strongest, largest = align.amax(2, keepdim=True), torch.where(mine, iou, 0.0).amax(2, keepdim=True)
    quality = (align / strongest.clamp(min=1e-12) * largest).amax(1)
    unasked = (inside & ~clear[:, :, None]).any(1)
    return owner, quality.clamp(0, 1), (owner >= 0) | ~unasked


def detection_loss(raw: Tensor, height: int, width: int, classes: Tensor, true: Tensor, clear: Tensor) -> Tensor:
    """Return the loss of a batch.

    Whether something is there is taught at every cell with the quality as target (quality focal loss, Li et al.,
    NeurIPS 2020), what it is and where at the cells that answer for an object.

    Args:
        raw: [N, n, 5 + c] predictions.
        height: of the images, pixels; width: the same.
        classes: [N, k]; true: [N, k, 4]; clear: [N, k]: see ``assign``.
    """
    cells, strides = grids(height, width, raw.device)
    boxes = decoded(raw, cells, strides)
    owner, quality, counts = assign(raw.detach(), boxes.detach(), cells, strides, classes, true, clear)
    total = quality.sum().clamp(min=1.0)
    said = raw[..., 4]
    there = F.binary_cross_entropy_with_logits(said, quality, reduction="none")
    there = (there * (said.sigmoid() - quality).square() * counts).sum() / total
    image, cell = torch.nonzero(owner >= 0, as_tuple=True)
    which = owner[image, cell]
    weight = quality[image, cell] + 0.05
    kind = F.one_hot(classes[image, which], raw.shape[2] - 5).float()
    what = F.binary_cross_entropy_with_logits(raw[image, cell, 5:], kind, reduction="none").sum(1)
    place = 1 - overlap(boxes[image, cell], true[image, which])[1]
    return there + 0.5 * (what * weight).sum() / total + 2.5 * (place * weight).sum() / total
