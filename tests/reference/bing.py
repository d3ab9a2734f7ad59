"""BING by the words of the paper, as loops over pixels, bits and windows."""

import math

import cv2
import numpy as np


def difference(u, v, space):
    """How much two pixels of a colour space differ."""
    each = [abs(int(a) - int(b)) for a, b in zip(u, v, strict=True)]
    return sum(each) if space == "hsv" else max(each)


def along(line, space):
    """Return |I'| along a line of pixels: of the two neighbours, at an end of the only one."""
    out = []
    for i in range(len(line)):
        if 0 < i < len(line) - 1:
            inner = difference(line[i - 1], line[i + 1], space)
            out.append(inner // 2 if space == "hsv" else inner)
        elif len(line) > 1:
            outer = difference(line[i], line[1 if i == 0 else i - 1], space)
            out.append(outer if space == "hsv" else 2 * outer)
        else:
            out.append(0)
    return out


def gradient(image, space):
    """Return min(|Ix| + |Iy|, 255)."""
    if space == "hsv":
        image = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
    if space == "grey":
        image = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)[..., None]
    rows = [along(list(row), space) for row in image]
    columns = [along([row[x] for row in image], space) for x in range(image.shape[1])]
    height, width = image.shape[:2]
    return np.array(
        [[min(rows[y][x] + columns[x][y], 255) for x in range(width)] for y in range(height)], np.uint8
    ).reshape(height, width)


def binarise(weights):
    """Return β and the signs (±1, row by row) of w ≈ Σ β_j a_j, greedily."""
    rest = [float(w) for row in weights for w in row]
    beta, signs = [], []
    for _ in range(2):
        beta.append(math.fsum(map(abs, rest)) / 64)
        signs.append([1 if r >= 0 else -1 for r in rest])
        rest = [r - beta[-1] * a for r, a in zip(rest, signs[-1], strict=True)]
    return beta, signs


def score(window, beta, signs):
    """Return s = Σ_j β_j Σ_{k<4} 2^k (2 |a_j⁺ ∧ b_k| − |b_k|) of one 8 × 8 window."""
    pixels = [int(g) for row in window for g in row]
    total = 0.0
    for size, sign in zip(beta, signs, strict=True):
        whole = 0
        for k in range(4):
            bits = [(g >> (4 + k)) & 1 for g in pixels]
            both = sum(bit for bit, a in zip(bits, sign, strict=True) if a == 1)
            whole += 2**k * (2 * both - sum(bits))
        total += size * whole
    return np.float32(total)


def score_map(gradient, weights):
    """Return the score of every window."""
    beta, signs = binarise(weights)
    height, width = (max(side - 7, 0) for side in gradient.shape)
    rows = [[score(gradient[y : y + 8, x : x + 8], beta, signs) for x in range(width)] for y in range(height)]
    return np.array(rows, np.float32).reshape(height, width)


def best_windows(scores, radius, count):
    """Return (y, x) of the windows kept: the best of all that are left, again and again."""
    left = {(y, x) for y in range(scores.shape[0]) for x in range(scores.shape[1])}
    kept = []
    while left and len(kept) < count:
        y, x = min(left, key=lambda at: (-scores[at], at))
        kept.append((y, x))
        left = {at for at in left if max(abs(at[0] - y), abs(at[1] - x)) > radius}
    return kept


def proposals(image, several, count):
    """Return [(score, box)] of the best ``count`` boxes; ``several`` is [(space, w, {(h, w): (v, t)})]."""
    height, width = image.shape[:2]
    found = []
    for space, weights, sizes in several:
        for (h, w), (v, t) in sizes.items():
            if h > 2 * height or w > 2 * width:
                continue
            rows, columns = round(8 * height / min(h, height)), round(8 * width / min(w, width))
            small = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_LINEAR_EXACT)
            scores = score_map(gradient(small, space), weights)
            for y, x in best_windows(scores, 2, 130):
                corners = x * width / columns, y * height / rows, (x + 8) * width / columns, (y + 8) * height / rows
                found.append((np.float32(float(scores[y, x]) * v + t), tuple(round(c) for c in corners)))
    found.sort(key=lambda one: -one[0])  # stable
    once = []
    for one in found:
        if one[1] not in [box for _, box in once]:
            once.append(one)
    return once[:count]
