import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow.documents import ObbDocuments, best_of
from fdslam.bow.index import IDF_ONE
from tests.bow.test_index import scene
from tests.reference import refinement


@given(st.integers(0, 10_000), st.integers(0, 4))
def test_scores_of_obb_documents_equal_the_loops(seed, boxes):
    map_words, words, query, inside = scene(seed)
    rng = np.random.default_rng(seed)
    map_inside = [rng.random((boxes, len(w))) < 0.3 for w in map_words]
    expected = refinement.document_scores([list(w) for w in map_words], map_inside, list(query), inside, IDF_ONE)
    documents = ObbDocuments.post(map_words, map_inside, words)
    assert documents.scores(query, inside, "ibow").tolist() == expected
    assert documents.nbytes > documents.index.nbytes or not len(documents.owner)


def test_an_image_is_as_good_as_its_best_document():
    owner = np.array([0, 0, 2, 2, 2], np.int32)
    scores = np.array([[3, 5, 0, 7, 1], [0, 0, 0, 0, 0]], np.int64)
    assert best_of(scores, owner, 4).tolist() == [[5, 0, 7, 0], [0, 0, 0, 0]]
    assert best_of(scores[:, :0], owner[:0], 2).tolist() == [[0, 0], [0, 0]]
    assert best_of(scores[:0], owner, 4).shape == (0, 4)
