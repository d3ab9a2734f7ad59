import pytest
import torch

from fdslam.torchvision_compat import import_torchvision


def test_models_and_transforms_work():
    import_torchvision()
    from torchvision.models import mobilenet_v3_small
    from torchvision.ops import box_iou
    from torchvision.transforms.v2.functional import resize

    out = mobilenet_v3_small(weights=None).eval()(torch.zeros(1, 3, 64, 64))
    assert out.shape == (1, 1000)
    assert resize(torch.zeros(3, 8, 8), [4, 4]).shape == (3, 4, 4)
    boxes = torch.tensor([[0.0, 0, 2, 2], [1, 0, 3, 2]])
    assert box_iou(boxes, boxes)[0, 1] == pytest.approx(1 / 3)


def test_importing_twice_gives_the_same_module():
    assert import_torchvision() is import_torchvision()
