import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the network needs PyTorch: pip install '.[train]'")

from automos.network.checkpoint import Class, LMNet, MovingProbability  # noqa: E402
from automos.network.images import BASE_CHANNELS  # noqa: E402
from automos.settings import ImageSettings, ModelSettings  # noqa: E402


def image(n: int = 1, residuals: int = 8, height: int = 16, width: int = 64):
    return torch.rand(n, len(BASE_CHANNELS) + residuals, height, width, generator=torch.Generator().manual_seed(0)) * 20


@pytest.mark.parametrize("residuals", [0, 3])
@pytest.mark.parametrize("size", [(16, 64), (32, 96)])
def test_every_pixel_gets_three_logits(residuals, size):
    network = LMNet(ImageSettings(residuals=residuals), ModelSettings(channels=4)).eval()
    assert network(image(2, residuals, *size)).shape == (2, len(Class), *size)


def test_the_full_size_is_the_published_one():
    network = LMNet(ImageSettings(), ModelSettings())
    assert round(sum(p.numel() for p in network.parameters()) / 1e6, 2) == 6.71  # SalsaNext


def test_the_input_is_normalised_and_empty_pixels_stay_empty():
    network = LMNet(ImageSettings(residuals=1), ModelSettings(channels=4))
    network.set_scale(np.full(2, 10.0, np.float32), np.full(2, 2.0, np.float32))
    seen = []
    network.backbone.register_forward_pre_hook(lambda module, inputs: seen.append(inputs[0]))
    pixels = torch.zeros(1, 3, 16, 64)
    pixels[0, :, 0, 0] = torch.tensor([14.0, 6.0, 0.25])
    network.eval()(pixels)
    assert seen[0][0, :, 0, 0].tolist() == [2.0, -2.0, 0.25]
    assert not seen[0][0, :, 1:].any()


def test_what_is_deployed_weighs_moving_against_static():
    network = LMNet(ImageSettings(), ModelSettings(channels=4)).eval()
    with torch.inference_mode():
        logits = network(image())
        got = MovingProbability(network)(image())
    two = torch.softmax(logits[:, [Class.STATIC, Class.MOVING]], dim=1)[:, 1]
    assert torch.allclose(got, two, atol=1e-6)
