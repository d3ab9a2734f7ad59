"""Slow, obvious oracles: the equations as they are written, one loop a symbol. The fast code is held against them."""

from __future__ import annotations

import math
from fractions import Fraction
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.ndimage import gaussian_filter
from sklearn.metrics import average_precision_score, precision_recall_curve, roc_auc_score

from fdslam.config import Keypoints
from fdslam.types import CELL, Image

# --- bag of words -----------------------------------------------------------------------------------------------------


def hamming(a, b):
    return (int.from_bytes(bytes(a), "big") ^ int.from_bytes(bytes(b), "big")).bit_count()


def match(descriptors, words, ratio):
    """The word of each descriptor by the ratio test of its two nearest words, -1 where it fails."""
    result = []
    for descriptor in descriptors:
        distances = sorted((hamming(descriptor, word), i) for i, word in enumerate(words))
        ok = len(distances) >= 2 and distances[0][0] <= ratio * distances[1][0]
        result.append(distances[0][1] if ok else -1)
    return result


def learn(images, ratio):
    """The words of every image of a map, and the vocabulary, grown image by image."""
    words, posted = [], []
    for descriptors in images:
        found = match(descriptors, words, ratio)
        new = []
        for i, descriptor in enumerate(descriptors):
            if found[i] < 0:
                key = tuple(descriptor)
                if key not in new:
                    new.append(key)
                found[i] = len(words) + new.index(key)
        words += new
        posted.append(found)
    return posted, words


def scores(map_words, query_words, inside, score, one):
    """s_j(m) = Σ_w n_jw² idf_w c_wm by loops, idf in fixed point with ``one`` = 1.0."""
    count = len(map_words)
    result = np.zeros((len(inside), count), np.int64)
    for j, box in enumerate(inside):
        for m, posted in enumerate(map_words):
            for w in set(query_words) - {-1}:
                n = sum(1 for i, word in enumerate(query_words) if word == w and box[i])
                c = sum(1 for word in posted if word == w)
                holding = sum(1 for other in map_words if w in other)
                if not n or not c:
                    continue
                idf = round(math.log(count / holding) * one)
                result[j, m] += {"ibow": n * n * idf * c, "tfidf": n * idf * c, "binary": idf}[score]
    return result


def ranks(scores, unretrieved):
    """Rank of every image in every list: 1 + how many are better; score 0: the last rank or the next."""
    result = np.zeros(np.shape(scores), np.int64)
    for j, row in enumerate(scores):
        for m, s in enumerate(row):
            result[j, m] = 1 + sum(1 for other in row if other > s)
            if s == 0 and unretrieved == "last":
                result[j, m] = len(row)
    return result


def strong_list(ranks):
    """Map ids by falling Σ_j 1 / r_j in exact fractions; ties by id."""
    images = np.shape(ranks)[1]
    relevance = [sum((Fraction(1, int(r[m])) for r in ranks), Fraction(0)) for m in range(images)]
    return sorted(range(images), key=lambda m: (-relevance[m], m))


# --- fault diagnosis --------------------------------------------------------------------------------------------------


def pool(values, how):
    return {"min": min, "max": max, "mean": lambda v: sum(v) / len(v), "median": np.median}[how](values)


def mean_rank(values, how, weights=None):
    if not values:
        return 0.0
    weights = weights or [1] * len(values)
    if how == "harmonic":
        return sum(weights) / sum(w / v for w, v in zip(weights, values, strict=True))
    if how == "geometric":
        return math.exp(sum(w * math.log(v) for w, v in zip(weights, values, strict=True)) / sum(weights))
    return sum(w * v for w, v in zip(weights, values, strict=True)) / sum(weights)


def fault_diagnosis(boxes, ranks, height, width, pooling, order, mean, weights="equal"):
    """Eq. 1 pixel by pixel: J[p], the mean of the ranks, the pool over the hypotheses."""
    loc = np.zeros((height, width))
    hypotheses = range(np.shape(ranks)[1])
    area = [max(float(x1 - x0) * float(y1 - y0), CELL**2) for x0, y0, x1, y1 in boxes]
    weight = [1.0 if weights == "equal" else 1 / one for one in area]
    for y in range(height):
        for x in range(width):
            inside = [j for j, (x0, y0, x1, y1) in enumerate(boxes) if x0 <= x < x1 and y0 <= y < y1]
            w = [weight[j] for j in inside]
            if order == "fuse_then_pool":
                loc[y, x] = pool([mean_rank([ranks[j][h] for j in inside], mean, w) for h in hypotheses], pooling)
            else:
                loc[y, x] = mean_rank([pool([ranks[j][h] for h in hypotheses], pooling) for j in inside], mean, w)
    return loc


def near_keypoints(xy, height, width, reach):
    """Whether a keypoint's cell is at most ``reach`` rows and columns away, cell by cell."""
    rows, columns = math.ceil(height / CELL), math.ceil(width / CELL)
    held = {(int(y) // CELL, int(x) // CELL) for x, y in xy.tolist()}
    return np.array(
        [
            [any(abs(r - i) <= reach and abs(c - j) <= reach for i, j in held) for c in range(columns)]
            for r in range(rows)
        ]
    )


def nearest_word(descriptors, at, other_xy, other_descriptors, radius, none):
    """The distance of each descriptor to the most similar word within the radius of its place."""
    return [
        min(
            (
                hamming(d, w)
                for w, xy in zip(other_descriptors, other_xy, strict=True)
                if math.dist(place, [float(v) for v in xy]) <= radius
            ),
            default=none,
        )
        for d, place in zip(descriptors, at.tolist(), strict=True)
    ]


def predicted(xy, here, there, side, fewest, steps, scale, stray, near, wide):
    """The place of every point in the other image: an affine map by normal equations, and averaged residuals."""
    if len(here) < fewest:
        return [list(map(float, point)) for point in xy]
    a = [np.array([float(x), float(y), 1.0]) for x, y in here]
    b = [np.array([float(x), float(y)]) for x, y in there]
    weight = [1.0] * len(a)
    for _ in range(steps):
        left = sum(w * np.outer(p, p) for w, p in zip(weight, a, strict=True))
        right = sum(w * np.outer(p, q) for w, p, q in zip(weight, a, b, strict=True))
        model = np.linalg.solve(left, right)
        weight = [1 / (1 + float(sum((p @ model - q) ** 2)) / (scale * side) ** 2) for p, q in zip(a, b, strict=True)]
    moved = [(p[:2], q - p @ model) for p, q in zip(a, b, strict=True)]
    moved = [(p, r) for p, r in moved if max(abs(r)) <= stray * side]
    result = []
    for x, y in xy.tolist():
        flow = np.zeros(2)
        for sigma in (wide, near):  # the wide average is the prior of the near one
            w = [math.exp(-float(sum((p - (x, y)) ** 2)) / (2 * (sigma * side) ** 2)) for p, _ in moved]
            flow = (sum((v * r for v, (_, r) in zip(w, moved, strict=True)), np.zeros(2)) + flow) / (sum(w) + 1)
        result.append((np.array([x, y, 1.0]) @ model + flow).tolist())
    return result


def cell_maximum(pixels, cell):
    """The maximum of the pixels of every cell, partial cells at the right and lower border."""
    height, width = np.shape(pixels)
    rows, columns = math.ceil(height / cell), math.ceil(width / cell)
    result = np.zeros((rows, columns))
    for r in range(rows):
        for c in range(columns):
            result[r, c] = max(
                pixels[y][x]
                for y in range(r * cell, min((r + 1) * cell, height))
                for x in range(c * cell, min((c + 1) * cell, width))
            )
    return result


# --- pairwise comparison ----------------------------------------------------------------------------------------------


def harris_laplace(image: Image, config: Keypoints, floor: float) -> list[tuple[int, int, float, float]]:
    """Return every (x, y, σ_I, response) of Mikolajczyk & Schmid's definition, strongest first.

    Gaussian derivatives are analytic kernels, every scale is at full resolution, every pixel is visited.
    """
    grey = image.astype(np.float64) @ (0.299, 0.587, 0.114)
    grey = np.floor(grey + 0.5)
    height, width = grey.shape
    sigmas = [config.sigma * config.scale_step**n for n in range(config.scales)]

    def derivative(sigma: float, order: tuple[int, int]) -> NDArray[np.float64]:
        return gaussian_filter(grey, sigma, order=order, mode="mirror", truncate=6)

    log = [s**2 * np.abs(derivative(s, (0, 2)) + derivative(s, (2, 0))) for s in sigmas]
    found = []
    for n in range(1, config.scales - 1):
        sigma, sigma_d = sigmas[n], 0.7 * sigmas[n]
        dx, dy = derivative(sigma_d, (0, 1)), derivative(sigma_d, (1, 0))
        m = {
            name: sigma_d**2 * gaussian_filter(product, sigma, mode="mirror", truncate=6)
            for name, product in (("xx", dx * dx), ("xy", dx * dy), ("yy", dy * dy))
        }
        response = m["xx"] * m["yy"] - m["xy"] ** 2 - config.harris_k * (m["xx"] + m["yy"]) ** 2
        for y in range(1, height - 1):
            for x in range(1, width - 1):
                if min(x, y, width - 1 - x, height - 1 - y) < sigma or response[y, x] <= floor:
                    continue
                patch = response[y - 1 : y + 2, x - 1 : x + 2].ravel()
                if patch[4] < patch.max() or patch[4] == patch[:4].max():  # of equals the first in reading order
                    continue
                if log[n][y, x] > log[n - 1][y, x] and log[n][y, x] > log[n + 1][y, x]:
                    found.append((x, y, sigma, float(response[y, x])))
    return sorted(found, key=lambda f: -f[3])[: config.keypoints]


def nearest_distance(query: NDArray[np.float32], maps: list[NDArray[np.float32]]) -> list[float]:
    """Return for every query descriptor the smallest of all its distances; infinity where there is none."""
    return [
        min((float(np.sqrt(np.sum((q.astype(np.float64) - d) ** 2))) for m in maps for d in m), default=np.inf)
        for q in query
    ]


def cells_maximum(xy: NDArray[np.float32], value: NDArray[np.float32], height: int, width: int) -> NDArray[np.float64]:
    """Return the largest value among the keypoints whose pixel lies in each cell, found by walking over the pixels."""
    rows = len(range(0, height, CELL))
    columns = len(range(0, width, CELL))
    cells = np.zeros((rows, columns))
    for (x, y), v in zip(xy.tolist(), value.tolist(), strict=True):
        for row in range(rows):
            for column in range(columns):
                inside = CELL * row <= y < CELL * (row + 1) and CELL * column <= x < CELL * (column + 1)
                if inside and v > cells[row, column]:
                    cells[row, column] = v
    return cells


def blurred(cells: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Return the Gaussian-weighted sum of all cells at every cell; outside the image is 0.

    The weights are those of a kernel that is cut at 4 σ and sums to 1 over its whole support.
    """
    reach = int(4 * sigma + 0.5)
    weight = {d: np.exp(-0.5 * (d / sigma) ** 2) for d in range(-reach, reach + 1)}
    total = sum(weight.values())
    out = np.zeros_like(cells)
    for r in range(cells.shape[0]):
        for c in range(cells.shape[1]):
            for i in range(cells.shape[0]):
                for j in range(cells.shape[1]):
                    if abs(r - i) <= reach and abs(c - j) <= reach:
                        out[r, c] += weight[r - i] * weight[c - j] / total**2 * cells[i, j]
    return out


def cells_normalised(
    xy: NDArray[np.float32], value: NDArray[np.float32], height: int, width: int, sigma: float, prior: float
) -> NDArray[np.float64]:
    """Return at every cell the Gaussian-weighted sum of all keypoints' values over that of their number and a prior."""
    total = np.zeros((-(-height // CELL), -(-width // CELL)))
    number = np.zeros_like(total)
    for (x, y), v in zip(xy.tolist(), value.tolist(), strict=True):
        total[int(y) // CELL, int(x) // CELL] += v
        number[int(y) // CELL, int(x) // CELL] += 1
    return blurred(total, sigma) / (blurred(number, sigma) + prior)


# --- anomaly detection ------------------------------------------------------------------------------------------------


def bilinear(image, height, width):
    """Resize by pixel centres with the border repeated, one output pixel after the other."""
    h, w = image.shape
    out = np.empty((height, width))
    for y in range(height):
        for x in range(width):
            v, u = (y + 0.5) * h / height - 0.5, (x + 0.5) * w / width - 0.5
            v0, u0 = math.floor(v), math.floor(u)
            total = 0.0
            for dv in (0, 1):
                for du in (0, 1):
                    share = (1 - abs(v - v0 - dv)) * (1 - abs(u - u0 - du))
                    total += share * float(image[min(max(v0 + dv, 0), h - 1), min(max(u0 + du, 0), w - 1)])
            out[y, x] = total
    return out


def l1_per_pixel(images, outputs):
    """Return |I - I'| averaged over the channels, [n, h, w], one pixel after the other."""
    n, channels, h, w = images.shape
    out = np.zeros((n, h, w))
    for i in range(n):
        for y in range(h):
            for x in range(w):
                for c in range(channels):
                    out[i, y, x] += abs(float(images[i, c, y, x]) - float(outputs[i, c, y, x])) / channels
    return out


def mean_and_deviation(values):
    """Return mean and standard deviation (of the population) by two exact passes."""
    values = [float(v) for v in np.ravel(values)]
    mean = math.fsum(values) / len(values)
    return mean, math.sqrt(math.fsum((v - mean) ** 2 for v in values) / len(values))


def orientation_histogram(grey, grid, bins):
    """Return [grid, grid, bins]: gradient magnitude shared between the two nearest of ``bins`` over half a turn."""
    height, width = grey.shape
    out = np.zeros((grid, grid, bins))
    for y in range(height):
        for x in range(width):
            dx = float(grey[y, min(x + 1, width - 1)]) - float(grey[y, max(x - 1, 0)])
            dy = float(grey[min(y + 1, height - 1), x]) - float(grey[max(y - 1, 0), x])
            place = (math.atan2(dy, dx) % math.pi) / math.pi * bins
            low = math.floor(place)
            cell = out[y * grid // height, x * grid // width]
            cell[low % bins] += math.hypot(dx, dy) * (1 - (place - low))
            cell[(low + 1) % bins] += math.hypot(dx, dy) * (place - low)
    return out


def block_normalised(cells, clip):
    """Return every 2×2 block of cells at length one, clipped, and again at length one, one after the other."""
    out = []
    for y in range(cells.shape[0] - 1):
        for x in range(cells.shape[1] - 1):
            block = np.concatenate([cells[y + dy, x + dx] for dy in (0, 1) for dx in (0, 1)])
            block = np.minimum(block / max(math.sqrt((block**2).sum()), 0.5), clip)
            out.append(block / max(math.sqrt((block**2).sum()), 1e-12))
    return np.concatenate(out)


def inertia(vectors, labels):
    """Return the sum of squared distances to the centres, class by class."""
    return sum(((vectors[labels == i] - vectors[labels == i].mean(axis=0)) ** 2).sum() for i in set(labels.tolist()))


# --- evaluation and fusion --------------------------------------------------------------------------------------------


def paint(box, height, width, scale=1):
    """The pixels of a box whose corners are multiples of 1/scale, at that resolution."""
    y, x = np.mgrid[: height * scale, : width * scale] / scale
    return (box[0] <= x) & (x < box[2]) & (box[1] <= y) & (y < box[3])


def pixels_of(row, col, height, width):
    """Slices of the pixels of one cell."""
    return slice(row * CELL, min((row + 1) * CELL, height)), slice(col * CELL, min((col + 1) * CELL, width))


def grid(height, width):
    return [(r, c) for r in range(-(-height // CELL)) for c in range(-(-width // CELL))]


def positive_cells(boxes, height, width):
    """By counting painted pixels; integer boxes."""
    result = set()
    for box in boxes:
        image = paint(box, height, width)
        mine = set()
        for r, c in grid(height, width):
            part = image[pixels_of(r, c, height, width)]
            if 2 * part.sum() >= part.size:
                mine.add((r, c))
        if not mine and image.any():
            ys, xs = np.nonzero(image)
            mine.add(((ys.min() + ys.max() + 1) // 2 // CELL, (xs.min() + xs.max() + 1) // 2 // CELL))
        result |= mine
    return result


def selected_cells(scene, loc, key, percent, pool, times=None):
    """The selected (query, row, column), with ``times[q]`` copies of each query; copies are selected together."""
    times = times or [1] * len(scene.names)
    pools = [range(len(scene.names))] if pool == "all" else [[q] for q in range(len(scene.names))]
    selected = set()
    for queries in pools:
        cells = []
        for q in queries:
            for i, (r, c) in enumerate(grid(scene.heights[q], scene.widths[q])):
                cells.append((-float(loc[q][r, c]), float(key[q][i]), scene.names[q], q, r, c))
        # the percentage of a drawn query's own cells does not depend on how often it is drawn
        weight = {q: times[q] if pool == "all" else 1 for q in queries}
        room = int(Fraction(percent, 100) * sum(weight[cell[3]] for cell in cells))
        for *_, q, r, c in sorted(cells):
            room -= weight[q]
            if room < 0:
                break
            selected.add((q, r, c))
    return selected


def objects(scene):
    return [(q, box) for q, boxes in enumerate(scene.boxes) for box in boxes]


def found_by_coverage(scene, selected, share):
    """By painting; integer boxes."""
    result = []
    for q, box in objects(scene):
        image = paint(box, scene.heights[q], scene.widths[q])
        total = int(image.sum())
        inside = 0
        for r, c in grid(scene.heights[q], scene.widths[q]):
            if (q, r, c) in selected:
                inside += int(image[pixels_of(r, c, scene.heights[q], scene.widths[q])].sum())
        result.append(total > 0 and Fraction(inside, total) >= Fraction(str(share)))
    return result


def found_by_iou(scene, selected, share):
    """By labelling painted pixels; integer boxes."""
    result = []
    for q, box in objects(scene):
        height, width = scene.heights[q], scene.widths[q]
        image, mask = paint(box, height, width), np.zeros((height, width), dtype=bool)
        for r, c in grid(height, width):
            mask[pixels_of(r, c, height, width)] = (q, r, c) in selected
        labels, count = ndimage.label(mask, structure=np.ones((3, 3)))
        hit = False
        for k in range(1, count + 1):
            both, either = int((image & (labels == k)).sum()), int((image | (labels == k)).sum())
            hit = hit or (bool(image.any()) and Fraction(both, either) >= Fraction(str(share)))
        result.append(hit)
    return result


def curve(values, positive):
    """AUROC, average precision and F1-max by scikit-learn; None where undefined."""
    if not any(positive):
        return None, None, None
    area = None if all(positive) else roc_auc_score(positive, values)
    precision, recall, _ = precision_recall_curve(positive, values)
    f1 = max(2 * p * r / (p + r) for p, r in zip(precision, recall, strict=True) if p + r > 0)
    return area, average_precision_score(positive, values), f1


def cells_and_truth(scene, loc, times=None):
    """All values and whether they are positive, queries repeated as often as drawn."""
    values, truth = [], []
    for q in range(len(scene.names)):
        changed = positive_cells(scene.boxes[q], scene.heights[q], scene.widths[q])
        for _ in range(times[q] if times is not None else 1):
            values += [float(loc[q][cell]) for cell in grid(scene.heights[q], scene.widths[q])]
            truth += [cell in changed for cell in grid(scene.heights[q], scene.widths[q])]
    return values, truth


def location_controlled(scene, loc, times=None):
    """By loops over boxes, unchanged queries and pairs of cells; None where undefined."""
    times = times if times is not None else [1] * len(scene.names)
    scores = []
    for q, box in objects(scene):
        cells = positive_cells([box], scene.heights[q], scene.widths[q])
        each = []
        for u in range(len(scene.names)):
            if len(scene.boxes[u]) or np.shape(loc[u]) != np.shape(loc[q]) or not cells:
                continue
            here, there = np.array([loc[q][c] for c in cells])[:, None], np.array([loc[u][c] for c in cells])
            each += [np.mean((here > there) + 0.5 * (here == there))] * times[u]
        if each:
            scores += [sum(each) / len(each)] * times[q]
    return sum(scores) / len(scores) if scores else None


def fuse(maps, rule):
    """By counting, for every cell, the cells of the pool that are smaller or larger."""
    pools = [[float(v) for cells in detector for v in np.ravel(cells)] for detector in maps]
    fused = []
    for i in range(len(pools[0])):
        if rule == "harmonic":
            ranks = [1 + sum(v < pool[i] for v in pool) for pool in pools]
            fused.append(len(ranks) / sum(Fraction(1, r) for r in ranks))
        elif rule == "reciprocal":
            fused.append(sum(Fraction(1, 1 + sum(v > pool[i] for v in pool)) for pool in pools))
        else:  # p: the share above, the cell itself and its equals counting half
            above = [sum(v > pool[i] for v in pool) + sum(v == pool[i] for v in pool) / 2 for pool in pools]
            p = [count / len(pools[0]) for count in above]
            fused.append(sum(NormalDist().inv_cdf(1 - one) if rule == "stouffer" else -math.log(one) for one in p))
    return fused
