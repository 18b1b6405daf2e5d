"""What is not installed is told in one sentence with the pip command."""

import sys
from pathlib import Path

import pytest

from automos.core.errors import InputError, MissingExtraError
from automos.network.deployed import load_network
from automos.network.train import require_training


@pytest.mark.parametrize("package", ["torch", "pytorch_lightning", "torchmetrics"])
def test_training_names_what_it_needs(monkeypatch, package):
    for name in ("torch", "pytorch_lightning", "torchmetrics"):
        monkeypatch.setitem(sys.modules, name, None if name == package else sys)
    with pytest.raises(MissingExtraError, match=rf"training needs {package}.*pip install '.*\[train\]'"):
        require_training()


@pytest.mark.parametrize(("suffix", "extra"), [(".pt", "train"), (".onnx", "deploy")])
def test_a_network_that_nothing_here_runs_is_told(monkeypatch, tmp_path, suffix, extra):
    for name in ("torch", "openvino", "onnxruntime"):
        monkeypatch.setitem(sys.modules, name, None)
    weights = tmp_path / f"net{suffix}"
    weights.touch()
    with pytest.raises(MissingExtraError, match=rf"pip install '.*\[{extra}\]'"):
        load_network(weights)


def test_weights_that_are_not_there_are_told():
    with pytest.raises(InputError, match=r"nowhere\.pt does not exist"):
        load_network(Path("nowhere.pt"))
