"""The models that can be fetched: where their makers publish them, under which terms, and what is known of the files.

No sha256 is listed that was not computed from the published file itself. Where a file's name carries the first digits
of it, as its makers' publishing script does, those are checked.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Published:
    """A file that its makers publish."""

    summary: str
    url: str
    page: str  # where the makers name that address
    licence: str
    use: str  # what to do with it; {path} is where it lies
    sha256: str = ""  # "": nobody could verify it
    begins: str = ""  # published first digits of the sha256
    onnx: bool = True


_YOLOX = "https://github.com/Megvii-BaseDetection/YOLOX"
_MMSEG = "https://download.openmmlab.com/mmsegmentation/v0.5/deeplabv3plus"
_MMSEG_PAGE = "https://github.com/open-mmlab/mmsegmentation/tree/main/configs/deeplabv3plus"
_MMSEG_LICENCE = "Apache-2.0 (OpenMMLab); trained on {data}, whose own terms allow {terms}"


def _yolox(size: str, what: str) -> Published:
    return Published(
        f"YOLOX-{size}, {what}: a detector of the 80 classes of COCO",
        f"{_YOLOX}/releases/download/0.1.1rc0/yolox_{size}.onnx",
        f"{_YOLOX}/tree/main/demo/ONNXRuntime",
        "Apache-2.0 (Megvii); trained on COCO",
        "run with obb=j_b_yolo obb.yolo.weights={path}",
    )


MODELS: dict[str, Published] = {
    "yolox-nano": _yolox("nano", "0.9 M parameters, 416×416"),
    "yolox-tiny": _yolox("tiny", "5.1 M parameters, 416×416"),
    "yolox-s": _yolox("s", "9.0 M parameters, 640×640"),
    "deeplabv3plus-cityscapes": Published(
        "DeepLabV3+, ResNet-50, the 19 classes of Cityscapes: a PyTorch checkpoint, to be converted to ONNX",
        f"{_MMSEG}/deeplabv3plus_r50-d8_512x1024_40k_cityscapes/"
        "deeplabv3plus_r50-d8_512x1024_40k_cityscapes_20200605_094610-d222ffcd.pth",
        _MMSEG_PAGE,
        _MMSEG_LICENCE.format(data="Cityscapes", terms="no commercial use"),
        "{path} is a PyTorch checkpoint, which fdslam never opens: convert it to ONNX with MMDeploy (docs/models.md), "
        "then run with mask=deeplabv3plus mask.weights=FILE mask.label_map=cityscapes19 mask.normalise=imagenet",
        begins="d222ffcd",
        onnx=False,
    ),
    "deeplabv3plus-ade20k": Published(
        "DeepLabV3+, ResNet-50, 150 classes of ADE20K: a PyTorch checkpoint, to be converted to ONNX",
        f"{_MMSEG}/deeplabv3plus_r50-d8_512x512_80k_ade20k/"
        "deeplabv3plus_r50-d8_512x512_80k_ade20k_20200614_185028-bf1400d8.pth",
        _MMSEG_PAGE,
        _MMSEG_LICENCE.format(data="ADE20K", terms="research and education"),
        "{path} is a PyTorch checkpoint, which fdslam never opens: convert it to ONNX with MMDeploy (docs/models.md), "
        "then run with mask=deeplabv3plus mask.weights=FILE mask.label_map=custom and the numbers of its classes",
        begins="bf1400d8",
        onnx=False,
    ),
}
