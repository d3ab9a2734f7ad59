import itertools

import pytest

from fdslam.config import Nclt
from fdslam.data.nclt.sessions import SEASONS, session_date, session_label, session_pairs
from fdslam.errors import InputError


def test_seasons_stand_for_dates_and_are_shown():
    assert [session_date(name) for name in ("WI", "sp", "2012-02-05")] == ["2012-01-22", "2012-03-31", "2012-02-05"]
    assert [session_label(date) for date in ("2012-08-04", "2012-11-17", "2013-01-10")] == ["SU", "AU", "2013-01-10"]


@pytest.mark.parametrize("name", ["", "XX", "20120122", "2012-13-01", "2012-01-22_lb3", "../2012-01-22", "2012-W04-7"])
def test_what_is_no_session_is_named(name):
    with pytest.raises(InputError, match="no session; give a date"):
        session_date(name)


def test_all_means_the_twelve_ordered_pairs_of_the_paper():
    pairs = session_pairs("all", "all", Nclt().sessions)
    assert len(pairs) == 12
    assert set(pairs) == set(itertools.permutations(SEASONS.values(), 2))


def test_all_for_either_and_sessions_named_twice():
    assert session_pairs("WI", "all", ["SU", "WI", "2012-01-22"]) == (("2012-01-22", "2012-08-04"),)
    assert session_pairs("all", "2013-01-10", ["SU", "AU"]) == (
        ("2012-08-04", "2013-01-10"),
        ("2012-11-17", "2013-01-10"),
    )


@pytest.mark.parametrize(("query", "map"), [("WI", "WI"), ("2012-01-22", "WI"), ("SU", "all")])
def test_a_session_is_no_pair_with_itself(query, map):
    with pytest.raises(InputError, match=f"dataset.query={query} dataset.map={map}: no pair"):
        session_pairs(query, map, ["SU"])
