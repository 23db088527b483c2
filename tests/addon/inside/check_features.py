"""Other features in Blender: the choice in the panel, model files in the preferences, and the download."""

import hashlib
import os
import sys
import threading
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from panels_drawn import Layout
from samples import counts

sys.path.append(str(Path(__file__).parents[2] / "core" / "support"))
from onnx_files import image_net

MODULE = "bl_ext.user_default.gssmc"
SHARED = Path(__file__).resolve().parents[4] / "shared" / "models"
NAME = "aliked-t16-top2048.onnx"


@pytest.fixture
def preferences(bpy):
    """The extension's preferences, empty again afterwards; online access is off."""
    own = bpy.context.preferences.addons[MODULE].preferences
    bpy.context.preferences.system.use_online_access = False
    yield own
    bpy.context.preferences.system.use_online_access = False
    for item in own.bl_rna.properties:
        if item.identifier.startswith(("model_", "base_")):
            own.property_unset(item.identifier)


@pytest.fixture
def tiny_aliked(tmp_path):
    """A network that finds the same 40 features in everything."""
    rng = np.random.default_rng(0)
    return str(
        image_net(
            tmp_path / "tiny.onnx",
            3,
            keypoints=rng.uniform(-0.9, 0.5, (40, 2)).astype(np.float32),
            descriptors=rng.normal(size=(40, 16)).astype(np.float32),
            scores=np.linspace(0.9, 0.1, 40, dtype=np.float32),
        )
    )


def refused(bpy, words, **arguments):
    before = counts(bpy)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.gssmc.refine(**arguments)
    message = str(error.value).strip()
    assert words in message
    assert "Traceback" not in message and "\n" not in message
    assert counts(bpy) == before


def children():
    """Processes that this one has started and that still run (Linux)."""
    return set(Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()) if sys.platform == "linux" else set()


def test_the_panel_offers_what_the_engine_has(bpy, extension):
    registry = extension("core.features.registry")
    rna = bpy.context.scene.gssmc.bl_rna.properties
    assert list(rna["features"].enum_items.keys()) == [*registry.EXTRACTORS, "auto"]
    assert list(rna["matcher"].enum_items.keys()) == list(registry.MATCHERS)
    assert "model" not in rna, "model files are the user's, not the scene's"
    own = bpy.context.preferences.addons[MODULE].preferences.bl_rna.properties
    files = {item.identifier for item in own if item.identifier.startswith("model_")}
    assert files == {f"model_{name}" for name in ("aliked", "disk", "superpoint", "lightglue")}


def test_settings_take_the_model_of_the_choice(bpy, extension, preferences, tmp_path):
    properties = extension("gssmc_addon.registration.settings")
    settings = bpy.context.scene.gssmc
    preferences.model_aliked, preferences.model_lightglue = str(tmp_path / "a.onnx"), str(tmp_path / "g.onnx")
    assert properties.settings_from(settings).model == ""
    for choice in ("aliked", "auto"):
        settings.features = choice
        assert properties.settings_from(settings).model == str(tmp_path / "a.onnx")
    settings.features, settings.matcher = "superpoint", "lightglue"
    found = properties.settings_from(settings)
    assert (found.features, found.model, found.matcher_model) == ("superpoint", "", str(tmp_path / "g.onnx"))


def test_binary_features_run(bpy, scene):
    assert bpy.ops.gssmc.refine(features="orb", locate=False) == {"CANCELLED"}
    assert scene.camera.data.gssmc.verdict == "FAILED"


def test_a_choice_without_its_model_is_refused(bpy, scene, preferences, tmp_path):
    refused(bpy, "ALIKED needs a model file", features="aliked")
    preferences.model_aliked = str(tmp_path / "gone.onnx")
    refused(bpy, "There is no model file at", features="aliked")


def test_a_network_runs_in_a_process_that_ends_with_the_job(bpy, scene, preferences, tiny_aliked):
    before = children()
    preferences.model_aliked = tiny_aliked
    assert bpy.ops.gssmc.refine(features="aliked", iterations=1, locate=False) == {"CANCELLED"}
    assert scene.camera.data.gssmc.verdict == "FAILED"
    assert "matches" in scene.camera.data.gssmc.reasons, "the network's features were used: there were enough to try"
    assert children() == before


def test_a_model_that_is_none_is_one_sentence(bpy, scene, preferences, tmp_path):
    before = children()
    (tmp_path / "text.onnx").write_text("no network")
    refused(bpy, "The model 'text.onnx' does not work", features="aliked", model=str(tmp_path / "text.onnx"))
    assert children() == before


# ---- preferences


OWN = ("renderer", "threads", "memory_limit_gb", "default_preset", "log_file", "map_place")


def drawn(bpy, extension, **values):
    layout = Layout()
    names = [f"model_{n}" for n in ("aliked", "disk", "superpoint", "lightglue")]
    own = SimpleNamespace(layout=layout, **(dict.fromkeys([*names, "base_url", *OWN], "") | values))
    extension("gssmc_addon.registration.preferences").GSSMC_AP_preferences.draw(own, bpy.context)
    return layout.said


def test_preferences_say_what_a_file_is_and_why_nothing_can_be_downloaded(bpy, extension, preferences, tmp_path):
    (tmp_path / "any.onnx").write_text("x")
    said = drawn(bpy, extension, model_disk=str(tmp_path / "any.onnx"), model_aliked=str(tmp_path / "gone.onnx"))
    assert "Not one of the known models; it may work" in said
    assert "There is no such file" in said
    assert any("Allow Online Access" in text for text in said)
    assert said.count("gssmc.download_model") == 2
    bpy.context.preferences.system.use_online_access = True
    assert any("No address is set" in text for text in drawn(bpy, extension))
    assert not any("No address" in text for text in drawn(bpy, extension, base_url="http://studio/models"))


@pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/models")
def test_a_known_file_is_recognised(bpy, extension, preferences):
    assert "ALIKED-T16, BSD-3-Clause" in drawn(bpy, extension, model_aliked=str(SHARED / NAME))


def test_the_panel_shows_the_way_to_the_preferences(bpy, extension, preferences, tiny_aliked):
    draw = extension("gssmc_addon.refine.panel")._draw_missing_model
    without, having = Layout(), Layout()
    draw(without, bpy.context, "aliked")
    assert without.said == ["ALIKED needs a model file", "preferences.addon_show"]
    preferences.model_aliked = tiny_aliked
    draw(having, bpy.context, "aliked")
    draw(having, bpy.context, "sift")
    assert having.said == []


# ---- download


@pytest.fixture
def server():
    """Serves `server.body` under every path."""

    class Handler(BaseHTTPRequestHandler):
        def log_message(self, *_):
            pass

        def do_GET(self):
            self.server.asked.append(self.path)
            self.send_response(200)
            self.send_header("Content-Length", str(len(self.server.body)))
            self.end_headers()
            self.wfile.write(self.server.body)

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        server.asked, server.body = [], b"not the model"
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def not_downloaded(bpy, words, **arguments):
    with pytest.raises(RuntimeError) as error:
        bpy.ops.gssmc.download_model(model=NAME, **arguments)
    assert words in str(error.value)
    assert "\n" not in str(error.value).strip()


def test_nothing_is_asked_of_the_network_without_permission(bpy, preferences, server):
    preferences.base_url = f"http://127.0.0.1:{server.server_port}"
    assert not bpy.ops.gssmc.download_model.poll()
    not_downloaded(bpy, "Allow Online Access", accept_licence=True)
    bpy.context.preferences.system.use_online_access = True
    not_downloaded(bpy, "licence is accepted")
    preferences.base_url = ""
    not_downloaded(bpy, "No address is set", accept_licence=True)
    assert server.asked == []


def test_the_dialog_shows_the_licence(bpy, extension, preferences):
    operator = extension("operators.models").GSSMC_OT_download_model
    layout = Layout()
    own = SimpleNamespace(layout=layout, accept_licence=False, model=NAME)
    own._known = lambda: operator._known(own)
    operator.draw(own, bpy.context)
    text = " ".join(layout.said)
    assert "BSD 3-Clause, Copyright (c) 2022 Zhao Xiaoming." in text
    assert "without any warranty" in text
    assert layout.said[-1] == "accept_licence"


def test_another_file_is_thrown_away(bpy, extension, preferences, server):
    bpy.context.preferences.system.use_online_access = True
    preferences.base_url = f"http://127.0.0.1:{server.server_port}/models"
    not_downloaded(bpy, "broke off", accept_licence=True)  # shorter than the model
    assert server.asked == [f"/models/{NAME}"]
    server.body = b"x" * 800_007
    not_downloaded(bpy, "thrown away", accept_licence=True)
    assert list(extension("gssmc_addon.registration.preferences").model_folder().iterdir()) == []


def test_a_download_ends_with_the_file(bpy, extension, preferences, server, monkeypatch):
    """A stand-in for the model, of which only size and checksum are known here; its thread goes the way of every job's."""
    operator, body = extension("operators.models"), bytes(range(256)) * 3000
    model = replace(operator.KNOWN[0], bytes=len(body), sha256=hashlib.sha256(body).hexdigest())
    monkeypatch.setattr(operator, "KNOWN", (model,))
    bpy.context.preferences.system.use_online_access = True
    preferences.base_url, server.body = f"http://127.0.0.1:{server.server_port}", body
    assert bpy.ops.gssmc.download_model(model=NAME, accept_licence=True) == {"FINISHED"}
    path = extension("gssmc_addon.registration.preferences").model_folder() / NAME
    assert path.read_bytes() == body
    path.unlink()


@pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/models")
def test_a_downloaded_model_is_used_without_more_ado(bpy, extension, preferences, server):
    bpy.context.preferences.system.use_online_access = True
    preferences.base_url = f"http://127.0.0.1:{server.server_port}"
    server.body = (SHARED / NAME).read_bytes()
    assert bpy.ops.gssmc.download_model(model=NAME, accept_licence=True) == {"FINISHED"}
    bpy.context.scene.gssmc.features = "auto"
    path = extension("gssmc_addon.registration.settings").settings_from(bpy.context.scene.gssmc).model
    assert Path(path).read_bytes() == server.body
    assert str(Path(os.environ["BLENDER_USER_RESOURCES"])) in path
    Path(path).unlink()
