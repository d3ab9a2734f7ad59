"""Slow oracles of anomaly detection: loops over pixels, from the definitions."""

from __future__ import annotations

import math

import numpy as np


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


def cells_of_pixels(pixels, cell):
    """Return the maximum of every cell, one pixel after the other."""
    height, width = pixels.shape
    out = np.full((math.ceil(height / cell), math.ceil(width / cell)), -np.inf)
    for y in range(height):
        for x in range(width):
            out[y // cell, x // cell] = max(out[y // cell, x // cell], pixels[y, x])
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
