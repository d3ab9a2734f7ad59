"""What a run says of its models."""

import re

import pytest

from fdslam.config import Campus, Compact, Config, Folder, Mask, Mix, Obb, Yolo
from fdslam.models import load_models, out_of_their_world

PHOTOS = Folder(root="photos")


@pytest.mark.parametrize(
    ("config", "keys"),
    [
        (Config(dataset=Campus(), mask=Mask(source="deeplabv3plus")), []),
        (Config(dataset=PHOTOS), ["obb.yolo.weights", "obb.bing.filters"]),
        (Config(dataset=PHOTOS, obb=Obb("J+B"), mask=Mask(source="labels")), []),
        (Config(dataset=PHOTOS, obb=Obb("J+B"), mix=Mix(rows=["CC"])), ["compact.weights"]),
        (Config(dataset=PHOTOS, obb=Obb("J+B"), mix=Mix(rows=["CC"]), compact=Compact(source="gradients")), []),
        (Config(dataset=PHOTOS, obb=Obb("J+B", Yolo(weights="a.onnx")), mix=Mix(rows=["CC"])), []),
        (Config(dataset=PHOTOS, obb=Obb("J+YOLO", Yolo(weights="a.onnx"))), []),
        (
            Config(dataset=PHOTOS, obb=Obb("BING"), mask=Mask(source="deeplabv3plus")),
            ["obb.bing.filters", "mask.weights"],
        ),
    ],
)
def test_shipped_models_on_other_images_than_the_campus_are_told(config, keys):
    line = out_of_their_world(config)
    assert re.findall(r"([a-z.]+)=FILE", line) == keys
    assert bool(line) == bool(keys)
    for group, way in {"obb.": "obb=j_b", "compact.": "compact.source=gradients", "mask.": "mask=none"}.items():
        assert (way in line) == any(key.startswith(group) for key in keys)


def test_models_are_told_apart_by_their_weights():
    config = Config(dataset=Campus(), mask=Mask(source="deeplabv3plus"))
    identity = load_models(config).identity
    assert [source["source"] for source in identity["obb"]] == ["J", "B", "BING", "YOLO"]
    assert all(len(str(one)) > 64 for one in (identity["obb"][3], identity["mask"]))  # digests of their weights
    assert load_models(Config(dataset=Campus())).identity["mask"] is None
