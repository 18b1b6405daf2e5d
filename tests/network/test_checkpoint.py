from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the network needs PyTorch: pip install '.[train]'")

from automos.core.errors import InputError  # noqa: E402
from automos.network.checkpoint import (  # noqa: E402
    Checkpoint,
    LMNet,
    MovingProbability,
    load_checkpoint,
    require_shape,
    save_checkpoint,
)
from automos.network.deployed import load_network  # noqa: E402
from automos.network.images import BASE_CHANNELS  # noqa: E402
from automos.network.segment import shipped  # noqa: E402
from automos.settings import ImageSettings, ModelSettings  # noqa: E402

IMAGE, MODEL = ImageSettings(height=16, width=64, residuals=2), ModelSettings(channels=4)


def made(seed: int = 0) -> Checkpoint:
    torch.manual_seed(seed)
    return Checkpoint(LMNet(IMAGE, MODEL).eval(), IMAGE, MODEL, {"trained_on": ["a street"]})


@pytest.fixture
def path(tmp_path):
    save_checkpoint(tmp_path / "best.pt", made())
    return tmp_path / "best.pt"


def test_a_checkpoint_holds_all_that_is_needed(path):
    found = load_checkpoint(path)
    assert (found.image, found.model, found.card) == (IMAGE, MODEL, {"trained_on": ["a street"]})
    pixels = torch.rand(1, 4, 16, 64)
    with torch.inference_mode():
        assert torch.equal(found.network(pixels), made().network(pixels))


def test_half_the_bits_change_hardly_a_thing(tmp_path):
    save_checkpoint(tmp_path / "half.pt", made(), half=True)
    pixels = torch.rand(1, 4, 16, 64)
    with torch.inference_mode():
        assert torch.allclose(load_checkpoint(tmp_path / "half.pt").network(pixels), made().network(pixels), atol=0.02)


def test_a_file_that_is_none_is_told(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        load_checkpoint(tmp_path / "none.pt")
    (tmp_path / "text.pt").write_text("weights")
    with pytest.raises(InputError, match="is not a checkpoint of automos train"):
        load_checkpoint(tmp_path / "text.pt")
    torch.save({"state_dict": {}}, tmp_path / "other.pt")
    with pytest.raises(InputError, match="is not a checkpoint of automos train"):
        load_checkpoint(tmp_path / "other.pt")


def test_weights_of_another_network_are_told(tmp_path):
    save_checkpoint(tmp_path / "best.pt", replace(made(), model=ModelSettings(channels=8)))
    with pytest.raises(InputError, match="weights that do not fit the network it names"):
        load_checkpoint(tmp_path / "best.pt")


def test_damaged_weights_and_cards_are_told(tmp_path):
    save_checkpoint(tmp_path / "whole.pt", made())
    content = torch.load(tmp_path / "whole.pt", weights_only=True)
    torch.save({**content, "card": "none"}, tmp_path / "card.pt")
    with pytest.raises(InputError, match="weights that do not fit the network it names"):
        load_checkpoint(tmp_path / "card.pt")
    next(iter(content["state"].values())).fill_(float("nan"))
    torch.save(content, tmp_path / "nan.pt")
    with pytest.raises(InputError, match="weights that are no numbers"):
        load_checkpoint(tmp_path / "nan.pt")


@pytest.mark.parametrize(
    ("image", "model", "said"),
    [
        (IMAGE, ModelSettings(channels=8), "network.model.channels = 4, not 8"),
        (ImageSettings(residuals=8), MODEL, "network.image.residuals = 2, not 8"),
    ],
)
def test_training_does_not_start_from_another_network(path, image, model, said):
    with pytest.raises(InputError, match=said):
        require_shape(load_checkpoint(path), image, model, path)
    require_shape(load_checkpoint(path), ImageSettings(height=32, width=64, residuals=2), MODEL, path)


def test_an_engine_that_cannot_run_a_file_is_told(path):
    with pytest.raises(InputError, match="openvino runs exported networks only"):
        load_network(path, "openvino")
    path.with_suffix(".onnx").write_bytes(b"no network")
    with pytest.raises(InputError, match="is an exported network, which torch does not run"):
        load_network(path.with_suffix(".onnx"), "torch")


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU here")
def test_a_gpu_that_is_not_there_is_told(path):
    with pytest.raises(InputError, match="no GPU was found, but one was asked for"):
        load_network(path, device="gpu")


def test_in_half_the_bits_no_number_is_lost(tmp_path):
    network = LMNet(IMAGE, MODEL)
    for name, buffer in network.named_buffers():
        if name.endswith("running_var"):
            buffer.fill_(8e5)  # 16 bits end at 65504
    save_checkpoint(tmp_path / "half.pt", Checkpoint(network, IMAGE, MODEL), half=True)
    state = load_checkpoint(tmp_path / "half.pt").network.state_dict()
    for name, value in network.state_dict().items():
        assert torch.allclose(state[name], value, rtol=1e-3, atol=1e-6), name


def test_the_network_that_ships_can_be_trained_on_and_is_the_one_that_runs():
    kept = load_checkpoint(shipped(".pt"))
    size = len(BASE_CHANNELS) + kept.image.residuals, kept.image.height, kept.image.width
    image = 30.0 * torch.rand(1, *size, generator=torch.manual_seed(0))
    session = pytest.importorskip("onnxruntime").InferenceSession(shipped(".onnx"))
    (deployed,) = session.run(None, {session.get_inputs()[0].name: image.numpy()})
    trained = MovingProbability(kept.network)(image).detach().numpy()
    assert np.abs(trained - deployed).mean() < 0.005
