"""What an autoencoder could not reconstruct (RE), and what makes the RE of one AE comparable with another's (§AD)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import cv2
import numpy as np
import torch
from kornia.filters import spatial_gradient
from kornia.metrics import ssim
from numpy.typing import NDArray
from torch import Tensor

from fdslam.autoencoder.network import network_with
from fdslam.coverage import Coverage, cell_maximum
from fdslam.types import Cells

SIGMA_FLOOR = 1 / 255  # one grey level: a smaller spread of the RE is not measurable in 8-bit images
WINDOW = 11  # taps of SSIM's Gaussian, σ 1.5 pixels (Wang et al. 2004)
HELD_BATCH = 16  # images that go through the network at once where no score depends on it
FIXED_ONE = 1 << 20  # fixed-point 1.0 of a region's z

Statistics = dict[str, tuple[float, float]]  # kind of error -> μ, σ of the RE over all pixels, σ >= SIGMA_FLOOR


def _l1(images: Tensor, outputs: Tensor) -> Tensor:
    return (outputs - images).abs().mean(dim=1)


def _ssim(images: Tensor, outputs: Tensor) -> Tensor:
    return (1 - ssim(images.contiguous(), outputs.contiguous(), WINDOW)).mean(dim=1) / 2


def _gradient(images: Tensor, outputs: Tensor) -> Tensor:
    # Of the difference: the gradient is linear, and ∇I - ∇I' = ∇(I - I').
    return torch.linalg.vector_norm(spatial_gradient(outputs - images), dim=2).mean(dim=1)


ERRORS: dict[str, Callable[[Tensor, Tensor], Tensor]] = {"l1": _l1, "ssim": _ssim, "gradient": _gradient}


def error_map(kind: str, images: Tensor, outputs: Tensor) -> NDArray[np.float32]:
    """Return the RE of reconstructions, averaged over the channels.

    Args:
        kind: ``l1`` |I − I′|; ``ssim`` (1 − SSIM) / 2 (Wang et al. 2004); ``gradient`` |∇I − ∇I′| by Sobel's operator.
        images: [n, 3, h, w] float32 in 0..1.
        outputs: their reconstructions, the same shape and device.

    Returns:
        [n, h, w] float32.
    """
    with torch.no_grad():
        found: NDArray[np.float32] = ERRORS[kind](images, outputs).cpu().numpy()
    return found


def reconstruct(network: Callable[[Tensor], Tensor], images: Tensor, batch: int) -> Tensor:
    """Return the reconstructions [n, 3, h, w] of images on the network's device, ``batch`` at a time."""
    with torch.no_grad():
        parts = [network(part).contiguous() for part in images.split(batch)]
    return torch.cat(parts) if parts else images


def statistics(images: Tensor, outputs: Tensor) -> Statistics:
    """Return mean and standard deviation of every kind of RE over all pixels, the latter at least ``SIGMA_FLOOR``."""
    found = {}
    for kind in ERRORS:
        parts = zip(images.split(HELD_BATCH), outputs.split(HELD_BATCH), strict=True)
        errors = np.concatenate([error_map(kind, *part) for part in parts])
        found[kind] = moments(errors)
    return found


def moments(errors: NDArray[np.float32]) -> tuple[float, float]:
    """Return mean and standard deviation of the RE, the latter at least ``SIGMA_FLOOR``."""
    return float(errors.mean(dtype=np.float64)), max(float(errors.std(dtype=np.float64)), SIGMA_FLOOR)


def reconstruction_error(
    weights: Mapping[str, NDArray[np.float32]], images: Tensor, device: str = "cpu", kind: str = "l1"
) -> NDArray[np.float32]:
    """Return the RE of images under the AE with the given weights (§AD, V_RE at each pixel).

    Images go through one at a time: the last bits of a convolution depend on the batch's size, and a query's score
    must not depend on the queries that come with it.

    Args:
        weights: of ``PlaceModel``.
        images: [n, 3, h, w] float32 in 0..1, of the size that the AE was trained at.
        device: where torch runs.
        kind: of error, as in ``error_map``.

    Returns:
        [n, h, w] float32.

    Raises:
        InputError: the weights belong to another size of input, or are not those of this network.
    """
    network = network_with(weights, (images.shape[2], images.shape[3])).to(device)
    errors = [error_map(kind, one, reconstruct(network, one, 1)) for one in images.to(device).split(1) if len(one)]
    return np.concatenate(errors) if errors else np.empty((0, *images.shape[2:]), dtype=np.float32)


def z_score(error: NDArray[np.float32], mu: float, sigma: float) -> NDArray[np.float32]:
    """Return (RE − μ) / σ, float32, of ``error``'s shape; the caller divides by c, which all AEs share (§AD)."""
    return ((error.astype(np.float64) - mu) / sigma).astype(np.float32)


def _full(error: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    """Return the RE of every pixel of the image: [h, w] resized bilinearly between pixel centres."""
    return np.asarray(cv2.resize(error, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def error_to_cells(error: NDArray[np.float32], height: int, width: int) -> Cells:
    """Return the largest RE or z of every cell of an image of ``height`` × ``width`` pixels (§Performance).

    ``error`` [h, w] float32, at the AE's resolution, is resized bilinearly between pixel centres; a cell takes the
    maximum of its pixels.
    """
    return cell_maximum(_full(error, height, width))


def region_to_cells(
    error: NDArray[np.float32], boxes: NDArray[np.float32], height: int, width: int, outside: float
) -> Cells:
    """Return the paper's region form V_RE(P) on cells: RE or z averaged over each OBB P, painted on P's pixels (§AD).

    A pixel in several OBBs takes the mean of them; sums are fixed-point, so that the order of the OBBs changes nothing.

    Args:
        error: [h, w] float32 at the AE's resolution, resized bilinearly between pixel centres.
        boxes: float32 [J, 4] xyxy pixels, half-open; those without a pixel in the image are left out.
        height: of the image, pixels.
        width: of the image, pixels.
        outside: of a pixel in no OBB.

    Returns:
        float32 [rows, columns], the maximum of a cell's pixels.
    """
    integral = np.zeros((height + 1, width + 1))
    integral[1:, 1:] = _full(error, height, width).cumsum(0, dtype=np.float64).cumsum(1)
    limits = np.array([width, height, width, height])
    corners = np.clip(np.ceil(boxes), 0, limits).astype(np.int64)
    size = corners[:, 2:] - corners[:, :2]
    some = (size > 0).all(axis=1)
    x0, y0, x1, y1 = corners[some].T
    total = integral[y1, x1] - integral[y0, x1] - integral[y1, x0] + integral[y0, x0]
    mean = np.rint(total / size[some].prod(axis=1) * FIXED_ONE).astype(np.int64)
    coverage = Coverage(boxes[some], height, width)
    covered = coverage.paint(np.ones(len(mean), np.int64))
    blocks = np.divide(
        coverage.paint(mean), FIXED_ONE * covered, out=np.full(covered.shape, outside), where=covered > 0
    )
    return coverage.cells(blocks).astype(np.float32)
