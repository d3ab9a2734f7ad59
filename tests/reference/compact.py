"""Slow, obvious oracles of the compact map: one loop a symbol."""

import math

import numpy as np

from tests.reference import hamming


def centre(grid, row, col):
    """Where a cell of a grid lies, pixels x and y."""
    return (col + 0.5) * grid.step_x, (row + 0.5) * grid.step_y


def displaced(query, image, grid, at, reach):
    """For every whole displacement within reach of the nearest descriptor: distances, None where the image ends."""
    rows, cols, _ = query.shape
    down, across = (math.ceil(round(reach / step, 6)) for step in (grid.step_y, grid.step_x))
    for dy in range(-down, down + 1):
        for dx in range(-across, across + 1):
            found = []
            for i, (x, y) in enumerate(np.asarray(at, float).tolist()):
                row, col = round(y / grid.step_y - 0.5) + dy, round(x / grid.step_x - 0.5) + dx
                there = 0 <= row < image.shape[0] and 0 <= col < image.shape[1]
                found.append(hamming(query[i // cols, i % cols], image[row, col]) if there else None)
            yield [found[cols * row : cols * (row + 1)] for row in range(rows)]


def smallest(query, image, grid, at, reach, sigma, nowhere):
    """The smallest distance of each descriptor, alone, and averaged over the cells around at equal displacements."""
    rows, cols, _ = query.shape
    alone, supported = np.full((rows, cols), nowhere), np.full((rows, cols), nowhere)
    far = round(8 * sigma + 1) // 2  # of the window, cells
    for distance in displaced(query, image, grid, at, reach):
        for row in range(rows):
            for col in range(cols):
                if distance[row][col] is None:
                    continue
                total = weights = 0.0
                for y in range(max(0, row - far), min(rows, row + far + 1)):
                    for x in range(max(0, col - far), min(cols, col + far + 1)):
                        if distance[y][x] is not None:
                            weight = math.exp(-((y - row) ** 2 + (x - col) ** 2) / (2 * sigma**2))
                            total, weights = total + weight * distance[y][x], weights + weight
                alone[row, col] = min(alone[row, col], distance[row][col])
                supported[row, col] = min(supported[row, col], total / weights)
    return alone, supported


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
