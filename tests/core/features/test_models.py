"""Known models and the downloader, against a web server on this machine that does all that a bad one does."""

import contextlib
import errno
import hashlib
import threading
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest

from core.errors import FeatureError
from core.features.nets import models
from core.features.nets.download import DownloadError, download
from core.features.nets.models import KNOWN, KnownModel, address, find_model, recognise

SHARED = Path(__file__).resolve().parents[4] / "shared" / "models"
DATA = np.random.default_rng(0).integers(0, 256, 400_000, np.uint8).tobytes()
MODEL = KnownModel("net.onnx", "Net", "aliked", len(DATA), hashlib.sha256(DATA).hexdigest(), "BSD", "Keep it.", "nowhere")


class Server(ThreadingHTTPServer):
    """Serves DATA; `requests` holds (path, Range) of each; `cut` ends an answer after so many bytes, once."""

    daemon_threads = True

    def __init__(self):
        self.requests, self.cut, self.parts, self.body = [], None, True, DATA
        super().__init__(("127.0.0.1", 0), Handler)

    @property
    def url(self):
        return f"http://127.0.0.1:{self.server_port}"


class Handler(BaseHTTPRequestHandler):
    def log_message(self, *_):
        pass

    def do_GET(self):
        server, wanted = self.server, self.headers.get("Range")
        server.requests.append((self.path, wanted))
        if self.path == "/moved/net.onnx":
            self.send_response(302)
            self.send_header("Location", f"{server.url}/net.onnx")
            self.end_headers()
            return
        if self.path == "/moved-to-file/net.onnx":
            self.send_response(302)
            self.send_header("Location", "file:///etc/hostname")
            self.end_headers()
            return
        if self.path != "/net.onnx":
            self.send_error(404)
            return
        start = int(wanted.removeprefix("bytes=").rstrip("-")) if wanted and server.parts else 0
        if start >= len(server.body):
            self.send_error(416)
            return
        self.send_response(206 if start else 200)
        if start:
            self.send_header("Content-Range", f"bytes {start}-{len(server.body) - 1}/{len(server.body)}")
        self.send_header("Content-Length", str(len(server.body) - start))
        self.end_headers()
        body, server.cut = server.body[start:][: server.cut], None
        with contextlib.suppress(OSError):
            self.wfile.write(body)


@pytest.fixture
def server():
    with Server() as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def fetch(url, folder, model=MODEL, **more):
    """(path, fractions) of a download run to its end."""
    steps, seen = download(model, url, folder, **more), []
    while True:
        try:
            seen.append(next(steps).fraction)
        except StopIteration as end:
            return end.value, seen


def refused(words, url, folder, **more):
    with pytest.raises(DownloadError, match=words) as error:
        fetch(url, folder, **more)
    assert "\n" not in str(error.value)
    assert str(error.value).endswith(".")
    assert not (folder / "net.onnx").exists(), "a file under its own name is whole and right"


def test_a_file_comes_whole_and_is_not_fetched_twice(server, tmp_path):
    path, seen = fetch(server.url + "/net.onnx", tmp_path / "new" / "folder")
    assert path == tmp_path / "new" / "folder" / "net.onnx"
    assert path.read_bytes() == DATA
    assert [p.name for p in path.parent.iterdir()] == ["net.onnx"]
    assert seen == sorted(seen) and seen[0] == 0 and seen[-1] == 1 and len(seen) > 3
    assert fetch(server.url + "/net.onnx", path.parent) == (path, [1.0])
    assert server.requests == [("/net.onnx", None)]


def test_a_damaged_file_under_its_name_is_replaced(server, tmp_path):
    (tmp_path / "net.onnx").write_bytes(DATA[:-1] + b"?")
    assert fetch(server.url + "/net.onnx", tmp_path)[0].read_bytes() == DATA


def test_a_cut_connection_goes_on_from_there(server, tmp_path):
    server.cut = 150_000
    refused(r"broke off after 150000 of 400000 bytes.*goes on", server.url + "/net.onnx", tmp_path)
    assert (tmp_path / "net.onnx.part").read_bytes() == DATA[:150_000]
    path, seen = fetch(server.url + "/net.onnx", tmp_path)
    assert path.read_bytes() == DATA
    assert seen[0] == 150_000 / 400_000
    assert [r for _, r in server.requests] == [None, "bytes=150000-"]


def test_a_server_without_parts_sends_the_whole_again(server, tmp_path):
    (tmp_path / "net.onnx.part").write_bytes(DATA[:1000])
    server.parts = False
    assert fetch(server.url + "/net.onnx", tmp_path)[0].read_bytes() == DATA


def test_cancel_keeps_the_part_for_the_next_time(server, tmp_path):
    steps = download(MODEL, server.url + "/net.onnx", tmp_path)
    while next(steps).done < 100_000:
        pass
    steps.close()
    part = (tmp_path / "net.onnx.part").read_bytes()
    assert 100_000 <= len(part) < len(DATA)
    assert part == DATA[: len(part)]
    assert not (tmp_path / "net.onnx").exists()
    assert fetch(server.url + "/net.onnx", tmp_path)[0].read_bytes() == DATA
    assert server.requests[-1][1] == f"bytes={len(part)}-"


@pytest.mark.parametrize("body", [b"x" * len(DATA), DATA + b"more", DATA[:-1] + b"\0"])
def test_another_file_is_thrown_away(server, tmp_path, body):
    server.body = body
    refused("not 'net.onnx'.*thrown away", server.url + "/net.onnx", tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_part_of_another_file_is_thrown_away_and_the_next_try_is_whole(server, tmp_path):
    (tmp_path / "net.onnx.part").write_bytes(b"x" * 1000)
    refused("thrown away", server.url + "/net.onnx", tmp_path)
    assert fetch(server.url + "/net.onnx", tmp_path)[0].read_bytes() == DATA


def test_a_part_longer_than_the_file_is_started_anew(server, tmp_path):
    (tmp_path / "net.onnx.part").write_bytes(DATA + DATA)
    assert fetch(server.url + "/net.onnx", tmp_path)[0].read_bytes() == DATA


def test_a_file_that_shrank_on_the_server_is_one_sentence(server, tmp_path):
    (tmp_path / "net.onnx.part").write_bytes(DATA[:1000])
    server.body = DATA[:500]
    refused("broke off after 500 of", server.url + "/net.onnx", tmp_path)


def test_no_disk_space_is_one_sentence(server, tmp_path):
    class Full:
        def __init__(self, path, mode):
            self.file = path.open(mode)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            self.file.close()

        def write(self, chunk):
            if self.file.tell() > 100_000:
                raise OSError(errno.ENOSPC, "No space left on device")
            self.file.write(chunk)

    refused("No space left on device.*make room", server.url + "/net.onnx", tmp_path, opener=Full)
    assert fetch(server.url + "/net.onnx", tmp_path)[0].read_bytes() == DATA


def test_a_folder_that_is_a_file_is_one_sentence(server, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(DownloadError, match="cannot be written"):
        fetch(server.url + "/net.onnx", tmp_path / "file")


def test_redirects_are_followed_but_not_to_this_machines_files(server, tmp_path):
    assert fetch(server.url + "/moved/net.onnx", tmp_path)[0].read_bytes() == DATA
    assert [path for path, _ in server.requests] == ["/moved/net.onnx", "/net.onnx"]
    refused("answers 302", server.url + "/moved-to-file/net.onnx", tmp_path / "b")


def test_addresses_that_do_not_answer_are_one_sentence(server, tmp_path):
    refused("answers 404", server.url + "/gone.onnx", tmp_path)
    refused("is no web address", "file:///etc/hostname", tmp_path)
    refused("is no web address", "net.onnx", tmp_path)
    server.server_close()
    refused("cannot be reached", "http://127.0.0.1:1/net.onnx", tmp_path)


# ---- the table


def test_the_table_says_what_a_user_must_know():
    for model in KNOWN:
        assert len(model.sha256) == 64 and int(model.sha256, 16) > 0
        assert model.bytes > 100_000
        assert len(model.licence_text) > 80
        assert "2022 Zhao Xiaoming" in model.licence_text, "the licence asks for its notice to stay"
    assert len({m.name for m in KNOWN}) == len(KNOWN)


def test_without_an_address_the_user_is_told_what_to_do():
    with pytest.raises(FeatureError, match=r"No address is set to download ALIKED-T16.*put the file 'aliked-t16.*in by hand"):
        address(KNOWN[0], " ")
    assert address(KNOWN[0], "http://studio/models/ ") == "http://studio/models/aliked-t16-top2048.onnx"
    assert address(replace(KNOWN[0], url="http://own/x"), "http://studio") == "http://own/x"


def test_files_are_recognised_by_what_is_in_them(tmp_path, monkeypatch):
    monkeypatch.setattr(models, "KNOWN", (MODEL,))
    (tmp_path / "renamed.onnx").write_bytes(DATA)
    (tmp_path / "net.onnx").write_bytes(DATA[:-1] + bytes([DATA[-1] ^ 1]))
    assert recognise(tmp_path / "renamed.onnx") == MODEL
    assert recognise(tmp_path / "net.onnx") is None
    assert recognise(tmp_path / "none.onnx") is None
    assert recognise(tmp_path) is None
    assert find_model(tmp_path, "aliked") is None
    (tmp_path / "net.onnx").write_bytes(DATA)
    assert find_model(tmp_path, "aliked") == tmp_path / "net.onnx"
    assert find_model(tmp_path, "disk") is None


@pytest.mark.scan
@pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/models")
@pytest.mark.parametrize("model", KNOWN, ids=lambda m: m.name)
def test_the_real_files_are_recognised(model):
    assert recognise(SHARED / model.name) == model
