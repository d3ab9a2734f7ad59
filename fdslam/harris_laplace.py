"""Harris-Laplace keypoints and the SIFT descriptors at them (§PC)."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.config import Keypoints
from fdslam.types import Image

Plane = NDArray[np.float32]  # [h, w] of one pyramid level
_Later = Callable[[], Any]  # gives what another thread may be at

DERIVATION = 0.7  # σ_D / σ_I
# Grey levels⁴. A right-angled corner of c grey levels reaches c⁴ / 1100: below one grey level there is only rounding.
FLOOR = 1e-3
# A scale is computed on the image halved until σ_D would span under LEVEL_SIGMA pixels; a halved image is blurred to
# LEVEL_BLUR of its own pixels first, against aliasing. With LEVEL_SIGMA 2 the few differences from full resolution (one
# keypoint in thirty, mostly at the finest scale of a level) shrink to one in a hundred, for a third more time.
LEVEL_SIGMA = 1.4
LEVEL_BLUR = 1.0
STRIP = 192  # rows
REACH = 3.5  # of a kernel, in σ: one keypoint in a hundred differs from a far longer one's; at 3 one in fifteen

# Sixth order, like the interpolation: a lower one damps a level's finest scale, which then loses to its neighbours.
SECOND = np.array([2, -27, 270, -490, 270, -27, 2], np.float32) / 180
LAPLACE = np.zeros((7, 7), np.float32)
LAPLACE[3, :] += SECOND
LAPLACE[:, 3] += SECOND
BEFORE = ((-1, -1), (-1, 0), (-1, 1), (0, -1))  # (row, column) steps to the neighbours earlier in reading order
STEPS = np.arange(-3, 4)  # of SECOND
KNOTS = np.arange(-2, 4)  # of the interpolation: pixels from the one at the upper left

SIFT_SIGMA, SIFT_LAYERS = 1.6, 3  # Lowe's values


@dataclass(frozen=True)
class HarrisLaplace:
    """Keypoints of one image, strongest first."""

    xy: NDArray[np.float32]  # [n, 2] pixels: whole numbers, the pixel's column and row
    scale: NDArray[np.float32]  # [n] σ_I, pixels
    response: NDArray[np.float32]  # [n] scale-normalised det - k tr², grey levels⁴


def harris_laplace(image: Image, config: Keypoints, threads: int = 1) -> HarrisLaplace:
    """Find the corners of an image that have a scale of their own.

    A pixel is a keypoint at scale σ_I if (a) the scale-normalised Harris response det M - k tr² M with
    M = σ_D² G(σ_I) * ∇L(σ_D) ∇L(σ_D)ᵀ, σ_D = 0.7 σ_I, is above ``FLOOR`` and the largest among its 8 neighbours and
    (b) σ_I² |LoG| is larger there than at the next finer and the next coarser scale. Scales are sigma · scale_stepⁿ,
    the two outermost only compared with. Coarse scales are computed on a pyramid; a maximum there is placed by a
    quadric and rounded to a pixel. Corners within σ_I of the border are left out: the mirrored border makes its own.

    Args:
        image: uint8 RGB ``[H, W, 3]``; any size, too small ones have no keypoint.
        config: scales, k, and how many keypoints to keep.
        threads: that filter the scales. Never changes a result.

    Returns:
        At most ``config.keypoints`` keypoints by falling response; ties by row, column, scale.

    Source: Mikolajczyk & Schmid, "Indexing based on scale invariant interest points" (2001) and "Scale & affine
    invariant interest point detectors" (2004); the paper's §PC.
    """
    height, width = image.shape[:2]
    sigmas = [config.sigma * config.scale_step**n for n in range(config.scales)]
    levels = [max(math.floor(math.log2(DERIVATION * s / LEVEL_SIGMA)), 0) for s in sigmas]
    last = sum(2 * s < min(height, width) for s in sigmas)  # from here on no pixel is σ_I off the border
    pyramid = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)]
    tried = range(1, min(config.scales - 1, last))
    laplacian, peaks = _Laplacian(sigmas, levels), dict[int, _Later]()
    found = np.empty((0, 4), np.float32)  # x, y, scale, value of the strongest so far
    with ThreadPoolExecutor(threads) as pool:
        begin = partial(_begin, pool if threads > 1 else None)
        for n in range(tried.stop + 1) if tried else ():  # other threads filter one level while the next is made
            while len(pyramid) <= levels[n]:
                pyramid.append(_halved(pyramid[-1], len(pyramid) - 1))
            plane, sigma, blur = pyramid[levels[n]], sigmas[n] / 2 ** levels[n], _blur(levels[n])
            if n in tried:
                peaks[n] = begin(_peaks, plane, sigma, blur, config.harris_k, levels[n])
            laplacian.later[n] = begin(_filtered, plane, sigma, blur, levels[n])
        for n in tried:
            sigma, (x, y, value) = sigmas[n], peaks.pop(n)()
            keep = (np.minimum(x, y) >= sigma) & (x <= width - 1 - sigma) & (y <= height - 1 - sigma)
            if len(found) == config.keypoints:
                keep &= value >= found[-1, 3]  # weaker ones would be left out in the end
            x, y, value = x[keep], y[keep], value[keep]
            here = np.abs(laplacian.at(n, x, y))
            for i in (n - 1, n + 1):
                keep = here > np.abs(laplacian.at(i, x, y))
                x, y, value, here = x[keep], y[keep], value[keep], here[keep]
            laplacian.forget(n - 1)
            found = np.concatenate([found, np.stack([x, y, np.full_like(x, sigma), value], axis=1)])
            x, y, scale, value = found.T
            found = found[np.lexsort((scale, x, y, -value))[: config.keypoints]]
    return HarrisLaplace(found[:, :2].copy(), found[:, 2].copy(), found[:, 3].copy())


def sift(image: Image, keypoints: HarrisLaplace) -> NDArray[np.float32]:
    """Describe keypoints by upright SIFT: a robot's camera does not roll, and a free angle only adds ways to match.

    Args:
        image: uint8 RGB ``[H, W, 3]``, the one the keypoints are of.
        keypoints: n of them.

    Returns:
        float32 ``[n, 128]`` in the keypoints' order; whole numbers 0 to 255, norm about 512; not RootSIFT.

    Raises:
        RuntimeError: OpenCV did not describe every keypoint.

    Source: Lowe, "Distinctive image features from scale-invariant keypoints" (2004), §6; OpenCV's implementation.
    """
    count = len(keypoints.scale)
    if count == 0:
        return np.empty((0, 128), np.float32)
    octave = {s: _octave(s) for s in set(keypoints.scale.tolist())}
    given = [
        cv2.KeyPoint(x, y, 2 * s, 0.0, 0.0, octave[s], i)
        for i, ((x, y), s) in enumerate(zip(keypoints.xy.tolist(), keypoints.scale.tolist(), strict=True))
    ]
    extractor = cv2.SIFT.create(nOctaveLayers=SIFT_LAYERS, sigma=SIFT_SIGMA)
    kept, descriptors = extractor.compute(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), given)
    # OpenCV promises neither the order nor the number of what comes back.
    ids = [k.class_id for k in kept]
    if sorted(ids) != list(range(count)):
        raise RuntimeError(f"OpenCV described {len(ids)} of {count} keypoints")
    out = np.empty((count, 128), np.float32)
    out[ids] = descriptors
    return out


def _octave(sigma: float) -> int:
    """Return OpenCV's packed octave and layer of the SIFT pyramid's image whose blur is nearest to ``sigma`` pixels."""
    step = round(SIFT_LAYERS * math.log2(sigma / SIFT_SIGMA))
    octave = max((step - 1) // SIFT_LAYERS, -1)  # layers 1 to 3, as the detector numbers them; -1: the doubled image
    return (octave & 255) | max(step - SIFT_LAYERS * octave, 0) << 8


def _blur(level: int) -> float:
    """Return the σ that a pyramid level already has, in its own pixels."""
    return LEVEL_BLUR if level else 0.0


def _begin(pool: ThreadPoolExecutor | None, work: Callable, *given: object) -> _Later:
    """Begin something in another thread; without one it is done when its result is asked for."""
    return partial(work, *given) if pool is None else pool.submit(work, *given).result


def _halved(plane: Plane, level: int) -> Plane:
    """Return the level after a pyramid's ``level``; its pixel i is pixel 2i of this one."""
    return np.ascontiguousarray(_gaussian(plane, 2 * LEVEL_BLUR, _blur(level))[::2, ::2])


def _kernels(sigma: float) -> tuple[Plane, Plane]:
    """Return a Gaussian kernel and its derivative; cut and sampled as it is, the first's deviation is ``sigma``."""
    reach = max(math.ceil(REACH * sigma), 1)
    x = np.arange(-reach, reach + 1)
    wide = sigma
    for _ in range(4):
        weight = np.exp(-0.5 * (x / wide) ** 2)
        variance = (x**2 * weight).sum() / weight.sum()
        wide *= sigma / math.sqrt(variance)
    weight /= weight.sum()
    return weight.astype(np.float32), (x * weight / variance).astype(np.float32)  # the latter exact on a ramp


def _gaussian(plane: Plane, sigma: float, already: float = 0.0) -> Plane:
    """Return a plane of blur ``already`` at the blur ``sigma`` (both in its pixels)."""
    smooth, _ = _kernels(math.sqrt(sigma**2 - already**2))
    return cv2.sepFilter2D(plane, cv2.CV_32F, smooth, smooth)  # type: ignore[return-value]


def _filtered(plane: Plane, sigma: float, already: float, level: int) -> Plane:
    """Return a pyramid level at the blur ``sigma`` (both in its pixels), or of a coarse one σ² (Lxx + Lyy) of that."""
    smooth = _gaussian(plane, sigma, already)
    return cv2.filter2D(smooth, cv2.CV_32F, sigma**2 * LAPLACE) if level else smooth  # type: ignore[return-value]


class _Laplacian:
    """σ² (Lxx + Lyy) of one image at its scales, at single pixels."""

    def __init__(self, sigmas: list[float], levels: list[int]) -> None:
        self.sigmas, self.levels = sigmas, levels
        self.later: dict[int, _Later] = {}  # per scale: what gives its plane
        self.planes: dict[int, Plane] = {}  # per scale: blurred or, at a coarse level, the Laplacian

    def _plane(self, n: int) -> Plane:
        if n not in self.planes:
            self.planes[n] = self.later.pop(n)()
        return self.planes[n]

    def at(self, n: int, x: Plane, y: Plane) -> Plane:
        """Return the values at scale ``n`` at pixels of the image (whole numbers)."""
        plane, level = self._plane(n), self.levels[n]
        if level:
            return _interpolated(plane, x / 2**level, y / 2**level)
        # At full resolution the pixels asked for are few beside all.
        height, width = plane.shape
        rows, columns = (_mirrored(v.astype(int) + STEPS[:, None], end) for v, end in ((y, height), (x, width)))
        middle = len(STEPS) // 2
        sides = plane.take(rows * width + columns[middle]) + plane.take(rows[middle] * width + columns)
        return np.float32(self.sigmas[n] ** 2) * np.einsum("i,ij->j", SECOND, sides)

    def forget(self, n: int) -> None:
        """Let go of a scale that is not asked for again."""
        self.planes.pop(n, None)


def _mirrored(index: NDArray[np.int64], length: int) -> NDArray[np.int64]:
    """Return indices, reflected at either end as OpenCV's filters do; they lie within ``length`` of it."""
    return length - 1 - np.abs(length - 1 - np.abs(index))


def _harris(plane: Plane, sigma: float, already: float, k: float) -> Plane:
    """Return det M - k tr² M of the scale-normalised second-moment matrix at integration scale ``sigma``.

    ``STRIP`` rows at a time: what is between the plane and its response then stays in the processor's cache.
    """
    smooth, slope = _kernels(math.sqrt((DERIVATION * sigma) ** 2 - already**2))
    slope *= DERIVATION * sigma
    wide, _ = _kernels(sigma)
    height, width = plane.shape
    work = [np.empty((STRIP + len(wide) + len(smooth), width), np.float32) for _ in range(5)]
    response = np.empty_like(plane)
    for begin in range(0, height, STRIP):
        end = min(begin + STRIP, height)
        top, bottom = max(begin - len(wide) // 2, 0), min(end + len(wide) // 2, height)  # rows that the blur reads
        first, last = max(top - len(smooth) // 2, 0), min(bottom + len(smooth) // 2, height)  # and the derivatives
        strip, inner = plane[first:last], slice(top - first, bottom - first)
        a, b, c, d, e = (array[: last - first] for array in work)
        dx = cv2.sepFilter2D(strip, cv2.CV_32F, slope, smooth, dst=a)[inner]
        dy = cv2.sepFilter2D(strip, cv2.CV_32F, smooth, slope, dst=b)[inner]
        c, d, e = (array[: bottom - top] for array in (c, d, e))
        products = cv2.multiply(dx, dy, dst=c), cv2.multiply(dx, dx, dst=dx), cv2.multiply(dy, dy, dst=dy)
        rows = slice(begin - top, end - top)
        targets = zip(products, (d, c, e), strict=True)  # c has been read when it is written
        xy, xx, yy = (cv2.sepFilter2D(one, cv2.CV_32F, wide, wide, dst=to)[rows] for one, to in targets)
        det = cv2.multiply(xx, yy, dst=response[begin:end])
        cv2.subtract(det, cv2.multiply(xy, xy, dst=xy), dst=det)
        trace = cv2.add(xx, yy, dst=xx)
        cv2.subtract(det, cv2.multiply(trace, trace, dst=trace, scale=k), dst=det)
    return response


def _peaks(plane: Plane, sigma: float, already: float, k: float, level: int) -> tuple[Plane, Plane, Plane]:
    """Return the maxima of a pyramid level's response at the scale ``sigma`` (in its pixels), as ``_maxima``."""
    return _maxima(_harris(plane, sigma, already, k), level)


def _maxima(response: Plane, level: int) -> tuple[Plane, Plane, Plane]:
    """Return x, y (whole pixels of the image) and value of the inner 8-neighbour maxima above ``FLOOR``.

    A coarse level's are placed between its pixels by the quadric through their 3 × 3 neighbourhood.
    """
    peak = response >= cv2.dilate(response, np.ones((3, 3), np.uint8))
    peak[[0, -1]] = False
    peak[:, [0, -1]] = False
    index = np.flatnonzero(peak)
    row, column = np.divmod(index[response.ravel()[index] > FLOOR], response.shape[1])
    # A corner half-way between pixels has equal ones: the first in reading order stands for them.
    first = response[row, column] > np.max([response[row + i, column + j] for i, j in BEFORE], axis=0)
    row, column = row[first], column[first]
    value = response[row, column]
    if level == 0:
        return column.astype(np.float32), row.astype(np.float32), value
    at = {(i, j): response[row + i, column + j] for i in (-1, 0, 1) for j in (-1, 0, 1)}
    dx, dy = (at[0, 1] - at[0, -1]) / 2, (at[1, 0] - at[-1, 0]) / 2
    xx, yy = at[0, 1] + at[0, -1] - 2 * value, at[1, 0] + at[-1, 0] - 2 * value
    xy = (at[1, 1] + at[-1, -1] - at[1, -1] - at[-1, 1]) / 4
    det = xx * yy - xy**2
    det[det <= 0] = np.inf  # a ridge: stay on the pixel
    right, down = np.clip((xy * dy - yy * dx) / det, -0.5, 0.5), np.clip((xy * dx - xx * dy) / det, -0.5, 0.5)
    x, y = np.round((column + right) * 2**level), np.round((row + down) * 2**level)
    return x.astype(np.float32), y.astype(np.float32), value + (dx * right + dy * down) / 2


def _interpolated(plane: Plane, x: Plane, y: Plane) -> Plane:
    """Return a plane's values between its pixels by Lagrange's polynomial through 6 × 6 of them."""
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    height, width = plane.shape
    columns = np.clip(left + KNOTS[:, None], 0, width - 1)
    rows = np.clip(top + KNOTS[:, None], 0, height - 1)
    near = plane.take(rows[:, None] * width + columns)  # [6, 6, n]
    return np.einsum("in,ijn,jn->n", _lagrange(y - top), near, _lagrange(x - left))


def _lagrange(t: Plane) -> Plane:
    """Return the weights ``[6, n]`` of ``KNOTS`` at ``0 <= t < 1``."""
    return np.stack([np.prod([(t - j) / (i - j) for j in KNOTS if j != i], axis=0) for i in KNOTS]).astype(np.float32)
