"""The controls of the compact map measure what their names say. Oracles: loops over boxes, cells and queries."""

import json

import numpy as np
import pytest

from experiments.compact.leaks import LOOKS, TEXTURE, pixel_rows
from experiments.compact.learners import drives, learned
from experiments.compact.measures import alarms, box_mean_auroc, box_mean_matrix, found_by_area, mean_over, threshold
from experiments.compact.movers import alarms_in, cells_in, percent
from experiments.compact.prepared import configuration
from experiments.compact.splits import agreeing, light_levels, splits
from experiments.compact.worst import worst
from experiments.compact.wrong import FAR, far_images, unmoved
from fdslam.compact.features import NAMES
from fdslam.compact.flow import flow
from fdslam.config import Early, Evaluation
from fdslam.data.folder import DRIVE_GAP
from fdslam.metrics import Scene, positive_cells
from fdslam.modes import deviations

NONE = np.zeros((0, 4), np.float32)
CONFIG = Evaluation(bootstrap=50)


def made(seed=0, queries=9, levels=0):
    """Return a scene of 60 × 45 pixels, a third of it without boxes, and maps; ``levels``: so many values alone."""
    rng = np.random.default_rng(seed)
    boxes = []
    for q in range(queries):
        corner = rng.uniform(0, 35, (0 if q % 3 == 0 else q % 3, 2))
        boxes.append(np.concatenate([corner, corner + rng.uniform(8, 25, corner.shape)], axis=1).astype(np.float32))
    names = tuple(rng.permutation([f"query/{i}.png" for i in range(queries)]))
    maps = [rng.normal(size=(5, 6)).astype(np.float32) for _ in range(queries)]
    if levels:
        maps = [np.floor(levels * rng.random((5, 6))).astype(np.float32) for _ in range(queries)]
    return Scene(names, (45,) * queries, (60,) * queries, tuple(boxes)), maps


def shares(scene, maps):
    """Return (query, box, share of the unchanged queries that are beaten) of every box as listed, by loops."""
    found = []
    unchanged = [q for q, boxes in enumerate(scene.boxes) if not len(boxes)]
    for q, boxes in enumerate(scene.boxes):
        for b, box in enumerate(boxes):
            mine = positive_cells(box, 45, 60)
            beaten = 0.0
            for u in unchanged:
                here = np.mean(maps[q][mine].astype(float))
                there = np.mean(maps[u][mine].astype(float))
                beaten += 1.0 if here > there else 0.5 if here == there else 0.0
            found.append((q, b, beaten / len(unchanged)))
    return found


@pytest.mark.parametrize("levels", [0, 2])
def test_the_auroc_of_box_means_is_that_of_a_loop(levels):
    scene, maps = made(levels=levels)
    figure = box_mean_auroc(scene.flatten("x", maps), scene, CONFIG, 0)
    assert figure.value == pytest.approx(np.mean([share for *_, share in shares(scene, maps)]))
    assert 0 <= figure.low <= figure.value <= figure.high <= 1
    assert figure.low < figure.high


def test_a_fixed_map_knows_nothing_by_box_means():
    scene, maps = made()
    fixed = [maps[0]] * len(maps)
    a, valid = box_mean_matrix(scene.flatten("x", fixed), scene)
    assert valid.all()
    assert (a == 0.5).all()


def test_boxes_without_unchanged_queries_have_no_auroc():
    scene, maps = made()
    changed = [q for q, boxes in enumerate(scene.boxes) if len(boxes)]
    some = Scene(*(tuple(part[q] for q in changed) for part in (scene.names, scene.heights, scene.widths, scene.boxes)))
    assert box_mean_auroc(some.flatten("x", [maps[q] for q in changed]), some, CONFIG, 0) is None


def test_the_worst_boxes_are_those_that_beat_the_fewest():
    scene, maps = made(seed=3)
    expected = sorted(share for *_, share in shares(scene, maps))[:4]
    found = worst(scene.flatten("x", maps), scene, 4)
    assert [share for *_, share in found] == pytest.approx(expected)
    by_box = {(q, b): share for q, b, share in shares(scene, maps)}
    assert all(by_box[q, b] == pytest.approx(share) for q, b, share in found)


def test_boxes_are_parted_by_area():
    scene, _ = made(seed=5, queries=12)
    area = scene.objects.area
    small = area <= np.sort(area)[len(area) // 3 - 1]
    figures = found_by_area(small, scene, 3, CONFIG, 0)
    assert [figure.value for _, figure in figures] == [100, 0, 0]
    assert [largest for largest, _ in figures] == sorted(largest for largest, _ in figures)
    assert figures[-1][0] == area.max()


def test_a_tenth_of_the_cells_reaches_the_threshold():
    values = np.random.default_rng(1).permutation(200).astype(np.float32)
    assert threshold(values, 10) == 180
    assert threshold(np.arange(3.0), 10) == 2


def test_alarms_are_components_of_at_least_four_cells():
    cells = np.zeros((8, 9))
    cells[0, :4] = 1  # four in a row
    cells[2:5, 0] = 1  # three: too few
    cells[4, 5] = cells[5, 6] = cells[6, 7] = cells[7, 8] = 1  # four across corners
    assert alarms(cells, 1) == 2
    assert alarms(cells, 1.5) == 0
    assert alarms(cells, 0) == 1


def test_alarms_and_cells_on_movers_are_counted():
    """Oracles: a loop over cells, and ``measures.alarms`` for how many there are."""
    rng = np.random.default_rng(0)
    maps = [rng.random((12, 15)) for _ in range(6)]
    masks = [rng.random((12, 15)) < 0.3 for _ in range(6)]
    for (inside, every), cells, mask in zip(cells_in(maps, masks, 0.6), maps, masks, strict=True):
        at = [(r, c) for r in range(12) for c in range(15) if cells[r, c] >= 0.6]
        assert (inside, every) == (sum(bool(mask[place]) for place in at), len(at))
    assert [every for _, every in alarms_in(maps, masks, 0.6)] == [alarms(cells, 0.6) for cells in maps]
    cells, mask = np.zeros((8, 9)), np.zeros((8, 9), bool)
    cells[0, :4] = cells[4, :5] = cells[7, :4] = 1
    cells[2, 0] = 1  # alone: no alarm
    mask[0, :2] = mask[4, :2] = mask[2, 0] = True  # half of the first, less of the second, none of the third
    assert alarms_in([cells], [mask], 1) == [(1, 3)]


def test_the_percentage_is_that_of_all_queries_together():
    figure = percent([(1, 2), (0, 8), (0, 0)], CONFIG, 0)
    assert figure.value == pytest.approx(10)
    assert 0 <= figure.low <= 10 <= figure.high <= 50
    assert percent([(0, 0)], CONFIG, 0) is None


def test_a_mean_has_its_interval_over_queries():
    figure = mean_over([0, 1, 2, 5], CONFIG, 0)
    assert figure.value == 2
    assert figure.low < 2 < figure.high
    assert mean_over([], CONFIG, 0) is None


def test_wrong_images_are_never_near_the_place():
    rng = np.random.default_rng(0)
    for place in ([], [0], [20, 21, 60], [99]):
        for _ in range(50):
            found = far_images(np.array(place, np.int64), 100, 10, rng)
            assert len(set(found)) == 10
            assert all(abs(m - p) > FAR for m in found for p in place)
    assert not len(far_images(np.array([5]), 12, 10, rng))


def test_every_far_image_may_be_drawn():
    drawn = {m for seed in range(60) for m in far_images(np.array([20]), 40, 5, np.random.default_rng(seed)).tolist()}
    assert drawn == set(range(40)) - set(range(10, 31))


def test_an_image_that_is_laid_over_whole_does_not_move():
    here, there = unmoved((120, 160), (240, 320))
    at = flow(here, there, 120, 160).at(np.array([[10.0, 20.0], [150.0, 110.0]]))
    np.testing.assert_allclose(at, [[20, 40], [300, 220]], atol=1e-2)


def test_drives_lie_far_apart():
    times = np.array([0, 2, 4, 0, 2, 90]) + DRIVE_GAP * np.array([0, 0, 0, 1, 1, 3])
    assert drives(times).tolist() == [0, 0, 0, 1, 1, 2]
    assert not drives(np.arange(30.0)).any()


def test_queries_are_parted_by_light_and_by_agreement(tmp_path):
    names = [f"query/{i}.jpg" for i in range(4)]
    images = [{"file_name": "query/0.jpg", "photometric_level": 2}, {"file_name": "2.jpg", "photometric_level": 1}]
    (tmp_path / "annotations.json").write_text(json.dumps({"images": [*images, {"file_name": "query/1.jpg"}]}))
    levels = light_levels(tmp_path, names)
    assert levels == [2, None, 1, None]
    inliers = agreeing([{"inliers": np.array(one, np.float32)} for one in ([50, 9], [49], [], [300])])
    assert inliers == [50, 49, 0, 300]
    assert list(splits(levels, inliers).values()) == [[2], [0], [1, 2], [0, 3]]
    assert light_levels(tmp_path / "none", names) == [None] * 4
    assert list(splits([None] * 2, [60, 70]).values()) == [[0, 1]]


def test_what_a_query_alone_tells_is_nothing_of_the_map():
    assert [NAMES[i].split()[0] for i in TEXTURE] == ["texture"] * len(TEXTURE)
    assert len(TEXTURE) == sum(name.split()[0] == "texture" for name in NAMES) > 0
    image = np.random.default_rng(0).integers(0, 256, (45, 60, 3)).astype(np.uint8)
    rows = pixel_rows(image)
    assert rows.shape == (30, 4 * len(LOOKS))
    grey = image.mean(axis=2)
    np.testing.assert_allclose(rows[7, 0], grey[10:20, 10:20].mean(), rtol=1e-5)
    np.testing.assert_allclose(rows[29, 4 * LOOKS.index("contrast")], grey[40:, 50:].std(), rtol=1e-3)


def test_a_learner_of_any_features_learns_and_leaves_out_what_is_neither():
    rng = np.random.default_rng(0)
    rows = [rng.normal(size=(400, 2)).astype(np.float32) for _ in range(2)]
    label = [np.where(abs(one[:, 0]) < 0.1, 2, one[:, 0] > 0).astype(np.uint8) for one in rows]
    trees = learned(rows, label, Early(trees=20), 0)
    odds = trees.log_odds(np.array([[-1.0, 0], [1.0, 0]]))
    assert odds[0] < -1 < 1 < odds[1]


def test_the_rows_are_of_mode_best():
    config = configuration(None, "", "", "store")
    config.mode = "best"
    assert not deviations(config)
    assert config.dataset.kind == "campus"
