"""Slow, obvious oracles of the compact map: one loop a symbol."""

import math

import numpy as np

from tests.reference import hamming


def centre(grid, row, col):
    """Where a cell of a grid lies, pixels x and y."""
    return (col + 0.5) * grid.step_x, (row + 0.5) * grid.step_y


def around(query, image, grid, at, reach, nowhere):
    """The smallest and the mean distance of each descriptor to those whose centres are within reach in x and in y."""
    rows, cols, _ = query.shape
    smallest, mean = np.full((rows, cols), nowhere), np.zeros((rows, cols))
    for i, (x, y) in enumerate(np.asarray(at, float).tolist()):
        found = []
        for row in range(image.shape[0]):
            for col in range(image.shape[1]):
                u, v = centre(grid, row, col)
                # What lies at exactly the reach counts, whatever rounding makes of it.
                if abs(u - x) <= reach + 1e-6 and abs(v - y) <= reach + 1e-6:
                    found.append(hamming(query[i // cols, i % cols], image[row, col]))
        if found:
            smallest[i // cols, i % cols] = min(found)
            mean[i // cols, i % cols] = sum(found) / len(found)
    return smallest, mean


def gaussian_sum(at, points, sigma):
    """How many points are around a place, each weighted by a Gaussian."""
    return sum(math.exp(-((x - at[0]) ** 2 + (y - at[1]) ** 2) / (2 * sigma**2)) for x, y in points)


def signs(values, mean, turn):
    """The bits of every descriptor as a list, one for every word of 64: the first bit is the highest of the byte."""
    rows, cols, channels = values.shape
    result = []
    for row in range(rows):
        for col in range(cols):
            centred = [float(values[row, col, c]) - float(mean[c]) for c in range(channels)]
            if turn is not None:
                centred = [sum(centred[c] * float(turn[c, b]) for c in range(channels)) for b in range(turn.shape[1])]
            result.append([value > 0 for value in centred])
    return result


def log_odds(model, row):
    """The decision of scikit-learn's trees for one row, node by node."""
    total = float(np.ravel(model._baseline_prediction)[0])
    for [tree] in model._predictors:
        node = tree.nodes[0]
        while not node["is_leaf"]:
            node = tree.nodes[node["left"] if row[node["feature_idx"]] <= node["num_threshold"] else node["right"]]
        total += float(node["value"])
    return total


def packed(words, first):
    """Which of an image's words are the next of those born with it, and the others in their order."""
    following, born, older = first, [], []
    for word in words:
        born.append(word == following)
        if word == following:
            following += 1
        else:
            older.append(word)
    return born, older
