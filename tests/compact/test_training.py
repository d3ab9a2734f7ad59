"""Early fusion, trained on a small walk. A first training is the oracle of every other."""

from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import save_file
from sklearn.metrics import roc_auc_score

from fdslam.compact import shipped, training
from fdslam.compact.features import NAMES
from fdslam.compact.gradients import Gradients
from fdslam.compact.grid import cell_means
from fdslam.compact.shipped import file_name, shipped_trees
from fdslam.compact.training import NEITHER, PSEUDO, TREES, chosen, fit, lacking, made_up, pseudo_keys, pseudo_rows
from fdslam.config import Compact, Config, Early, Evaluation, Fd, Training
from fdslam.context import Context
from fdslam.data import load_datasets
from fdslam.detectors import early
from fdslam.detectors.compact import compact_map
from fdslam.errors import InputError
from fdslam.mapping import BowMap
from fdslam.obb import Library
from fdslam.store import Store
from fdslam.types import CELL, Boxes, Localization
from tests.compact.walks import config_for, walk


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return walk(tmp_path_factory.mktemp("world") / "data")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A store in which everything is made once."""
    return tmp_path_factory.mktemp("stored")


def context_of(world, store, images=None, **changes):
    config = config_for(world, store, **changes)
    [data] = load_datasets(config.dataset, Store(store), 1)
    data = replace(data, map=data.map[:images])
    bow = BowMap(data.map, config.bow, Library(config.obb), Store(store), 1)
    return Context(config, data, Store(store), (), (), (), bow, Gradients(config.compact))


def train(context):
    return early.trees_of(context)


def same(one, other):
    arrays = zip(one.arrays().items(), other.arrays().items(), strict=True)
    return all(a == b and np.array_equal(x, y) for (a, x), (b, y) in arrays)


def rows_of(context):
    kept = compact_map(context)
    keys = pseudo_keys(context, kept)
    return [context.store.get(PSEUDO, key) for key in keys], keys


@pytest.fixture(scope="module")
def trained(world, folder):
    context = context_of(world, folder)
    assert early.missing(context) == len(context.dataset.map) == 12
    return context, train(context)


def test_another_training_gives_the_same_trees(world, trained, tmp_path):
    context, trees = trained
    other = context_of(world, tmp_path)
    other = replace(other, config=replace(other.config, workers=2))
    assert same(train(other), trees)
    for one, two in zip(rows_of(context)[0], rows_of(other)[0], strict=True):
        assert np.array_equal(one["features"], two["features"])
        assert np.array_equal(one["label"], two["label"])


def test_what_is_stored_is_not_made_again(world, folder, trained, monkeypatch):
    monkeypatch.setattr(training, "pseudo_rows", None)
    monkeypatch.setattr(training, "fit", None)
    again = context_of(world, folder)
    assert early.missing(again) == 0
    assert same(train(again), trained[1])


def test_what_is_damaged_or_lost_is_made_again(world, folder, trained):
    context, trees = trained
    _, keys = rows_of(context)
    [path] = (folder / TREES.name).rglob("*.safetensors")
    path.write_bytes(path.read_bytes()[:-9])
    damaged = context.store.path(PSEUDO, keys[2])
    damaged.write_bytes(damaged.read_bytes()[:-9])
    context.store.path(PSEUDO, keys[5]).unlink()
    assert same(train(context_of(world, folder)), trees)


def test_what_is_still_to_do_is_counted(world, folder, trained):
    context, _ = trained
    kept, keys = compact_map(context), rows_of(context)[1]
    [trees] = (folder / TREES.name).rglob("*.safetensors")
    lost = [context.store.path(PSEUDO, key) for key in keys[:3]]
    before = {path: path.read_bytes() for path in (trees, *lost)}
    for path in lost:
        path.unlink()
    assert lacking(context, kept) == 0  # nobody needs them
    trees.unlink()
    assert lacking(context, kept) == 3
    for path in lost:
        path.write_bytes(before[path])
    assert lacking(context, kept) == 0  # fitted in no time
    trees.write_bytes(before[trees])


def test_it_learns_what_was_made_up(trained):
    context, trees = trained
    found, _ = rows_of(context)
    rows, label = (np.concatenate([one[name] for one in found]) for name in ("features", "label"))
    assert rows.shape == (12 * 12 * 16, len(NAMES))
    assert np.isfinite(rows).all()
    assert set(np.unique(label)) <= {0, 1, NEITHER}
    known = label != NEITHER
    scores = trees.log_odds(rows.astype(np.float64))
    assert roc_auc_score(label[known], scores[known]) > 0.9


def test_a_map_image_is_not_compared_with_itself(world, folder, trained, monkeypatch):
    context = context_of(world, folder)
    kept, asked, looked = compact_map(context), [], []
    plain, looks = training.align, kept.looks

    def align(query, size, images, words, *rest):
        asked.append(images)
        found = plain(query, size, images, words, *rest)
        for one in images:  # words that the left-out image gave are told by their keypoints' own descriptors
            assert np.array_equal(words(one).descriptors, context.bow.words_without(one, 4).descriptors)
        return found

    monkeypatch.setattr(training, "align", align)
    monkeypatch.setattr(kept, "looks", lambda frame: (looked.append(frame), looks(frame))[1])
    pseudo_rows(context, kept, 4, 0)
    assert asked
    assert looked
    assert all(4 not in images for images in asked)
    assert context.dataset.map[4] not in looked


def test_patches_come_from_far_away(world, folder, trained, monkeypatch):
    context, drawn = context_of(world, folder), []
    kept, plain, read = compact_map(context), training.pseudo_query, {}

    def pseudo_query(image, foreign, rng):
        drawn.append(len(foreign))
        return plain(image, foreign, rng)

    monkeypatch.setattr(training, "pseudo_query", pseudo_query)
    original = training.read_image
    monkeypatch.setattr(training, "read_image", lambda path: (read.setdefault(path), original(path))[1])
    pseudo_rows(context, kept, 0, 0)
    numbers = sorted(int(path.stem) for path in read)
    assert numbers[0] == 0
    assert len(numbers) == 1 + drawn[0] > 1
    assert min(numbers[1:]) > min(training.FAR, 12 // 4)


def test_a_cell_is_changed_where_most_of_it_is_foreign():
    mask = np.random.default_rng(0).random((33, 47)).astype(np.float32)
    found = cell_means(mask)
    assert found.shape == (4, 5)
    for row in range(4):
        for col in range(5):
            part = mask[CELL * row : CELL * (row + 1), CELL * col : CELL * (col + 1)]
            assert found[row, col] == pytest.approx(part.astype(float).mean())


def test_addresses_follow_what_decides(world, folder, trained):
    context, _ = trained

    def keys(**changes):
        config = replace(context.config, **changes)
        other = replace(context, config=config, looks=Gradients(config.compact))
        kept = compact_map(other)
        names = pseudo_keys(other, kept)
        return names, training._key(other, names)

    plain, config = keys(), context.config
    assert keys(workers=5, name="x") == plain
    for changes in (
        {"seed": 1},
        {"compact": replace(config.compact, reach=9.0)},
        {"compact": replace(config.compact, kilobytes=9.0)},
        {"fd": Fd(mean="geometric")},
        {"evaluation": Evaluation(Y=3)},
    ):
        other = keys(**changes)
        assert not {*other[0]} & {*plain[0]}
        assert other[1] != plain[1]
    fewer = keys(early=replace(config.early, trees=3))
    assert fewer[0] == plain[0]
    assert fewer[1] != plain[1]
    assert keys(early=replace(config.early, leaf=21))[1] not in (plain[1], fewer[1])
    more = keys(early=replace(config.early, rounds=2))
    assert more[0][:12] == plain[0]
    assert len({*more[0]}) == 24


def test_another_round_makes_up_other_changes(trained):
    context, _ = trained
    kept = compact_map(context)
    one, two = (pseudo_rows(context, kept, 3, turn) for turn in (0, 1))
    assert not np.array_equal(one["features"], two["features"])


def test_the_boxes_of_a_detector_of_objects_are_not_told():
    rng = np.random.default_rng(0)
    xyxy = np.array([[0, 0, 80, 120], [80, 0, 160, 60], [20, 20, 60, 60], [90, 70, 150, 110]], np.float32)
    ranks = rng.integers(1, 13, (4, 12)).astype(np.int32)
    top = np.array([3, 5, 1])

    def level(rows, names):
        boxes = Boxes(xyxy[rows], names)
        found = Localization(boxes, ranks[rows], np.arange(12, dtype=np.int32), boxes)
        return training.fd_of(found, top, (120, 160), 12, Fd())

    plain = level([0, 1], ("J", "B"))
    assert np.array_equal(level([0, 1, 2, 3], ("J", "B", "YOLO", "YOLO")), plain)
    assert not np.array_equal(level([0, 1, 2, 3], ("J", "B", "BING", "BING")), plain)
    assert np.isfinite(level([2], ("YOLO",))).all()


def test_what_decides_whether_a_map_is_trained_on():
    assert made_up(Early(model="auto", least=40), 39) == 0
    assert made_up(Early(model="auto", least=40), 40) == 40
    assert made_up(Early(model="map", least=40), 3) == 3
    assert made_up(Early(model="shipped", least=1), 300) == 0
    assert made_up(Early(model="map", images=100, rounds=3), 300) == 300
    for images, most in ((7, 400), (164, 50), (401, 400), (1, 1)):
        which = chosen(images, Training(images=most))
        assert len(which) == len({*which}) == min(images, most)
        assert which == sorted(which)
        assert which[0] == 0
        assert which[-1] == (images - 1 if most > 1 else 0)


def test_cells_of_one_label_teach_nothing():
    rows = np.random.default_rng(0).random((50, len(NAMES))).astype(np.float32)
    label = np.zeros(50, np.uint8)
    with pytest.raises(InputError, match=r"too few or too small.*early\.model=shipped") as error:
        fit(rows, label, Training(), 0)
    assert "\n" not in str(error.value)
    label[::2] = 1
    few = Training(trees=2, leaves=2)
    assert same(fit(rows, label, few, 0), fit(rows, label, few, 0))
    with pytest.raises(InputError, match="too few"):
        fit(np.zeros((0, len(NAMES)), np.float32), label[:0], few, 0)


def test_a_map_of_one_image_cannot_be_trained_on(world, tmp_path):
    with pytest.raises(InputError, match=r"run with early\.model=shipped"):
        train(context_of(world, tmp_path, images=1))


@pytest.fixture
def weights(tmp_path, monkeypatch):
    monkeypatch.setattr(shipped, "shipped", lambda name: tmp_path / name)
    return tmp_path


SHIPPED = Config(compact=Compact(source="gradients"), early=Early(model="shipped"))


def test_without_the_shipped_file_there_is_a_way_out(world, folder, weights):
    for context in (
        context_of(world, folder, early=Early(model="shipped")),
        context_of(world, folder, early=Early(model="auto", least=99)),
    ):
        assert early.missing(context) == 0
        with pytest.raises(InputError, match=r"cannot be read .*early\.model=map") as error:
            train(context)
        assert "\n" not in str(error.value)
        assert file_name("gradients") in str(error.value)


def test_a_damaged_or_foreign_shipped_file_is_refused(weights):
    path = weights / file_name("gradients")
    path.write_bytes(b"torn")
    with pytest.raises(InputError, match="cannot be read"):
        shipped_trees(SHIPPED)
    save_file({"roots": np.zeros(1, np.int32)}, path, metadata={"features": "others"})
    with pytest.raises(InputError, match="made for other features"):
        shipped_trees(SHIPPED)
    save_file({"roots": np.zeros(1, np.int32)}, path)
    with pytest.raises(InputError, match="made for other features"):
        shipped_trees(SHIPPED)


def test_shipped_trees_are_those_in_the_file(world, folder, weights, trained):
    _, trees = trained
    save_file(trees.arrays(), weights / file_name("gradients"), metadata={"features": ",".join(NAMES)})
    assert same(shipped_trees(SHIPPED), trees)
    assert same(train(context_of(world, folder, early=Early(model="shipped"))), trees)
    with pytest.raises(InputError, match="early_fusion_network"):
        shipped_trees(Config(early=Early(model="shipped")))
