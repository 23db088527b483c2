"""The process of the networks: right answers through it, and one clear sentence for every way in which a model can go wrong."""

import io
import os
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from feature_samples import GREY, glue, pair, rows
from onnx_files import FLOAT, INT64, image_net, node, write_onnx
from process_ends import alive, wait_for

from core.errors import FeatureError
from core.features.extractors.aliked import Aliked
from core.features.extractors.superpoint import SuperPoint
from core.features.matchers.lightglue import LightGlue
from core.features.nets.messages import unpack_features, unpack_matches
from core.features.nets.process import NetProcess, Nets, RemoteExtractor, RemoteMatcher
from core.features.types import Features
from core.processes.child import Child
from core.processes.wire import WireError, receive, send

pytestmark = pytest.mark.process


def aliked_net(path, **more):
    places = (2 * np.array([[3, 5], [60, 40]]) / [95, 63] - 1).astype(np.float32)
    parts = {"keypoints": places, "descriptors": rows(2), "scores": np.array([0.9, 0.5], np.float32)} | more
    return image_net(path, 3, **parts)


def nothing_net(path):
    """A SuperPoint-like network that dies where it finds nothing: OpenCV divides by the number of rows to gather."""
    nodes = [
        node("NonZero", ["image"], ["found"]),
        node("Transpose", ["found"], ["keypoints"]),
        node("GatherND", ["image", "keypoints"], ["scores"]),
        node("Identity", ["d"], ["descriptors"]),
    ]
    outputs = {"keypoints": (INT64, ("n", 4)), "scores": (FLOAT, ("n",)), "descriptors": (FLOAT, (1, 2, 16))}
    return write_onnx(path, nodes, {"d": rows(2)[None]}, {"image": (FLOAT, (1, 1, "h", "w"))}, outputs)


def extractor(kind, model, **more):
    process = NetProcess(Nets(kind, str(model)), **more)
    return process, RemoteExtractor(process, model.name)


def hurt(tmp_path, monkeypatch, body):
    """From now on the network of a child of ours does `body` instead of finding features."""
    code = f"""
    import os, sys, time
    if any("nets.worker" in a for a in sys.orig_argv):
        import core.features.extractors.aliked as module
        def extract(self, grey, mask=None):
            {body}
        module.Aliked.extract = extract
    """
    (tmp_path / "sitecustomize.py").write_text(textwrap.dedent(code))
    monkeypatch.syspath_prepend(str(tmp_path))


def test_the_answer_is_that_of_the_adapter(tmp_path, children):
    model = aliked_net(tmp_path / "a.onnx")
    process, remote = extractor("aliked", model)
    assert children == [], "no process before the first image"
    mask = np.zeros(GREY.shape, bool)
    mask[:, 50:] = True
    here = Aliked(model).extract(GREY)
    for _ in range(3):
        there = remote.extract(GREY)
        np.testing.assert_array_equal(there.keypoints, here.keypoints)
        np.testing.assert_array_equal(there.descriptors, here.descriptors)
        assert there.size == here.size == (90, 50)
    assert remote.extract(GREY, mask).keypoints.tolist() == here.keypoints[1:].tolist()
    assert len(children) == 1
    process.close()
    process.close()
    with pytest.raises(FeatureError, match="has ended"):
        remote.extract(GREY)


def test_matches_through_the_process(tmp_path, children):
    a, b = pair()
    model = glue(tmp_path / "g.onnx", np.array([[0, 3], [4, 0]]), np.array([0.9, 0.7], np.float32))
    process = NetProcess(Nets(matcher="lightglue", matcher_model=str(model)))
    remote = RemoteMatcher(process, "g.onnx")
    assert remote.match(a, b).indices.tolist() == LightGlue(model).match(a, b).indices.tolist() == [[0, 3], [4, 0]]
    assert len(remote.match(a, Features(np.zeros((0, 2)), rows(0)))) == 0
    process.close()


def test_many_threads_get_their_own_answers(tmp_path, children):
    process, remote = extractor("aliked", aliked_net(tmp_path / "a.onnx"))
    sizes = [(90 + 3 * i, 50 + i) for i in range(6)]
    got = {}
    threads = [
        threading.Thread(target=lambda s=s: got.update({s: remote.extract(np.zeros(s[::-1], np.uint8)).size})) for s in sizes
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert got == {s: s for s in sizes}
    process.close()


@pytest.mark.parametrize("what", ["text", "empty", "no features", "not a number", "cut"])
def test_a_model_that_is_none_is_one_sentence(tmp_path, children, what):
    model = tmp_path / "wrong.onnx"
    if what == "no features":
        image_net(model, 3, other=rows(2))
    elif what == "not a number":
        aliked_net(model, descriptors=np.full((2, 16), np.nan, np.float32))
    else:
        whole = aliked_net(tmp_path / "a.onnx").read_bytes()
        model.write_bytes({"text": b"just text\n" * 50, "empty": b"", "cut": whole[: len(whole) // 2]}[what])
    process, remote = extractor("aliked", model)
    with pytest.raises(FeatureError, match=r"^The model 'wrong.onnx' (does not work|ended the process)") as error:
        remote.extract(GREY)
    assert "\n" not in str(error.value)
    assert str(error.value).endswith(".")
    process.close()


def test_a_crash_is_one_sentence_and_the_next_image_gets_a_new_process(tmp_path, monkeypatch, children):
    hurt(tmp_path, monkeypatch, "os.abort()")
    process, remote = extractor("aliked", aliked_net(tmp_path / "a.onnx"))
    for count in (1, 2):
        with pytest.raises(FeatureError, match=r"'a.onnx' ended the process that ran it \(exit code -?\d+"):
            remote.extract(GREY)
        assert len(children) == count
    process.close()


@pytest.mark.skipif(os.name == "nt", reason="exit codes of signals")
def test_a_network_that_finds_nothing_and_dies_of_it_found_nothing(tmp_path, children):
    model = nothing_net(tmp_path / "sp.onnx")
    process, remote = extractor("superpoint", model)
    assert len(remote.extract(np.zeros((40, 40), np.uint8))) == 0
    assert len(remote.extract(np.zeros((40, 40), np.uint8))) == 0
    assert len(children) == 2, "it did die; a child that lives would make this test empty"
    process.close()


def test_a_network_that_hangs_is_ended(tmp_path, monkeypatch, children):
    hurt(tmp_path, monkeypatch, "time.sleep(600)")
    process, remote = extractor("aliked", aliked_net(tmp_path / "a.onnx"), limit_s=3.0)
    with pytest.raises(FeatureError, match="gave no answer in 3 s"):
        remote.extract(GREY)
    process.close()


def test_close_ends_a_request_in_the_middle(tmp_path, monkeypatch, children):
    hurt(tmp_path, monkeypatch, "time.sleep(600)")
    process, remote = extractor("aliked", aliked_net(tmp_path / "a.onnx"))
    said = []

    def ask():
        try:
            remote.extract(GREY)
        except FeatureError as error:
            said.append(str(error))

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    while not children:
        time.sleep(0.01)
    time.sleep(0.3)
    began = time.monotonic()
    process.close()
    for thread in threads:
        thread.join(10)
    assert time.monotonic() - began < 5
    assert len(said) == 3
    assert all("has ended" in words for words in said)
    assert len(children) == 1


def test_what_a_library_prints_does_not_get_between_the_answers(tmp_path, monkeypatch, children):
    hurt(tmp_path, monkeypatch, "os.write(1, b'hello'); print('world'); raise ValueError('no luck')")
    process, remote = extractor("aliked", aliked_net(tmp_path / "a.onnx"))
    with pytest.raises(FeatureError, match="does not work: no luck"):
        remote.extract(GREY)
    process.close()


def test_a_child_ends_with_its_input_even_when_it_hangs(tmp_path, monkeypatch):
    hurt(tmp_path, monkeypatch, "time.sleep(600)")
    child = Child("features.nets.worker")
    send(child.stdin, vars(Nets("aliked", str(aliked_net(tmp_path / "a.onnx")))))
    send(child.stdin, {"do": "extract"}, [GREY])
    time.sleep(0.5)
    assert child.exit_code() is None
    child.stdin.close()
    assert child.exit_code(10) == 0
    child.close()


@pytest.mark.skipif(os.name == "nt", reason="SIGKILL")
def test_a_parent_that_is_killed_leaves_no_child(tmp_path, monkeypatch):
    """The network hangs at that moment; so it is when a batch, or Blender, is ended by force."""
    hurt(tmp_path, monkeypatch, f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(600)")
    code = f"""
    import numpy as np
    from core.features.nets.process import NetProcess, Nets, RemoteExtractor
    process = NetProcess(Nets("aliked", {str(aliked_net(tmp_path / "a.onnx"))!r}))
    RemoteExtractor(process, "a").extract(np.zeros((64, 64), np.uint8))
    """
    search = os.pathsep.join([str(Path(__file__).parents[3]), str(tmp_path)])
    parent = subprocess.Popen([sys.executable, "-c", textwrap.dedent(code)], env={**os.environ, "PYTHONPATH": search})
    pid_file = tmp_path / "pid"
    wait_for(lambda: pid_file.exists() and pid_file.read_text())
    child = int(pid_file.read_text())
    assert alive(child)
    parent.kill()
    parent.wait()
    wait_for(lambda: not alive(child))


# ---- what comes through the pipe is data, whoever sent it


def test_messages_come_back_as_they_went():
    arrays = [GREY, rows(3), np.arange(6).reshape(3, 2), np.zeros((0, 2)), GREY[::2, ::3]]
    pipe = io.BytesIO()
    send(pipe, {"do": "x"}, arrays)
    pipe.seek(0)
    header, back = receive(pipe)
    assert header["do"] == "x"
    for a, b in zip(arrays, back, strict=True):
        np.testing.assert_array_equal(a, b)
        assert a.dtype == b.dtype
    assert receive(pipe) is None


@pytest.mark.parametrize(
    "line",
    [
        b"hello\n",
        b"{}\n",
        b"[1]\n",
        b'{"arrays": [["O", [1]]]}\n12345678',
        b'{"arrays": [["<f4", [-1]]]}\n',
        b'{"arrays": [["<f4", [1000000, 1000000]]]}\n',
        b'{"arrays": [["<f4", [8]]]}\n1234',
        b'{"arrays": [["<f4", [1,1,1,1]]]}\n1234',
        b'{"arrays": ' + b"[" * 70_000,
    ],
)
def test_what_is_no_message_is_refused(line):
    with pytest.raises(WireError):
        receive(io.BytesIO(line))


def test_features_and_matches_that_are_none_are_refused():
    good = [np.zeros((3, 2)), rows(3)]
    assert len(unpack_features({"size": [4, 5]}, good)) == 3
    bad = [
        [good[0]],
        [good[0][:2], good[1]],
        [good[0] * np.nan, good[1]],
        [good[0].astype(np.float32), good[1]],
        [good[1], good[1]],
    ]
    for arrays in bad:
        with pytest.raises(WireError):
            unpack_features({"size": [4, 5]}, arrays)
    with pytest.raises(WireError):
        unpack_features({"size": "wide"}, good)
    scores = np.ones(1, np.float32)
    assert len(unpack_matches([np.array([[1, 2]]), scores], 2, 3)) == 1
    for indices in ([[2, 0]], [[0, 3]], [[-1, 0]], [[0, 1], [1, 1]], [0, 1]):
        with pytest.raises(WireError):
            unpack_matches([np.array(indices), scores], 2, 3)


def test_superpoint_through_the_process_is_the_adapters(tmp_path, children):
    index, scores = np.array([[[3, 5], [10, 20]]]), np.array([[0.5, 0.9]], np.float32)
    model = image_net(tmp_path / "net.onnx", 1, keypoints=index, scores=scores, descriptors=rows(2)[None])
    process, remote = extractor("superpoint", model)
    np.testing.assert_array_equal(remote.extract(GREY).descriptors, SuperPoint(model).extract(GREY).descriptors)
    process.close()
