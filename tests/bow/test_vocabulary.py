import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam import config
from fdslam.bow import pivots
from fdslam.bow.vocabulary import NO_WORD, Vocabulary, distinct_rows, replay
from tests import reference
from tests.reference import refinement


def images(seed, count=4, each=12):
    """Descriptors of a few images that share words: noisy and exact copies of a small pool, and repeated ones."""
    rng = np.random.default_rng(seed)
    pool = rng.integers(0, 256, (10, 32), dtype=np.uint8)
    found = []
    for _ in range(count):
        chosen = pool[rng.integers(0, 10, each)]
        noise = (rng.random((each, 32)) < rng.choice([0.0, 0.2, 0.8])) * rng.integers(0, 256, (each, 32))
        found.append((chosen ^ noise.astype(np.uint8)).astype(np.uint8))
    return found


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.5, 0.8, 1.0]))
def test_grows_as_the_loops_do(seed, ratio):
    posted, words = reference.learn(images(seed), ratio)
    vocabulary = Vocabulary(config.Vocabulary(ratio))
    learned = [vocabulary.learn(d) for d in images(seed)]
    assert len(vocabulary) == len(words)
    assert [list(w) for w in learned] == posted
    query = images(seed + 1, count=1)[0]
    assert list(vocabulary.match(query)) == reference.match(query, words, ratio)


@given(st.integers(0, 10_000), st.integers(0, 4))
def test_replay_then_learn_is_learning_it_all(seed, stored):
    everything = Vocabulary(config.Vocabulary())
    learned = [everything.learn(d) for d in images(seed)]
    resumed = Vocabulary(config.Vocabulary())
    for _ in replay(resumed, zip(images(seed)[:stored], learned[:stored], strict=True)):
        pass
    rest = [resumed.learn(d) for d in images(seed)[stored:]]
    assert [list(w) for w in rest] == [list(w) for w in learned[stored:]]
    assert len(resumed) == len(everything)


def test_without_two_words_nothing_is_matched():
    vocabulary = Vocabulary(config.Vocabulary())
    one = np.zeros((1, 32), np.uint8)
    assert list(vocabulary.match(one)) == [NO_WORD]
    assert list(vocabulary.learn(one)) == [0]
    assert list(vocabulary.match(one)) == [NO_WORD]  # one word has no second nearest
    assert vocabulary.learn(np.zeros((0, 32), np.uint8)).shape == (0,)


SWITCHES = st.tuples(st.sampled_from([0.5, 0.8, 1.0]), st.sampled_from(["nearest", "other_place"]), st.booleans())


def with_switches(switches, exact_below=100_000):
    ratio, second, purge = switches
    return Vocabulary(config.Vocabulary(ratio, exact_below, 32, second, purge))


@given(st.integers(0, 10_000), SWITCHES)
def test_purge_and_other_places_are_what_the_loops_say(seed, switches):
    oracle, vocabulary = refinement.Words(*switches), with_switches(switches)
    session = images(seed, count=9, each=10)
    posted = []
    for descriptors in session:
        posted.append(vocabulary.learn(descriptors))
        assert list(posted[-1]) == oracle.learn(descriptors)
    assert len(vocabulary) == len(oracle.words)
    for words in posted:
        assert list(vocabulary.held(words)) == [NO_WORD if w in oracle.dropped else w for w in words]
    [query] = images(seed + 1, count=1, each=20)
    assert list(vocabulary.match(query)) == [oracle.match(d) for d in query]


@given(st.integers(0, 10_000), SWITCHES, st.sampled_from([20, 100_000]))
def test_the_descriptors_of_held_words_are_those_they_were_born_with(seed, switches, exact_below):
    vocabulary, born = with_switches(switches, exact_below), {}
    for descriptors in images(seed, count=7, each=10):
        words = vocabulary.learn(descriptors)
        for word, descriptor in zip(words.tolist(), descriptors.tolist(), strict=True):
            born.setdefault(word, descriptor)
        held = np.random.default_rng(seed).permutation(list(born)).astype(np.int32)
        if switches[2]:  # what is dropped is not asked for
            held = np.array([w for w in held if vocabulary.held(np.array([w], np.int32))[0] != NO_WORD], np.int32)
        assert vocabulary.descriptors(held).tolist() == [born[w] for w in held.tolist()]
    assert vocabulary.descriptors(np.zeros(0, np.int32)).shape == (0, 32)


@given(st.integers(0, 10_000), SWITCHES, st.integers(0, 9))
def test_a_stored_vocabulary_goes_on_as_if_never_stored(seed, switches, count):
    session = images(seed, count=12)
    whole, part = with_switches(switches), with_switches(switches)
    learned = [whole.learn(d) for d in session]
    replayed = with_switches(switches)
    for descriptors, words in zip(session[:count], learned[:count], strict=True):
        part.learn(descriptors)
        replayed.post(descriptors, words)
    stored = Vocabulary.from_arrays(part.arrays(), part.switches)
    assert stored.nbytes <= part.nbytes
    for descriptors, words in zip(session[count:], learned[count:], strict=True):
        assert list(stored.learn(descriptors)) == list(words)
        assert list(replayed.learn(descriptors)) == list(words)
    assert list(stored.held(learned[0])) == list(whole.held(learned[0])) == list(replayed.held(learned[0]))


def without(words, descriptors, ratio):
    """The word of each descriptor among some words (id to descriptor) alone."""
    ids = sorted(words)
    found = reference.match(descriptors, [words[i] for i in ids], ratio)
    return [NO_WORD if i < 0 else ids[i] for i in found]


@given(st.integers(0, 10_000), SWITCHES, st.integers(0, 6), st.sampled_from([20, 100_000]))
def test_words_that_are_left_out_are_as_if_they_were_not_there(seed, switches, left, exact_below):
    vocabulary, held = with_switches(switches, exact_below), {}
    vocabulary.words.depth = 8  # 64 lists or more: all of them
    for descriptors in images(seed, count=7, each=10):
        for word, descriptor in zip(vocabulary.learn(descriptors).tolist(), descriptors, strict=True):
            held.setdefault(word, descriptor)
    ids = np.array(sorted(held), np.int32)
    held = {word: held[word] for word in ids[vocabulary.held(ids) != NO_WORD].tolist()}
    [query] = images(seed + 1, count=1, each=20)
    query = np.concatenate([query, [held[word] for word in [*held][:10]]]).astype(np.uint8)
    for leave in (vocabulary.born(left), (0, 0), (3, 9), (0, len(vocabulary))):
        others = {word: row for word, row in held.items() if not leave[0] <= word < leave[1]}
        found = vocabulary.match(query, leave=leave)
        assert found.dtype == np.int32
        assert found.tolist() == without(others, query, switches[0])


@given(st.integers(0, 10_000), SWITCHES)
def test_every_word_was_born_with_the_image_that_had_it_first(seed, switches):
    vocabulary, first = with_switches(switches), {}
    session = images(seed, count=6)
    session.insert(2, session[0])  # an image that gives nothing new, or little
    for image, descriptors in enumerate(session):
        for word in vocabulary.learn(descriptors).tolist():
            first.setdefault(word, image)
    stored = Vocabulary.from_arrays(vocabulary.arrays(), vocabulary.switches)
    for one in (vocabulary, stored):
        for image in range(len(session)):
            assert [*range(*one.born(image))] == [word for word in sorted(first) if first[word] == image]


@pytest.mark.parametrize("purge", [False, True])
def test_lists_around_pivots_keep_the_switches(monkeypatch, purge):
    monkeypatch.setattr(pivots, "WORDS_PER_PIVOT", 4)
    rng = np.random.default_rng(0)
    seen = [rng.integers(0, 256, (60, 32), dtype=np.uint8) for _ in range(4)]
    walk = [seen[i // 2 % 4] ^ (rng.random((60, 32)) < 0.02).astype(np.uint8) for i in range(12)]
    walk.insert(5, rng.integers(0, 256, (60, 32), dtype=np.uint8))  # a place that is passed once
    switches = (0.8, "other_place", purge)
    exact, listed = with_switches(switches), with_switches(switches, exact_below=64)
    listed.words.depth = 8  # 64 lists or more: all of them
    for descriptors in walk:
        assert list(listed.learn(descriptors)) == list(exact.learn(descriptors))
    assert listed.words._pivots is not None
    assert len(listed.words) == len(exact.words) == (240 if purge else 300)


def test_distinct_rows_keep_the_order_of_first_appearance():
    rows = np.zeros((5, 32), np.uint8)
    rows[:, 7], rows[:, 31] = [3, 1, 3, 2, 1], [0, 9, 0, 0, 9]
    first, back = distinct_rows(rows)
    assert first.tolist() == [0, 1, 3]
    assert back.tolist() == [0, 1, 0, 2, 1]
