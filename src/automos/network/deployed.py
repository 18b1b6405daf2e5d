"""A trained network ready to run: PyTorch for checkpoints, OpenVINO or ONNX Runtime for exported ones.

Whatever runs it, it is a function from an image (C, H, W) to the probability (H, W) that what each pixel shows moves.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from automos.core.errors import InputError, MissingExtraError
from automos.core.extras import pip_install
from automos.core.parallel import available_cores
from automos.core.reading import parse_json
from automos.network.images import BASE_CHANNELS, FORMAT
from automos.network.projection import Image
from automos.settings import ImageSettings

ENGINES = ("auto", "torch", "onnxruntime", "openvino")
DEVICES = ("auto", "cpu", "gpu")
METADATA = "automos"
"""Key of an exported network's metadata that holds format, image settings and card as JSON."""


@dataclass(frozen=True, eq=False)
class Deployed:
    """A network that can be run.

    Attributes
    ----------
    image : ImageSettings
        The images it takes.
    run : callable
        (2 + K, H, W) float32 to (H, W) float32 in [0, 1].
    engine : str
        What runs it.
    card : dict of str to Any
        What it was trained on and how it scored.
    """

    image: ImageSettings
    run: Callable[[Image], Image]
    engine: str
    card: dict[str, Any] = field(default_factory=dict)


def load_network(weights: Path, engine: str = "auto", device: str = "auto", threads: int = 0) -> Deployed:
    """Return the network in `weights`, a checkpoint (.pt) or an exported network (.onnx).

    Parameters
    ----------
    engine : str
        "torch", "onnxruntime", "openvino", or "auto": the first that is installed and runs the file.
    device : str
        "cpu", "gpu", or "auto".
    threads : int
        Of the network on a CPU; 0: one per core.

    Raises
    ------
    InputError
        No such file, not a network of ours, an engine that cannot run it, or no GPU where one is asked for.
    MissingExtraError
        Nothing that runs it is installed.
    """
    for name, value, known in (("engine", engine, ENGINES), ("device", device, DEVICES)):
        if value not in known:
            raise InputError(f"there is no {name} '{value}': choose one of {', '.join(known)}")
    if not weights.exists():
        raise InputError(f"{weights} does not exist: give a checkpoint (.pt) or an exported network (.onnx)")
    if weights.suffix != ".onnx":
        if engine not in ("auto", "torch"):
            raise InputError(f"{engine} runs exported networks only: automos export-network {weights} first")
        return _load_torch(weights, device, threads)
    if engine == "torch":
        raise InputError(f"{weights} is an exported network, which torch does not run: give the checkpoint (.pt)")
    runners = {"openvino": _load_openvino, "onnxruntime": _load_onnxruntime}
    wanted = list(runners) if engine == "auto" else [engine]
    if device == "gpu" and engine == "auto":
        wanted = ["onnxruntime"]  # OpenVINO knows Intel's GPUs only
    for name in wanted:
        if find_spec(name):
            return runners[name](weights, device, threads)
    raise MissingExtraError(f"running {weights.name} needs {' or '.join(wanted)}: {pip_install('deploy')}")


def _load_torch(weights: Path, device: str, threads: int) -> Deployed:
    if not find_spec("torch"):
        raise MissingExtraError(
            f"running {weights.name} needs torch: {pip_install('train')}, or export the network to ONNX"
        )
    import torch

    from automos.network.checkpoint import MovingProbability, load_checkpoint

    has_gpu = torch.cuda.is_available()
    if device == "gpu" and not has_gpu:
        raise InputError("no GPU was found, but one was asked for: check the driver (nvidia-smi), or use --device cpu")
    place = torch.device("cuda" if has_gpu and device != "cpu" else "cpu")
    checkpoint = load_checkpoint(weights)
    network = MovingProbability(checkpoint.network).eval().to(place)
    if place.type == "cpu" and threads:
        torch.set_num_threads(threads)

    def run(image: Image) -> Image:
        with torch.inference_mode(), torch.autocast(place.type, torch.float16, enabled=place.type == "cuda"):
            return network(torch.from_numpy(image)[None].to(place))[0].float().cpu().numpy()

    return Deployed(checkpoint.image, run, f"torch on {place.type}", checkpoint.card)


def _load_openvino(weights: Path, device: str, threads: int) -> Deployed:
    import openvino
    from openvino.frontend import FrontEndManager

    core = openvino.Core()
    place = "GPU" if device == "gpu" else "CPU"
    if place not in {name.split(".")[0] for name in core.available_devices}:
        raise InputError(f"OpenVINO sees no {place} here (it sees {core.available_devices}): use --device cpu")
    onnx = FrontEndManager().load_by_framework("onnx")  # others would tell of it in their own words
    model = _read(weights, lambda path: onnx.convert(onnx.load(path)))
    options: dict[str, Any] = {"PERFORMANCE_HINT": "LATENCY"}
    if place == "CPU":
        options["INFERENCE_NUM_THREADS"] = threads or available_cores()
    text = model.get_rt_info(["framework", METADATA]).astype(str) if model.has_rt_info(["framework", METADATA]) else ""
    image, card = _described(text, weights, [list(each.shape) for each in model.inputs])
    compiled = core.compile_model(model, place, options)
    return Deployed(image, lambda pixels: compiled(pixels[None])[0][0], f"openvino on {place.lower()}", card)


def _load_onnxruntime(weights: Path, device: str, threads: int) -> Deployed:
    import onnxruntime

    provider = "CUDAExecutionProvider"
    has_gpu = provider in onnxruntime.get_available_providers()
    if device == "gpu" and not has_gpu:
        raise InputError(
            "ONNX Runtime sees no GPU, but one was asked for: install onnxruntime-gpu, or use --device cpu"
        )
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads or available_cores()
    use_gpu = has_gpu and device != "cpu"
    providers = [provider] if use_gpu else []
    session = _read(weights, lambda p: onnxruntime.InferenceSession(p, options, [*providers, "CPUExecutionProvider"]))
    text = session.get_modelmeta().custom_metadata_map.get(METADATA, "")
    image, card = _described(text, weights, [each.shape for each in session.get_inputs()])
    run = lambda pixels: session.run(None, {"image": pixels[None]})[0][0]  # noqa: E731
    return Deployed(image, run, f"onnxruntime on {'gpu' if use_gpu else 'cpu'}", card)


def _read(weights: Path, read: Callable[[str], Any]) -> Any:
    try:
        return read(str(weights))
    except Exception:  # the runtimes raise classes of their own
        raise InputError(f"{weights} is no ONNX network, or a damaged one: export it again") from None


def _described(text: str, weights: Path, shapes: list[Any]) -> tuple[ImageSettings, dict[str, Any]]:
    """Return the image settings and the card that the export wrote into the network, with inputs of `shapes`."""
    try:
        content = parse_json(text)
        version = content.get("format", 1)
        image, card = (ImageSettings(**content["image"]), content["card"]) if version == FORMAT else (None, {})
    except (ValueError, KeyError, TypeError, AttributeError):  # pydantic's are ValueErrors
        raise InputError(f"{weights} was not exported by automos: automos export-network makes one") from None
    if image is None:
        raise InputError(f"{weights} is a network of format {version}, this version runs {FORMAT}: train it again")
    if shapes != [[1, len(BASE_CHANNELS) + image.residuals, image.height, image.width]]:
        raise InputError(f"{weights} takes other images than it says: export it again")
    return image, card
