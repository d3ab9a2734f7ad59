"""Slow, obvious oracles: the equations as they are written, one loop a symbol. The fast code is held against them."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

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


def mean_rank(values, how):
    if not values:
        return 0.0
    return len(values) / sum(1 / v for v in values) if how == "harmonic" else sum(values) / len(values)


def fault_diagnosis(boxes, ranks, height, width, pooling, order, mean):
    """Eq. 1 pixel by pixel: J[p], the mean of the ranks, the pool over the hypotheses."""
    loc = np.zeros((height, width))
    hypotheses = range(np.shape(ranks)[1])
    for y in range(height):
        for x in range(width):
            inside = [j for j, (x0, y0, x1, y1) in enumerate(boxes) if x0 <= x < x1 and y0 <= y < y1]
            if order == "fuse_then_pool":
                loc[y, x] = pool([mean_rank([ranks[j][h] for j in inside], mean) for h in hypotheses], pooling)
            else:
                loc[y, x] = mean_rank([pool([ranks[j][h] for h in hypotheses], pooling) for j in inside], mean)
    return loc


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
