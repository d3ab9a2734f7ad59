"""Exported autoencoders against torch, score by score, and the command that writes them."""

import csv

import cv2
import numpy as np
import pytest

from fdslam import export_autoencoders
from fdslam.autoencoder import onnx_place
from fdslam.autoencoder.network import prepare
from fdslam.autoencoder.onnx_place import OnnxPlace, export_place
from fdslam.autoencoder.places import fit_places
from fdslam.autoencoder.scoring import error_to_cells, reconstruction_error, z_score
from fdslam.errors import InputError
from tests.autoencoder.scenes import SIZE, SMALL, place
from tests.data.worlds import small_world

QUICK = ["ad.k=2", "ad.epochs=1", "ad.folds=2", "ad.channels=2", "ad.latent=4", "ad.pixels=1024"]


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    pytest.importorskip("onnx", reason="onnx is not installed (extra export)")
    pytest.importorskip("onnxscript", reason="onnxscript is not installed (extra export)")
    [model] = fit_places([place(5)], SMALL, seed=0)
    path = tmp_path_factory.mktemp("onnx") / "place.onnx"
    export_place(model, SIZE, path)
    return model, path


@pytest.mark.parametrize("kind", ["l1", "ssim", "gradient"])
def test_scores_are_those_of_torch(exported, kind):
    model, path = exported
    image = cv2.resize(np.random.default_rng(0).integers(0, 256, (9, 12, 3), dtype=np.uint8), (120, 80))
    expected = reconstruction_error(model.weights, prepare([image], SIZE), kind=kind)[0]
    expected = z_score(expected, *model.held_out[kind])
    found = OnnxPlace.load(path)
    np.testing.assert_allclose(found.z(image, kind), expected, atol=1e-3)
    assert expected.std() > 0.1
    np.testing.assert_allclose(found.cells(image, kind), error_to_cells(expected, 80, 120), atol=1e-3)


def test_another_model_or_error_is_refused(exported, tmp_path):
    _, path = exported
    with pytest.raises(InputError, match="no such file; python -m fdslam"):
        OnnxPlace.load(tmp_path / "none.onnx")
    with pytest.raises(InputError, match="no μ and σ of the error l2"):
        OnnxPlace.load(path).z(np.zeros((8, 8, 3), np.uint8), "l2")


def test_without_the_extra_one_line_says_so(monkeypatch):
    monkeypatch.setattr(onnx_place.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'fdslam\[export\]'"):
        onnx_place.check_export()


def test_the_command_writes_all_places(exported, tmp_path, capsys):
    root = small_world(tmp_path / "world")
    out, given = tmp_path / "out", ["dataset=folder", f"dataset.root={root}", f"store={tmp_path / 'store'}", *QUICK]
    assert export_autoencoders.main([str(out), *given]) == 0
    assert "2 models written" in capsys.readouterr().out
    assert sorted(path.name for path in out.iterdir()) == ["place_0.onnx", "place_1.onnx", "places.csv"]
    rows = list(csv.DictReader((out / "places.csv").open()))
    assert [row["map_file"] for row in rows] == [f"map/{i:02d}.png" for i in range(6)]
    assert {row["place"] for row in rows} == {"0", "1"}
    assert OnnxPlace.load(out / "place_1.onnx").z(np.zeros((40, 60, 3), np.uint8)).ndim == 2
    assert export_autoencoders.main([str(out), *given]) == 0  # over the same places
    (out / "place_x.onnx").touch()  # nobody's
    before = {path: path.read_bytes() for path in out.iterdir()}
    capsys.readouterr()
    assert export_autoencoders.main([str(out), *given, "ad.k=1"]) == 2
    assert "holds place_1.onnx, of an export with more places than the 1 of this map" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (["out", "ad.k=0"], "ad.k=0: out of range"),
        (["out", "ad.kk=1"], "unknown key 'ad.kk'"),
        (["out", "dataset=folder", "dataset.root=/nowhere"], "no such folder"),
    ],
)
def test_the_command_says_in_one_line_what_is_wrong(given, says, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert export_autoencoders.main(given) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert export_autoencoders.main([]) == 2
    assert export_autoencoders.main(["--help"]) == 0
