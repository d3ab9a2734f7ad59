"""Settings of the library that would have no effect, or ask what a live image has not."""

import pytest

from fdslam import ChangeDetector
from fdslam.errors import InputError
from fdslam.settings import as_words
from tests.test_api import SETTINGS


def test_words_become_keys_and_values():
    assert as_words(["obb=j_b", " bow.grid =4", "mask.weights=a=b"]) == {
        "obb": "j_b", "bow.grid": "4", "mask.weights": "a=b",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("mode=paper", "settings: mode is no setting here; give mode=… itself, --mode on the command line"),
        ("mix.rows=[PC]", r"mix\.rows is no setting here; give detectors=…"),
        ("mix=fd_ad", "mix is no setting here; give detectors=…"),
        ("store=elsewhere", "store is no setting here; give store=…"),
        ("dataset.root=photos", r"dataset\.root is no setting here; the images are those that are given"),
        ("evaluation.viewpoint=true", "of a live image the true place is not known"),
        ("mask=labels", "a live image has no label image"),
        ("device=tpu", "device=tpu: choose cpu or cuda"),
        ("device=cuda:64", "torch finds . CUDA devices here; run with device=cpu"),
    ],
)
def test_what_has_no_effect_or_no_sense_is_refused_at_once(setting, said):
    with pytest.raises(InputError, match=said):
        ChangeDetector("paper", "FD", [*SETTINGS, setting])


def test_one_text_is_no_list():
    with pytest.raises(InputError, match=r"one text; give a list of them, \['obb=j_b'\]"):
        ChangeDetector(settings="obb=j_b")
