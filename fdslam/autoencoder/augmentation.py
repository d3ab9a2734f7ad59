"""What a training image may look like another time: a small shift, and other light (§AD).

kornia's functions do the work with parameters drawn here, from the generator of the network that is trained: what an
image becomes depends on that network alone, never on what is in a batch beside it. (kornia.augmentation's classes draw
from torch's global generator, and cost a fifth of a training step instead of an eighth.)
"""

from __future__ import annotations

import torch
from kornia.enhance import adjust_brightness, adjust_contrast, adjust_gamma
from kornia.geometry.transform import translate
from torch import Tensor

SHIFT = 1  # pixels of the AE's input; largest shift
LIGHT = 0.15  # strength of the change of light
DARKEST = 1e-3  # the power of a zero would stay zero


def draw(count: int, generator: torch.Generator) -> Tensor:
    """Return the parameters of ``count`` images, [count, 5] float32 on the CPU, from a CPU generator.

    Columns: shift to the right and down in whole pixels, and three numbers in -1..1 for gamma, contrast, brightness.
    """
    shift = torch.randint(-SHIFT, SHIFT + 1, (count, 2), generator=generator)
    return torch.cat([shift, 2 * torch.rand(count, 3, generator=generator) - 1], dim=1)


def augment(images: Tensor, parameters: Tensor) -> Tensor:
    """Shift images by whole pixels and change gamma, contrast and brightness by up to ``LIGHT``.

    No mirroring: places are not symmetric.

    Args:
        images: [n, 3, h, w] float32 in 0..1; they stay as they are.
        parameters: [n, 5] of ``draw``.

    Returns:
        [n, 3, h, w] float32 in 0..1; what a shift uncovers repeats the border.
    """
    parameters = parameters.to(images.device)
    gamma, contrast, brightness = (LIGHT * parameters[:, 2:]).unbind(1)
    # Whole pixels and the nearest neighbour: interpolation would blur what the AE is to learn.
    shifted = translate(images, parameters[:, :2], mode="nearest", padding_mode="border", align_corners=False)
    lit = adjust_gamma(shifted.clamp_(min=DARKEST), torch.exp(3 * gamma))
    # Contrast about the middle grey: (x - 1/2) (1 + contrast) + 1/2.
    lit = adjust_contrast(lit, 1 + contrast, clip_output=False)
    return adjust_brightness(lit, (brightness - contrast) / 2)
