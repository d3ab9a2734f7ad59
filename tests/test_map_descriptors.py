"""PC with codes in place of SIFTs, on a small world. Oracle: the codes' own descriptors, compared one by one."""

from dataclasses import replace

import numpy as np
import pytest

from fdslam import map_descriptors
from fdslam.config import Config, Evaluation, Folder, Obb, Pc
from fdslam.context import Context
from fdslam.data import load_datasets
from fdslam.detectors import comparison
from fdslam.hypotheses import hypotheses
from fdslam.map_descriptors import MapDescriptors, features
from fdslam.mapping import BowMap
from fdslam.obb import Library
from fdslam.store import Store
from tests import reference
from tests.data.worlds import small_world


@pytest.fixture(scope="module")
def contexts(tmp_path_factory):
    """The same run with SIFTs and with codes of 8 bytes."""
    folder = tmp_path_factory.mktemp("run")
    store, few = str(folder / "store"), Pc(keypoints=60, min_side=0)
    base = Config(store=store, dataset=Folder(root=str(small_world(folder / "data", 8))), pc=few, workers=1)
    (data,) = load_datasets(base.dataset, Store(store), 1)
    bow = BowMap(data.map, base.bow, Library(Obb(library="J+B")), Store(store), 1)
    keys, found = bow.localize(data.query)
    places = hypotheses(Evaluation(Y=3), data, found)
    return [
        Context(replace(base, pc=pc), data, Store(store), tuple(found), tuple(keys), places)
        for pc in (few, replace(few, descriptors="pq", code_bytes=8))
    ]


def test_what_is_kept(contexts):
    exact, coded = map(MapDescriptors, contexts)
    detected = [comparison.detect(context) for context in contexts]
    images = len(contexts[0].dataset.map)
    compared = sorted({int(m) for places in contexts[0].hypotheses for m in places})
    counts = [len(exact.of(m)) for m in compared]
    assert min(counts) > 10
    assert detected[0].kept == pytest.approx(np.mean(counts) * 128)
    assert detected[1].kept == pytest.approx(np.mean(counts) * 8 + 256 * 128 / images)
    assert all(len(coded.of(m)) == count for m, count in zip(compared, counts, strict=True))


def test_distances_are_those_of_the_codes(contexts):
    context, kept = contexts[1], MapDescriptors(contexts[1])
    loc = comparison.detect(context).loc
    differ = 0
    for query in (0, 5):
        frame = context.dataset.query[query]
        own = features(context, frame)
        maps = [kept.of(m) for m in context.hypotheses[query]]
        distance = np.array(reference.nearest_distance(own["sift"].astype(float), [m.astype(float) for m in maps]))
        expected = reference.cells_maximum(own["xy"], distance, frame.height, frame.width)
        np.testing.assert_allclose(loc[query], expected, rtol=1e-6)
        differ += (loc[query] != comparison.detect(contexts[0]).loc[query]).any()
    assert differ


def test_a_second_look_computes_nothing(contexts, monkeypatch):
    expected = [comparison.detect(context).loc for context in contexts]
    assert comparison.missing(contexts[1]) == (0, set())

    def computed(*_):
        raise AssertionError("it is stored")

    for name in ("extract", "train", "encode"):
        monkeypatch.setattr(map_descriptors, name, computed)
    for context, loc in zip(contexts, expected, strict=True):
        for ours, before in zip(comparison.detect(context).loc, loc, strict=True):
            np.testing.assert_array_equal(ours, before)


def test_other_seeds_and_sizes_are_other_artefacts(contexts):
    context = contexts[1]
    keys = {MapDescriptors(context).key(0)}
    for changed in (
        replace(context.config, seed=1),
        replace(context.config, pc=replace(context.config.pc, code_bytes=16)),
        replace(context.config, pc=replace(context.config.pc, descriptors="exact")),
        replace(context.config, pc=replace(context.config.pc, keypoints=50)),
    ):
        keys.add(MapDescriptors(replace(context, config=changed)).key(0))
    assert len(keys) == 5
    threads = replace(context.config, pc=replace(context.config.pc, threads=3))
    assert MapDescriptors(replace(context, config=threads)).key(0) in keys
    assert comparison.missing(replace(context, config=threads))[0] == 0
