"""The embedded world as data sets, one for each pair of sessions, against the world itself."""

from dataclasses import replace
from itertools import permutations

import cv2
import numpy as np
import pytest

from fdslam.config import Campus
from fdslam.data import load_datasets
from fdslam.data.campus import SESSIONS, World
from fdslam.data.campus.pairs import PAIRS, choose, shares
from fdslam.errors import InputError
from fdslam.store import Store, sha256_file

SMALL = Campus(images=41, width=64, height=84, query="all", map="all", objects=10_000, distractors=10_000)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return Store(tmp_path_factory.mktemp("campus"))


@pytest.fixture(scope="module")
def sets(store):
    return load_datasets(SMALL, store, 1)


def index(frame):
    return int(frame.name[-8:-4])


def test_one_data_set_for_every_ordered_pair(sets, store):
    assert [data.pair for data in sets] == list(permutations(SESSIONS, 2))
    assert {data.name for data in sets} == {"campus"}
    one = load_datasets(replace(SMALL, query="AU", map="SU"), store, 1)
    assert [data.pair for data in one] == [("AU", "SU")]
    assert [data.pair for data in load_datasets(replace(SMALL, map="WI"), store, 1)] == [
        ("SP", "WI"), ("SU", "WI"), ("AU", "WI")
    ]  # fmt: skip
    assert one[0].query == next(data for data in sets if data.pair == ("AU", "SU")).query


def test_a_frame_is_the_same_in_every_pair(sets):
    frames = {}
    for data in sets:
        query, map_ = data.pair
        assert all(frame.name.startswith(f"{query}/") for frame in data.query)
        assert all(frame.name.startswith(f"{map_}/") for frame in data.map)
        for frame in (*data.query, *data.map):
            assert frames.setdefault(frame.name, frame) == frame
    assert len(frames) == SMALL.images
    assert len({frame.digest for frame in frames.values()}) == SMALL.images
    for frame in list(frames.values())[::9]:
        assert sha256_file(frame.path) == frame.digest
        assert cv2.imread(str(frame.path)).shape == (frame.height, frame.width, 3) == (84, 64, 3)


def test_maps_are_whole_sessions_in_the_order_of_the_path(sets):
    world = World(SMALL.seed, SMALL.images, 64, 84)
    assert world.count == {"WI": 11, "SP": 10, "SU": 10, "AU": 10}
    for data in sets:
        assert [index(frame) for frame in data.map] == list(range(world.count[data.pair[1]]))
        cameras = (world.camera(data.pair[1], i) for i in range(len(data.map)))
        np.testing.assert_allclose(data.poses, [[c.x, c.y, c.heading] for c in cameras])
        assert (np.diff(data.times) > 0).all()


def test_annotated_is_what_stands_in_the_query_session_and_not_in_the_map_s(sets):
    world = World(SMALL.seed, SMALL.images, 64, 84)
    total, only_one = 0, 0
    for data in sets:
        query, map_ = data.pair
        for frame, boxes, labels in zip(data.query, data.boxes, data.labels, strict=True):
            if index(frame) % 3:
                continue
            view = world.view(query, index(frame))
            changed = np.array([map_ not in world.items[k].sessions for k in view.items], bool).reshape(-1)
            np.testing.assert_array_equal(boxes, view.boxes[changed & view.clear])
            assert len(boxes) or not changed.any()  # a distractor shows no change at all, however small
            np.testing.assert_array_equal(cv2.imread(str(labels), cv2.IMREAD_UNCHANGED), view.labels)
            total += len(boxes)
            only_one += sum(len(world.items[k].sessions) == 3 for k in view.items[changed])
    assert total > 20
    assert only_one > 0  # an object that stands in all sessions but one is a change against that one


def test_places_are_found_by_pose(sets):
    world = World(SMALL.seed, SMALL.images, 64, 84)
    for data in sets:
        for frame, places in list(zip(data.query, data.relevant, strict=True))[::3]:
            camera = world.camera(data.pair[0], index(frame))
            distance = np.hypot(*(data.poses[:, :2] - (camera.x, camera.y)).T)
            assert (np.diff(distance[places]) >= 0).all()
            assert set(places) == set(np.flatnonzero(distance <= SMALL.radius)) != set()  # nobody walks backwards


def test_the_protocol_s_numbers_are_shared_out_exactly():
    assert sum(shares(986, PAIRS).values()) == 986
    assert set(shares(1973, PAIRS).values()) == {164, 165}
    assert shares(2959, SESSIONS) == {"WI": 740, "SP": 740, "SU": 740, "AU": 739}


def test_queries_are_chosen_by_few_objects_and_spread_over_the_path():
    annotated = np.tile([0, 0, 1, 2, 1, 0, 3, 0], 20)
    visible = np.tile([0, 1, 1, 2, 1, 0, 3, 0], 20)  # the second is neither: its change is too small to annotate
    chosen = choose(annotated, visible, 15, 30)
    assert annotated[chosen].sum() == 15
    assert annotated[chosen].max() == 1
    assert (visible[chosen] == 0).sum() == 30
    assert chosen == sorted(set(chosen))
    for kind in (annotated[chosen] > 0, annotated[chosen] == 0):
        assert np.diff(np.array(chosen)[kind], prepend=0, append=160).max() < 35
    assert annotated[choose(annotated, visible, 47, 0)].sum() == 47  # 40 with one object, and then some with more
    everything = choose(annotated, visible, 10_000, 10_000)
    assert not set(everything) & set(range(1, 160, 8))
    assert len(everything) == 140


def test_torn_files_are_rendered_again_and_nothing_else(store, sets, monkeypatch):
    pair = replace(SMALL, query="WI", map="SP")
    [data] = load_datasets(pair, store, 1)
    before = {frame: frame.path.read_bytes() for frame in (*data.query, *data.map)}
    data.map[3].path.write_bytes(b"torn")
    data.query[0].path.unlink()
    data.labels[1].write_bytes(b"")
    rendered, view = [], World.view
    monkeypatch.setattr(World, "view", lambda self, *which: rendered.append(which) or view(self, *which))
    [again] = load_datasets(pair, store, 1)
    assert sorted(rendered) == sorted([("SP", 3), ("WI", index(data.query[0])), ("WI", index(data.query[1]))])
    assert {frame: frame.path.read_bytes() for frame in (*again.query, *again.map)} == before
    rendered.clear()
    load_datasets(pair, store, 1)
    assert rendered == []


def test_a_session_against_itself_and_a_pair_without_queries_are_errors(store):
    with pytest.raises(InputError, match="two different sessions"):
        Campus(query="SU", map="SU")
    with pytest.raises(InputError, match=r"dataset\.query=XX"):
        Campus(query="XX")
    with pytest.raises(InputError, match="no image of AU is a query against SU"):
        load_datasets(replace(SMALL, query="AU", map="SU", objects=0, distractors=0), store, 1)
