"""A checkpoint as an ONNX file, which runs without PyTorch; what comes out is compared with what went in."""

import json
import warnings
from pathlib import Path

import numpy as np
import torch

from automos.core.atomic import atomic_path
from automos.core.claims import claim_file, remove
from automos.core.errors import AutomosError
from automos.core.extras import import_extra
from automos.network.checkpoint import Checkpoint, MovingProbability
from automos.network.deployed import METADATA, load_network
from automos.network.images import BASE_CHANNELS, FORMAT

TOLERANCE = 1e-3
"""Largest difference of a probability that is a matter of rounding."""


def export_onnx(checkpoint: Checkpoint, path: Path, tolerance: float = TOLERANCE) -> float:
    """Write `checkpoint` as ONNX with its settings and card inside; return the largest difference between the two.

    Raises
    ------
    AutomosError : the exported network answers differently, by more than `tolerance`.
    MissingExtraError : onnx and onnxruntime are not installed.
    """
    onnx, _ = (import_extra(name, "train,deploy", "exporting needs {}: {}") for name in ("onnx", "onnxruntime"))
    claim_file(path, f"\n\x07{METADATA}".encode())  # the name and its length, as ONNX writes them
    network = MovingProbability(checkpoint.network).eval()
    image = checkpoint.image
    shape = (1, len(BASE_CHANNELS) + image.residuals, image.height, image.width)
    with atomic_path(path) as temporary, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            network,
            (torch.zeros(shape),),
            str(temporary),
            input_names=["image"],
            output_names=["moving"],
            dynamo=True,
            external_data=False,
            verbose=False,
        )
        model = onnx.load(temporary)
        for node in model.graph.node:  # where in the source each came from: a quarter of a small file
            del node.metadata_props[:]
            node.doc_string = ""
        entry = model.metadata_props.add()
        entry.key = METADATA
        entry.value = json.dumps({"format": FORMAT, "image": image.model_dump(mode="json"), "card": checkpoint.card})
        onnx.save(model, temporary)
    difference = compare(network, path, shape)
    if not difference <= tolerance:
        remove(path)
        raise AutomosError(
            f"the exported network differs from the checkpoint by {difference:.2g} where {tolerance:.2g} is a matter "
            "of rounding: use another version of onnxscript or torch"
        )
    return difference


def compare(network: MovingProbability, path: Path, shape: tuple[int, ...], seed: int = 0) -> float:
    """Return the largest difference of the exported network's answers to `network`'s, on images of random worlds."""
    rng = np.random.default_rng(seed)
    exported = load_network(path, "onnxruntime", "cpu")
    worst = 0.0
    for _ in range(3):
        pixels = rng.normal(0.0, 5.0, shape[1:]).astype(np.float32)
        pixels[0] = np.abs(pixels[0]) * (rng.random(shape[2:]) < 0.8)  # some pixels are empty
        pixels[len(BASE_CHANNELS) :] = rng.random((shape[1] - len(BASE_CHANNELS), *shape[2:])) < 0.1
        with torch.inference_mode():
            wanted = network(torch.from_numpy(pixels)[None])[0].numpy()
        worst = max(worst, float(np.abs(exported.run(pixels) - wanted).max()))
    return worst
