"""Import torchvision where its wheel is built for CUDA and torch is the CPU build.

Such a wheel's compiled operators cannot load, and ``import torchvision`` then ends with "operator torchvision::nms does
not exist", because it describes the operators' shapes to torch at import. Declaring the two operators it names is
enough for everything written in Python (models, transforms, box_iou, datasets). The operators themselves stay missing:
calling ``torchvision.ops.nms`` raises.
"""

from __future__ import annotations

from types import ModuleType

import torch

_declared: list[torch.library.Library] = []  # a library's declarations live as long as the object


def import_torchvision() -> ModuleType:
    """Return the torchvision module; its operators are declared only if the plain import fails for want of them."""
    try:
        import torchvision
    except RuntimeError as error:
        if "torchvision::nms" not in str(error):
            raise
        library = torch.library.Library("torchvision", "DEF")
        library.define("nms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
        library.define("qnms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
        _declared.append(library)
        import torchvision
    return torchvision
