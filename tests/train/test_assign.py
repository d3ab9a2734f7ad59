"""The assignment of cells to objects against loops, and the loss where the answer is known."""

import math

import pytest
import torch

from experiments.train.assign import SHARPNESS, TOP, assign, decoded, detection_loss, grids, overlap

H, W = 64, 96


def scene(seed: int, images: int = 2, objects: int = 5, classes: int = 3):
    g = torch.Generator().manual_seed(seed)
    cells, strides = grids(H, W, torch.device("cpu"))
    raw = torch.randn(images, len(cells), 5 + classes, generator=g)
    low = torch.rand(images, objects, 2, generator=g) * torch.tensor([W - 20.0, H - 20.0])
    true = torch.cat([low, low + 3 + 30 * torch.rand(images, objects, 2, generator=g)], -1)
    kinds = torch.randint(0, classes, (images, objects), generator=g)
    clear = torch.rand(images, objects, generator=g) < 0.7
    return cells, strides, raw, kinds, true, clear


def slow_iou(a: list[float], b: list[float]) -> float:
    wide, high = (max(0.0, min(a[k + 2], b[k + 2]) - max(a[k], b[k])) for k in (0, 1))
    areas = [(x[2] - x[0]) * (x[3] - x[1]) for x in (a, b)]
    return wide * high / (sum(areas) - wide * high)


def slow_assign(cells, strides, raw, kinds, true, clear):
    n = len(cells)
    boxes = decoded(raw, cells, strides).double().tolist()
    owners, qualities, counted = [], [], []
    for i in range(len(raw)):
        align = [[0.0] * n for _ in true[i]]
        ious = [[slow_iou(boxes[i][c], t) for c in range(n)] for t in true[i].double().tolist()]
        inside = [[False] * n for _ in true[i]]
        for k, (x0, y0, x1, y1) in enumerate(true[i].tolist()):
            for c in range(n):
                s = float(strides[c])
                x, y = (float(v) * s + s / 2 for v in cells[c])
                inside[k][c] = x0 < x < x1 and y0 < y < y1
                near = max(abs(x - (x0 + x1) / 2), abs(y - (y0 + y1) / 2)) < 0.75 * s
                if clear[i, k] and (inside[k][c] or near):
                    p = torch.sigmoid(raw[i, c, 4]) * torch.sigmoid(raw[i, c, 5 + kinds[i, k]])
                    align[k][c] = math.sqrt(p) * ious[k][c] ** SHARPNESS + 1e-9
        chosen = [sorted((c for c in range(n) if a[c] > 0), key=lambda c, a=a: -a[c])[:TOP] for a in align]
        owner = [-1] * n
        for c in range(n):
            rivals = [k for k in range(len(chosen)) if c in chosen[k]]
            if rivals:
                owner[c] = max(rivals, key=lambda k, c=c: ious[k][c])
        quality = [0.0] * n
        for k in range(len(chosen)):
            mine = [c for c in range(n) if owner[c] == k]
            for c in mine:
                quality[c] = align[k][c] / max(align[k][j] for j in mine) * max(ious[k][j] for j in mine)
        unasked = [any(inside[k][c] and not clear[i, k] for k in range(len(align))) for c in range(n)]
        owners.append(owner)
        qualities.append(quality)
        counted.append([owner[c] >= 0 or not unasked[c] for c in range(n)])
    return owners, qualities, counted


@pytest.mark.parametrize("seed", range(4))
def test_assignment_against_loops(seed):
    cells, strides, raw, kinds, true, clear = scene(seed)
    boxes = decoded(raw, cells, strides)
    owner, quality, counts = assign(raw, boxes, cells, strides, kinds, true, clear)
    owners, qualities, counted = slow_assign(cells, strides, raw, kinds, true, clear)
    sure = torch.tensor(qualities) > 1e-3  # below, cells of no overlap tie
    assert sure.sum() > 10
    assert (owner == torch.tensor(owners))[sure].all()
    torch.testing.assert_close(quality[sure], torch.tensor(qualities)[sure], rtol=1e-3, atol=1e-5)
    assert ((counts == torch.tensor(counted)) | (owner >= 0) | (torch.tensor(owners) >= 0)).all()
    asked = clear.gather(1, owner.clamp(min=0))
    assert asked[owner >= 0].all()


def test_overlap_against_loops():
    g = torch.Generator().manual_seed(9)
    low = torch.rand(20, 2, 2, generator=g) * 20
    boxes = torch.cat([low, low + 1 + 20 * torch.rand(20, 2, 2, generator=g)], -1)
    iou, complete = overlap(boxes[:, 0], boxes[:, 1])
    slow = [slow_iou(a, b) for a, b in boxes.tolist()]
    torch.testing.assert_close(iou, torch.tensor(slow))
    assert (complete <= iou + 1e-6).all()
    same, whole = overlap(boxes[:, 0], boxes[:, 0])
    torch.testing.assert_close(same, torch.ones(20))
    torch.testing.assert_close(whole, torch.ones(20))


def test_grids_are_row_by_row_from_the_finest():
    cells, strides = grids(64, 96, torch.device("cpu"))
    assert cells.shape == (8 * 12 + 4 * 6 + 2 * 3, 2)
    assert cells[:13].tolist()[-2:] == [[11, 0], [0, 1]]
    assert strides.unique().tolist() == [8, 16, 32]


def test_the_loss_falls_when_the_answer_is_learned():
    cells, strides, raw, kinds, true, clear = scene(5)
    raw = torch.nn.Parameter(raw)
    optimizer = torch.optim.Adam([raw], lr=0.05)
    losses = []
    for _ in range(150):
        loss = detection_loss(raw, H, W, kinds, true, clear)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.25 * losses[0]
    owner, _, _ = assign(raw.data, decoded(raw.data, cells, strides), cells, strides, kinds, true, clear)
    for i, k in clear.nonzero().tolist():
        best = (owner[i] == k).float() * raw.data[i, :, 4].sigmoid()
        assert slow_iou(decoded(raw.data, cells, strides)[i, best.argmax()].tolist(), true[i, k].tolist()) > 0.8


def test_an_image_without_objects_has_a_loss():
    _, _, raw, _, _, _ = scene(6)
    nothing = torch.zeros(2, 1, dtype=torch.int64), torch.zeros(2, 1, 4), torch.zeros(2, 1, dtype=torch.bool)
    assert torch.isfinite(detection_loss(raw, H, W, *nothing))
