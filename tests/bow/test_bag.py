import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow import mapfile, pivots
from fdslam.bow.bag import VERSION, BagOfWords
from fdslam.bow.documents import ObbDocuments
from fdslam.bow.index import MOST, InvertedFile
from fdslam.errors import InputError
from tests.bow.test_vocabulary import SWITCHES, images, with_switches


def learned(switches, session, exact_below):
    bag = BagOfWords(with_switches(switches, exact_below), InvertedFile([], 0))
    for descriptors in session:
        bag.add(descriptors)
    return bag


def answer(bag, query):
    words = bag.match(query)
    return words.tolist(), bag.scores(words, np.ones((1, len(words)), bool), "ibow").tolist()


@given(st.integers(0, 1000), SWITCHES, st.sampled_from([32, 100_000]))
def test_a_stored_map_answers_and_grows_as_if_never_stored(tmp_path_factory, seed, switches, exact_below):
    path = tmp_path_factory.mktemp("bag") / "map"
    session, [query] = images(seed, count=10), images(seed + 1, count=1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pivots, "WORDS_PER_PIVOT", 4)
        whole, part = learned(switches, session, exact_below), learned(switches, session[:7], exact_below)
        part.save(path)
        stored = BagOfWords.load(path)
        assert stored.vocabulary.switches == whole.vocabulary.switches
        assert answer(stored, query) == answer(part, query)
        for descriptors in session[7:]:
            stored.add(descriptors)
        assert answer(stored, query) == answer(whole, query)
        assert answer(BagOfWords.load(path), query) == answer(part, query)  # the file is as it was


PLAIN = (0.8, "nearest", False)


def test_a_map_of_obbs_grows_shrinks_and_comes_back_as_one(tmp_path):
    session, [query] = images(0, count=5), images(9, count=1)
    inside = np.random.default_rng(0).random((5, 3, 12)) < 0.3
    bag = BagOfWords(with_switches(PLAIN), ObbDocuments.post([], [], 0))
    words = [bag.add(descriptors, boxes) for descriptors, boxes in zip(session, inside, strict=True)]
    at_once = BagOfWords(bag.vocabulary, ObbDocuments.post(words, inside, len(bag.vocabulary)))
    assert answer(bag, query) == answer(at_once, query)
    bag.save(tmp_path / "map")
    stored = BagOfWords.load(tmp_path / "map")
    assert isinstance(stored.index, ObbDocuments)
    assert answer(stored, query) == answer(bag, query)
    stored.remove(np.array([1, 3]))
    kept = [0, 2, 4]
    rest = ObbDocuments.post([words[i] for i in kept], inside[kept], len(bag.vocabulary))
    assert answer(stored, query) == answer(BagOfWords(bag.vocabulary, rest), query)
    with pytest.raises(IndexError, match="map ids 3 to 3: there are 3"):
        stored.remove(np.array([3]))
    before, known = answer(bag, query), len(bag.vocabulary)
    with pytest.raises(ValueError, match="this map posts OBBs"):
        bag.add(images(3, count=1)[0])
    assert answer(bag, query) == before
    assert len(bag.vocabulary) == known


def test_what_is_refused_is_not_learned():
    bag = learned(PLAIN, images(0, count=3), 100_000)
    words = len(bag.vocabulary)
    with pytest.raises(InputError, match="scores hold at most 20000"):
        bag.add(np.random.default_rng(0).integers(0, 256, (MOST + 1, 32), dtype=np.uint8))
    assert (len(bag.vocabulary), bag.index.images) == (words, 3)


def test_a_removed_session_is_never_found_again():
    session = images(0, count=6)
    bag = BagOfWords(with_switches(PLAIN), InvertedFile([], 0))
    posted = [bag.add(descriptors) for descriptors in session]
    bag.remove(np.arange(3))
    rest = BagOfWords(bag.vocabulary, InvertedFile(posted[3:], len(bag.vocabulary)))
    for descriptors in session:
        assert answer(bag, descriptors) == answer(rest, descriptors)


def test_threads_may_ask_while_another_adds(monkeypatch):
    monkeypatch.setattr(pivots, "WORDS_PER_PIVOT", 4)
    rng = np.random.default_rng(0)
    session = [rng.integers(0, 256, (60, 32), dtype=np.uint8) for _ in range(40)]
    bag = learned(PLAIN, session[:2], 64)
    wrong, done = [], []

    def ask():
        while not done:
            words = bag.match(session[0])
            scores = bag.scores(words, np.ones((1, 60), bool), "ibow")
            if words.tolist() != list(range(60)) or scores[0].argmax() != 0 or scores.shape[1] < 2:
                wrong.append(words)

    def add():
        for descriptors in session[2:]:  # pivots are chosen anew five times on the way
            bag.add(descriptors)
        done.append(True)

    threads = [threading.Thread(target=work) for work in (ask, ask, add)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert done
    assert not wrong
    assert answer(bag, session[0]) == answer(learned(PLAIN, session, 64), session[0])


def test_a_file_that_is_no_map_is_named(tmp_path):
    (tmp_path / "map").write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match="map: not a map, or cut short; build the map again"):
        BagOfWords.load(tmp_path / "map")
    empty = BagOfWords(with_switches(PLAIN), InvertedFile([], 0))
    empty.save(tmp_path / "map")
    assert BagOfWords.load(tmp_path / "map").index.images == 0
    arrays, settings = mapfile.load(tmp_path / "map", VERSION)
    for other in (
        ({k: v for k, v in arrays.items() if k != "ends"}, settings),
        (arrays, settings | {"radius": 3}),
        (arrays, settings | {"ratio": 3.0}),
    ):
        mapfile.save(tmp_path / "map", other[0], VERSION, other[1])
        with pytest.raises(InputError, match=r"laid out otherwise|out of range"):
            BagOfWords.load(tmp_path / "map")
