import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow import pivots
from fdslam.bow.bag import BagOfWords
from fdslam.bow.documents import ObbDocuments
from fdslam.bow.index import InvertedFile
from fdslam.errors import InputError
from tests.bow.test_vocabulary import SWITCHES, images, with_switches


def learned(switches, session, exact_below):
    vocabulary, index = with_switches(switches, exact_below), InvertedFile([], 0)
    for descriptors in session:
        index.add([vocabulary.learn(descriptors)], len(vocabulary))
    return BagOfWords(vocabulary, index)


def answer(bag, query):
    words = bag.vocabulary.match(query)
    return words.tolist(), bag.index.scores(words, np.ones((1, len(words)), bool), "ibow").tolist()


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
            stored.index.add([stored.vocabulary.learn(descriptors)], len(stored.vocabulary))
        assert answer(stored, query) == answer(whole, query)
        assert answer(BagOfWords.load(path), query) == answer(part, query)  # the file is as it was


def test_a_map_of_obbs_comes_back_as_one(tmp_path):
    [descriptors, query] = images(0, count=2)
    vocabulary = with_switches((0.8, "nearest", False))
    words = vocabulary.learn(descriptors)
    inside = np.random.default_rng(0).random((3, len(words))) < 0.5
    bag = BagOfWords(vocabulary, ObbDocuments.post([words, words[:0]], [inside, inside[:, :0]], len(vocabulary)))
    bag.save(tmp_path / "map")
    stored = BagOfWords.load(tmp_path / "map")
    assert isinstance(stored.index, ObbDocuments)
    assert answer(stored, query) == answer(bag, query)
    assert stored.nbytes == bag.nbytes


def test_a_file_that_is_no_map_is_named(tmp_path):
    (tmp_path / "map").write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match="map: not a map, or cut short; build the map again"):
        BagOfWords.load(tmp_path / "map")
    empty = BagOfWords(with_switches((0.8, "nearest", False)), InvertedFile([], 0))
    empty.save(tmp_path / "map")
    assert BagOfWords.load(tmp_path / "map").index.images == 0
