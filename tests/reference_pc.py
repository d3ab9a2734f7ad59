"""Slow and obvious pairwise comparison: float64, full resolution, one loop per sentence of the definition."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fdslam.config import Keypoints
from fdslam.types import CELL, Image


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
