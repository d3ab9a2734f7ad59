"""Models whose classes are painted in shades of red; and a real one where it is there."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from fdslam import onnx_model
from fdslam.config import Mask
from fdslam.data.images import read_image
from fdslam.errors import InputError
from fdslam.segmentation import NORMALISATIONS, Segmentation
from fdslam.segmentation.label_maps import ADE20K_32, CITYSCAPES_19, LABEL_MAPS, labels_of
from fdslam.types import LABELS
from tests.onnx_models import constant, painter

SHARED = Path(__file__).parents[3] / "shared" / "data"
ADE20K = SHARED / "models" / "deeplabv3plus_mnv2_ade20k32_512.onnx"
SKY, GROUND, BUILDING, VEGETATION, OBJECT = range(5)


def asked(path, **changes):
    return Mask("deeplabv3plus", weights=str(path), **{"normalise": "unit", **changes})


def shades(classes, grid):
    """Return an image whose blocks of 8×8 pixels are of the classes in ``grid``."""
    image = np.zeros((*(8 * np.array(grid.shape)), 3), np.uint8)
    image[..., 0] = np.kron(np.rint(grid * 255 / (classes - 1)), np.ones((8, 8)))
    return image


@pytest.mark.parametrize("kind", ["planar", "last", "numbers", "numbers4"])
@pytest.mark.parametrize("name", LABEL_MAPS)
def test_every_class_of_every_label_map_in_every_output(kind, name, tmp_path):
    classes = len(LABEL_MAPS[name])
    grid = np.random.default_rng(0).permutation(np.resize(np.arange(classes), 64)).reshape(8, 8)
    path = painter(tmp_path / "m.onnx", classes, kind=kind)
    found = Segmentation(asked(path, label_map=name)).labels(shades(classes, grid))
    assert found.dtype == np.uint8
    assert np.array_equal(found, np.kron(labels_of(LABEL_MAPS[name])[grid], np.ones((8, 8), np.uint8)))


def test_what_is_sky_and_ground():
    sky, ground = LABELS.index("sky"), LABELS.index("ground")
    assert np.flatnonzero(np.isin(labels_of(ADE20K_32), (sky, ground))).tolist() == [3, 4, 7, 10, 12, 14, 30]
    assert np.flatnonzero(labels_of(CITYSCAPES_19) == ground).tolist() == [0, 1, 9]
    assert np.flatnonzero(labels_of(CITYSCAPES_19) == sky).tolist() == [10]
    assert labels_of(LABELS).tolist() == list(range(5))
    assert (len(set(ADE20K_32)), len(set(CITYSCAPES_19))) == (32, 19)


def slow(logits, labels, size):
    """Each label's best logit, brought to the size plane by plane, and the largest of them wins."""
    planes = {}
    for label, plane in zip(labels, logits, strict=True):
        planes[label] = np.maximum(planes[label], plane) if label in planes else plane
    names = sorted(planes)
    full = [cv2.resize(planes[label], size, interpolation=cv2.INTER_LINEAR) for label in names]
    return np.array(names)[np.argmax(full, axis=0)]


@pytest.mark.parametrize("size", [(61, 47), (64, 64), (200, 133)])
def test_coarse_logits_are_brought_to_the_image_s_size(size, tmp_path):
    model = Segmentation(asked(painter(tmp_path / "m.onnx", 19, factor=4)))
    image = np.random.default_rng(1).integers(0, 256, (*size, 3)).astype(np.uint8)
    [logits] = model.model.run(model._entering(image))
    assert logits.shape == (1, 19, 16, 16)
    found = model.labels(image)
    assert np.array_equal(found, slow(logits[0], labels_of(CITYSCAPES_19), size[::-1]))
    assert len(np.unique(found)) >= 3
    # At the output's own size the winner of all classes is the winner of its label.
    winner = labels_of(CITYSCAPES_19)[logits[0].argmax(axis=0)]
    assert np.array_equal(slow(logits[0], labels_of(CITYSCAPES_19), (16, 16)), winner)


def test_the_first_of_equals_wins(tmp_path, monkeypatch):
    model = Segmentation(asked(painter(tmp_path / "m.onnx", 5), label_map="campus"))
    rng = np.random.default_rng(2)
    coarse = rng.integers(-1, 2, (1, 5, 6, 4)).astype(np.float32)  # many ties, also between pixels
    monkeypatch.setattr(type(model.model), "run", lambda *_: [coarse])
    found = model.labels(np.zeros((90, 52, 3), np.uint8))
    assert found.dtype == np.uint8
    assert np.array_equal(found, slow(coarse[0], np.arange(5), (52, 90)))


def test_coarse_numbers_are_brought_there_by_the_nearest(tmp_path):
    """Between sky (0) and object (4) lies no ground: numbers are names and cannot be mixed."""
    model = Segmentation(asked(painter(tmp_path / "m.onnx", 5, kind="numbers", factor=8), label_map="campus"))
    grid = np.indices((8, 8)).sum(axis=0) % 2 * 4
    found = model.labels(shades(5, grid))
    assert np.array_equal(found, np.kron(grid, np.ones((8, 8), int)))


def test_names_say_what_the_classes_are(tmp_path):
    names = ["Object", "Ground", "Sky"]
    path = painter(tmp_path / "m.onnx", 3, metadata={"names": str(names)})
    model = Segmentation(asked(path))
    assert model.labels_of_classes.tolist() == [OBJECT, GROUND, SKY]
    path = painter(tmp_path / "m.onnx", 3, kind="numbers", metadata={"names": str(dict(enumerate(names)))})
    assert np.unique(Segmentation(asked(path)).labels(shades(3, np.full((8, 8), 1)))).tolist() == [GROUND]


@pytest.mark.parametrize("kind", ["planar", "numbers"])
def test_classes_by_number(kind, tmp_path):
    path = painter(tmp_path / "m.onnx", 150, kind=kind)
    model = Segmentation(asked(path, label_map="custom", sky=[2], ground=[3, 6]))
    found = model.labels(shades(150, np.resize([2, 3, 6, 149], 64).reshape(8, 8)))
    assert found[::8, ::8].ravel().tolist() == [SKY, GROUND, GROUND, OBJECT] * 16


def test_normalisation_and_channels_as_told_or_as_the_model_says(tmp_path):
    image = np.zeros((64, 64, 3), np.uint8)
    image[..., 2] = 255  # blue: the last class to a model that takes it for red
    path = painter(tmp_path / "m.onnx", 5)
    assert (Segmentation(asked(path)).labels(image) == SKY).all()
    assert (Segmentation(asked(path, channels="bgr")).labels(image) == OBJECT).all()
    says = {"fdslam.mean": "0 0 0", "fdslam.std": "255 255 255", "fdslam.channels": "bgr"}
    told = Segmentation(asked(painter(path, 5, metadata=says), normalise="auto"))
    assert (told.labels(image) == OBJECT).all()
    assert told.identity == Segmentation(asked(path, channels="bgr")).identity
    plain = Segmentation(asked(painter(path, 5), normalise="auto"))
    assert (plain.mean.tolist(), plain.std.tolist()) == ([128] * 3, [128] * 3)
    value = np.full((64, 64, 3), [250, 100, 3], np.uint8)
    for name, (mean, std) in NORMALISATIONS.items():
        entering = Segmentation(asked(path, normalise=name))._entering(value)
        assert np.allclose(entering, (np.array([250, 100, 3]) - mean) / std, atol=1e-5)


def test_any_input_size(tmp_path):
    path = painter(tmp_path / "m.onnx", 5, free=True)
    model = Segmentation(asked(path, side=96))
    assert (model.height, model.width) == (96, 96)
    assert model.labels(np.full((40, 70, 3), 255, np.uint8)).shape == (40, 70)
    wide = Segmentation(asked(painter(tmp_path / "w.onnx", 5, height=32, width=96)))
    assert (wide.labels(np.full((50, 50, 3), 255, np.uint8)) == OBJECT).all()


def test_identity_is_what_decides_and_nothing_else(tmp_path):
    path = painter(tmp_path / "m.onnx", 5)
    plain = Segmentation(asked(path)).identity
    for same in ({"threads": 2}, {"channels": "rgb"}, {"label_map": "campus"}, {"side": 96}, {"min_share": 0.3}):
        assert Segmentation(asked(path, **same)).identity == plain
    for other in ({"channels": "bgr"}, {"normalise": "raw"}, {"label_map": "custom", "sky": [1]}):
        assert Segmentation(asked(path, **other)).identity != plain


@pytest.mark.parametrize(
    ("make", "changes", "said"),
    [
        (lambda p: painter(p, 21), {}, "puts out 21 classes and does not say what they are; choose mask.label_map of"),
        (lambda p: painter(p, 21), {"label_map": "cityscapes19"}, "21 classes, mask.label_map=cityscapes19 has 19"),
        (lambda p: painter(p, 19), {"label_map": "ade20k32"}, "19 classes, mask.label_map=ade20k32 has 32"),
        (lambda p: painter(p, 5, kind="numbers"), {}, "puts out numbers of classes and does not say"),
        (lambda p: painter(p, 3), {"label_map": "custom"}, r"say which classes are meant with mask\.sky"),
        (lambda p: painter(p, 3), {"label_map": "custom", "sky": [3]}, "class 3 is not among the model's 3"),
        (lambda p: painter(p, 3), {"label_map": "custom", "sky": [1], "ground": [1]}, "both hold class 1"),
        (lambda p: constant(p, np.zeros((1, 5, 64, 64)), np.zeros((1, 5, 64, 64))), {}, "its outputs are float32"),
        (lambda p: constant(p, np.zeros((1, 1000))), {}, r"float32 \[1, 1000\]; one output is expected: logits"),
        (lambda p: constant(p, np.zeros((1, 1, 64, 64))), {}, r"float32 \[1, 1, 64, 64\]; one output"),
        (lambda p: painter(p, 5, metadata={"fdslam.mean": "1 2"}), {"normalise": "auto"}, "three numbers each"),
        (lambda p: painter(p, 5, metadata={"fdslam.mean": "a"}), {"normalise": "auto"}, "numbers are needed"),
        (lambda p: p.write_bytes(b""), {}, "an empty file"),
        (lambda p: painter(p, 5).write_bytes(painter(p, 5).read_bytes()[:-9]), {}, "not a whole ONNX model"),
        (lambda p: None, {}, "no such file; check the path, or run with mask=none"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(make, changes, said, tmp_path):
    path = tmp_path / "m.onnx"
    make(path)
    with pytest.raises(InputError, match=said) as raised:
        Segmentation(asked(path, **changes))
    assert "\n" not in str(raised.value)
    assert str(raised.value).startswith("mask.")


def test_a_number_beyond_the_label_map(tmp_path):
    path = painter(tmp_path / "m.onnx", 21, kind="numbers")
    model = Segmentation(asked(path, label_map="cityscapes19"))
    with pytest.raises(InputError, match=r"puts out class 20, mask\.label_map=cityscapes19 has 19"):
        model.labels(shades(21, np.full((8, 8), 20)))


def test_what_is_not_finite_is_said(tmp_path):
    path = constant(tmp_path / "m.onnx", np.full((1, 5, 8, 8), np.nan))
    with pytest.raises(InputError, match="its output is not finite"):
        Segmentation(asked(path)).labels(np.zeros((20, 20, 3), np.uint8))


def test_a_shipped_model_that_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setattr(onnx_model, "WEIGHTS", tmp_path)
    with pytest.raises(InputError, match=r"campus\.onnx: no such file; it is the shipped model .* run with mask=none"):
        Segmentation(Mask("deeplabv3plus"))


needs_ade20k = pytest.mark.skipif(not ADE20K.is_file(), reason=f"no real segmentation at {ADE20K}")


@needs_ade20k
def test_a_real_model_sees_sky_above_and_road_below_whatever_the_threads():
    image = read_image(sorted((SHARED / "camvid_changes" / "query").glob("*.jpg"))[120])
    settings = Mask("deeplabv3plus", weights=str(ADE20K))
    model = Segmentation(settings)
    assert model.labels_of_classes.tolist() == labels_of(ADE20K_32).tolist()
    labels = model.labels(image)
    assert (labels[-80:-20, 160:320] == GROUND).mean() > 0.9
    assert not (labels[-80:] == SKY).any()
    assert (labels[:100, 250:300] == SKY).mean() > 0.5
    with ThreadPoolExecutor(2) as pool:
        assert all(np.array_equal(labels, other) for other in pool.map(model.labels, [image, image]))
    assert np.array_equal(Segmentation(replace(settings, threads=3)).labels(image), labels)
