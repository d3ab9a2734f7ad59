import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow.vocabulary import NO_WORD, Vocabulary, distinct_rows, replay
from tests import reference


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
    vocabulary = Vocabulary(ratio)
    learned = [vocabulary.learn(d) for d in images(seed)]
    assert len(vocabulary) == len(words)
    assert [list(w) for w in learned] == posted
    query = images(seed + 1, count=1)[0]
    assert list(vocabulary.match(query)) == reference.match(query, words, ratio)


@given(st.integers(0, 10_000), st.integers(0, 4))
def test_replay_then_learn_is_learning_it_all(seed, stored):
    everything = Vocabulary(0.8)
    learned = [everything.learn(d) for d in images(seed)]
    resumed = Vocabulary(0.8)
    for _ in replay(resumed, zip(images(seed)[:stored], learned[:stored], strict=True)):
        pass
    rest = [resumed.learn(d) for d in images(seed)[stored:]]
    assert [list(w) for w in rest] == [list(w) for w in learned[stored:]]
    assert len(resumed) == len(everything)


def test_without_two_words_nothing_is_matched():
    vocabulary = Vocabulary(0.8)
    one = np.zeros((1, 32), np.uint8)
    assert list(vocabulary.match(one)) == [NO_WORD]
    assert list(vocabulary.learn(one)) == [0]
    assert list(vocabulary.match(one)) == [NO_WORD]  # one word has no second nearest
    assert vocabulary.learn(np.zeros((0, 32), np.uint8)).shape == (0,)


def test_distinct_rows_keep_the_order_of_first_appearance():
    rows = np.zeros((5, 32), np.uint8)
    rows[:, 7], rows[:, 31] = [3, 1, 3, 2, 1], [0, 9, 0, 0, 9]
    first, back = distinct_rows(rows)
    assert first.tolist() == [0, 1, 3]
    assert back.tolist() == [0, 1, 0, 2, 1]
