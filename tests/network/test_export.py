"""An exported network answers as its checkpoint does, whatever runs it."""

import importlib.util

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the network needs PyTorch: pip install '.[train]'")
for package in ("onnx", "onnxruntime", "onnxscript"):
    pytest.importorskip(package, reason=f"exporting needs {package}: pip install '.[deploy]'")

from automos.core.errors import AutomosError, InputError  # noqa: E402
from automos.network.checkpoint import (  # noqa: E402
    Checkpoint,
    LMNet,
    MovingProbability,
)
from automos.network.deployed import load_network  # noqa: E402
from automos.network.export import export_onnx  # noqa: E402
from automos.settings import ImageSettings, ModelSettings  # noqa: E402

IMAGE, MODEL = ImageSettings(height=16, width=64, residuals=2), ModelSettings(channels=4)
HAS_OPENVINO = importlib.util.find_spec("openvino") is not None
EACH_ENGINE = pytest.mark.parametrize(
    "engine",
    ["onnxruntime", pytest.param("openvino", marks=pytest.mark.skipif(not HAS_OPENVINO, reason="no openvino here"))],
)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Return a checkpoint with statistics of its own in the batch norms, and its export."""
    torch.manual_seed(0)
    network = LMNet(IMAGE, MODEL)
    network.set_scale(np.arange(2, dtype=np.float32), np.full(2, 3.0, np.float32))
    network(torch.rand(4, 4, 16, 64) * 10)
    checkpoint = Checkpoint(network.eval(), IMAGE, MODEL, {"validation_iou": 0.5})
    path = tmp_path_factory.mktemp("exported") / "net.onnx"
    assert export_onnx(checkpoint, path) < 1e-5
    return checkpoint, path


@EACH_ENGINE
def test_engines_answer_as_the_checkpoint_does(exported, engine):
    checkpoint, path = exported
    deployed = load_network(path, engine, "cpu")
    assert deployed.image == IMAGE
    assert deployed.card == {"validation_iou": 0.5}
    pixels = np.random.default_rng(1).normal(0, 5, (4, 16, 64)).astype(np.float32)
    with torch.inference_mode():
        wanted = MovingProbability(checkpoint.network)(torch.from_numpy(pixels)[None])[0].numpy()
    # OpenVINO counts in bfloat16 where the processor can
    assert np.abs(deployed.run(pixels) - wanted).max() < (1e-4 if engine == "onnxruntime" else 0.03)


def test_a_foreign_onnx_file_is_told(exported, tmp_path):
    import onnx

    model = onnx.load(exported[1])
    del model.metadata_props[:]
    onnx.save(model, tmp_path / "foreign.onnx")
    with pytest.raises(InputError, match="was not exported by automos"):
        load_network(tmp_path / "foreign.onnx", "onnxruntime")


@EACH_ENGINE
def test_a_damaged_network_is_told_in_a_sentence(exported, tmp_path, engine, capfd):
    path = tmp_path / "damaged.onnx"
    whole = exported[1].read_bytes()
    for content in (b"network", whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"damaged.onnx is no ONNX network, or a damaged one: export it again$"):
            load_network(path, engine)
    assert capfd.readouterr() == ("", "")


@EACH_ENGINE
def test_a_network_that_takes_other_images_than_it_says_is_told(exported, tmp_path, engine):
    import onnx

    model = onnx.load(exported[1])
    entry = model.metadata_props[0]
    entry.value = entry.value.replace('"residuals": 2', '"residuals": 3')
    onnx.save(model, tmp_path / "other.onnx")
    with pytest.raises(InputError, match="takes other images than it says"):
        load_network(tmp_path / "other.onnx", engine)


def test_an_export_that_differs_is_not_kept(exported, tmp_path):
    with pytest.raises(AutomosError, match="the exported network differs"):
        export_onnx(exported[0], tmp_path / "net.onnx", tolerance=-1.0)
    assert not (tmp_path / "net.onnx").exists()
