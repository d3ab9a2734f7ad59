import logging
import threading

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

import fdslam.onnx_model as module
from fdslam.errors import InputError
from fdslam.onnx_model import load_model, make_session
from fdslam.store import sha256_file
from tests.onnx_models import colour_finder, constant, model


@pytest.fixture
def path(tmp_path):
    return colour_finder(
        tmp_path / "m.onnx", "yolox", metadata={"fdslam.layout": "YOLOX", "fdslam.odd": "value", "layout": "none"}
    )


def load(path, **changes):
    return load_model(path, "some.weights", "fetch it", **changes)


def test_what_a_model_says_of_itself(path):
    found = load(path)
    assert found.digest == sha256_file(path)
    assert (found.height, found.width, found.planar, found.dtype) == (64, 64, True, np.float32)
    assert (found.provider, found.outputs) == ("CPUExecutionProvider", ("output",))
    assert found.says("layout", ("yolox", "yolov5")) == "yolox"
    assert found.says("nothing", ("a",)) == ""
    with pytest.raises(InputError, match=r"its metadata say fdslam\.odd=value; known are a, b"):
        found.says("odd", ("a", "b"))


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("{0: 'person', 1: 'car'}", ("person", "car")),
        ('{"1": "car", "0": "person"}', ("person", "car")),
        ('["person", "car"]', ("person", "car")),
        ("{0: 'a', 2: 'b'}", ()),
        ("{'a': 0}", ()),
        ("person, car", ()),
        ("__import__('os')", ()),
        ("[" * 500, ()),
        ("3", ()),
        ("", ()),
    ],
)
def test_names_of_the_metadata(text, names, tmp_path):
    assert load(colour_finder(tmp_path / "m.onnx", "yolov8", metadata={"names": text})).names() == names


@pytest.mark.parametrize(
    ("text", "numbers"), [("8 16 32", (8, 16, 32)), ("[0.5, 2]", (0.5, 2)), ("255", (255,)), ("", ())]
)
def test_numbers_of_the_metadata(text, numbers, tmp_path):
    found = load(colour_finder(tmp_path / "m.onnx", "yolov8", metadata={"fdslam.mean": text}))
    assert found.numbers("mean") == numbers
    found = load(colour_finder(tmp_path / "m.onnx", "yolov8", metadata={"fdslam.mean": "1 nan"}))
    with pytest.raises(InputError, match=r"fdslam\.mean=1 nan; numbers are needed"):
        found.numbers("mean")


def test_sizes_that_are_free_and_planes_that_are_last(tmp_path):
    free = load(colour_finder(tmp_path / "free.onnx", "yolox", dynamic=True))
    assert (free.height, free.width) == (None, None)
    last = load(colour_finder(tmp_path / "last.onnx", "yolox", planar=False))
    assert (last.height, last.width, last.planar) == (64, 64, False)
    image = np.random.default_rng(0).uniform(0, 255, (64, 64, 3)).astype(np.float32)
    assert np.array_equal(last.run(image)[0], free.run(image)[0])


def test_a_session_is_made_once(path):
    made = []

    def make():
        made.append(load(path).session)

    threads = [threading.Thread(target=make) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({id(session) for session in made}) == 1
    assert load(path, threads=2).session is not made[0]
    assert load(path, threads=2).session.get_session_options().intra_op_num_threads == 2
    assert load(path).identity == load(path, threads=2).identity


def test_other_bytes_are_another_model(path):
    before = load(path)
    colour_finder(path, "yolov8")
    assert load(path).digest != before.digest
    assert load(path).session is not before.session


def broken(path, kind):
    data = path.read_bytes()
    if kind == "missing":
        path.unlink()
    elif kind == "folder":
        path.unlink()
        path.mkdir()
    else:
        path.write_bytes(
            {
                "empty": b"",
                "truncated": data[:-50],
                "half": data[: len(data) // 2],
                "page": b"<!DOCTYPE html><html>log in first</html>",
                "torch": b"PK\x03\x04archive/data.pkl",
                "text": b"this is no model at all",
            }[kind]
        )


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("missing", "m.onnx: no such file; fetch it"),
        ("folder", "m.onnx: a folder; give the .onnx file in it"),
        ("empty", "m.onnx: an empty file; copy or download it again"),
        ("truncated", "m.onnx: not a whole ONNX model .*copy or download it again"),
        ("half", "m.onnx: not a whole ONNX model"),
        ("page", "m.onnx: a web page and no ONNX model"),
        ("torch", "m.onnx: a zip or PyTorch file and no ONNX model; export the model to ONNX first"),
        ("text", "m.onnx: not a whole ONNX model"),
    ],
)
def test_a_file_that_is_no_model_is_one_line(path, kind, said, capfd):
    broken(path, kind)
    with pytest.raises(InputError, match=said) as raised:
        load(path)
    assert str(raised.value).startswith("some.weights=")
    assert "\n" not in str(raised.value)
    assert capfd.readouterr() == ("", "")  # nor does onnxruntime print anything


def test_a_name_that_no_file_has():
    with pytest.raises(InputError, match=r"some\.weights"):
        load("a\0b")
    with pytest.raises(InputError, match=r"some\.weights"):
        load("x" * 5000)


def test_the_digest_beside_it_is_held_against_it(path):
    note = path.with_name("m.onnx.sha256")
    note.write_text(f"{sha256_file(path)}  m.onnx\n")
    load(path)
    path.write_bytes(path.read_bytes() + b"\n")
    with pytest.raises(InputError, match=r"its sha256 is .*, and m\.onnx\.sha256 says .*has changed since it came"):
        load(path)
    note.write_text("")
    with pytest.raises(InputError, match=r"m\.onnx\.sha256 says nothing"):
        load(path)


@pytest.mark.parametrize(
    ("shape", "said"),
    [
        ((4, 3, 64, 64), r"tensor\(float\) \[4, 3, 64, 64\]; float \[1, 3, height, width\]"),
        ((1, 1, 64, 64), r"\[1, 1, 64, 64\]"),
        ((3, 64, 64), r"\[3, 64, 64\]"),
    ],
)
def test_an_input_that_is_no_image(tmp_path, shape, said):
    constant(tmp_path / "m.onnx", np.zeros((1, 2)), shape=shape)
    with pytest.raises(InputError, match=said):
        load(tmp_path / "m.onnx")


def test_two_inputs(tmp_path):
    nodes = [helper.make_node("Add", ["images", "size"], ["y"])]
    inputs = [("images", (1, 3, 4, 4)), ("size", (1,))]
    onnx.save(model(nodes, inputs, [("y", (1, 3, 4, 4))]), tmp_path / "m.onnx")
    with pytest.raises(InputError, match=r"has 2 inputs \(images, size\)"):
        load(tmp_path / "m.onnx")


def test_weights_in_another_file(tmp_path):
    array = np.ones((1, 3, 64, 64), np.float32)
    nodes = [helper.make_node("Add", ["images", "c"], ["y"])]
    made = model(nodes, [("images", array.shape)], [("y", array.shape)], [("c", array)])
    onnx.save(made, tmp_path / "m.onnx", save_as_external_data=True, location="m.data", size_threshold=0)
    with pytest.raises(InputError, match="its weights lie in another file; save it as one ONNX file"):
        load(tmp_path / "m.onnx")


def test_half_precision(tmp_path):
    graph = helper.make_graph(
        [helper.make_node("Identity", ["x"], ["y"])],
        "half",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT16, [1, 3, 4, 4])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT16, [1, 3, 4, 4])],
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=10)
    onnx.save(made, tmp_path / "m.onnx")
    [found] = load(tmp_path / "m.onnx").run(np.full((4, 4, 3), 0.5, np.float32))
    assert (found == 0.5).all()


def test_a_size_that_it_does_not_run_on(tmp_path):
    found = load(colour_finder(tmp_path / "free.onnx", "yolox", dynamic=True))  # its boxes are those of 64×64
    with pytest.raises(InputError, match="does not run on one image of 96×96 pixels"):
        found.run(np.zeros((96, 96, 3), np.float32))


def test_cuda_only_where_onnxruntime_has_it_and_said_where_not(path, monkeypatch, caplog):
    with caplog.at_level(logging.WARNING):
        assert load(path, device="cuda").provider == "CPUExecutionProvider"
    assert "device=cuda: this onnxruntime cannot use it" in caplog.text
    monkeypatch.setattr(module.onnxruntime, "get_available_providers", lambda: ["CUDAExecutionProvider"])
    assert module._provider("cuda:0") == "CUDAExecutionProvider"
    assert module._provider("cpu") == "CPUExecutionProvider"


def test_a_part_of_a_model_is_run_as_the_whole(path, tmp_path):
    found = load(path)
    image = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.float32)
    part = onnx.load(path)
    del part.graph.output[:]
    part.graph.output.append(helper.make_tensor_value_info("p8", TensorProto.FLOAT, [1, 3, 8, 8]))
    session = make_session("part", part.SerializeToString(), 1, found.provider)
    [pooled] = found.run_part(session, image)
    assert np.allclose(pooled[0].transpose(1, 2, 0), image.reshape(8, 8, 8, 8, 3).mean(axis=(1, 3)), rtol=1e-5)
    assert np.array_equal(found.run_part(found.session, image)[0], found.run(image)[0])
    last = load(colour_finder(tmp_path / "last.onnx", "yolox", planar=False))
    assert np.array_equal(last.run_part(last.session, image)[0], found.run(image)[0])
    with pytest.raises(InputError, match=r"m\.onnx: does not run on one image of 32×64 pixels"):
        found.run_part(session, image[:32])
    with pytest.raises(InputError, match="part: not a whole ONNX model"):
        make_session("part", b"torn", 1, found.provider)
