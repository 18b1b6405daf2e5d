"""The loss against numbers worked out by hand and against the definition of Lovász' extension."""

from itertools import combinations, pairwise

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the network needs PyTorch: pip install '.[train]'")

from automos.network.module import lovasz_softmax, segmentation_loss  # noqa: E402


def logits_of(probability: list[list[float]]):
    """Return logits (1, 3, 1, P) of pixels' probabilities (P, 3)."""
    return torch.tensor(probability).log().T[None, :, None, :]


def jaccard(wrong: set[int], truth: set[int]) -> float:
    """Return 1 - IoU of a class where exactly the pixels `wrong` are classified wrongly."""
    kept, grown = truth - wrong, truth | wrong
    return 1.0 - len(kept) / len(grown) if grown else 0.0


def brute_force(errors: np.ndarray, truth: set[int]) -> float:
    """Return the Lovász extension as the largest linear function below the set function at every set's corner.

    For a submodular set function F it is the maximum over orders of sum_i errors[i] (F(S_i) - F(S_{i-1})); here by its
    integral form: the mean over thresholds of F of the pixels whose error exceeds the threshold.
    """
    levels = np.concatenate([[0.0], np.sort(np.unique(errors)), [1.0]])
    total = 0.0
    for low, high in pairwise(levels):
        total += (high - low) * jaccard({i for i, e in enumerate(errors) if e > low}, truth)
    return total


@pytest.mark.parametrize("seed", range(5))
def test_lovasz_softmax_is_its_definition(seed):
    rng = np.random.default_rng(seed)
    probability = rng.dirichlet([1.0, 1.0, 1.0], 8)
    target = np.array([0, 1, 1, 2, 2, 1, 0, 2])
    labelled = target > 0
    wanted = np.mean(
        [
            brute_force(
                np.abs((target[labelled] == c) - probability[labelled, c]), set(np.flatnonzero(target[labelled] == c))
            )
            for c in (1, 2)
        ]
    )
    got = lovasz_softmax(torch.tensor(probability.T[None, :, None, :]), torch.tensor(target[None, None, :]))
    assert float(got) == pytest.approx(wanted, abs=1e-9)


def test_the_jaccard_loss_is_submodular_as_the_extension_wants_it():
    truth, pixels = {0, 1, 2}, range(5)
    sets = [set(s) for n in range(6) for s in combinations(pixels, n)]
    for a in sets:
        for b in sets:
            assert jaccard(a, truth) + jaccard(b, truth) >= jaccard(a | b, truth) + jaccard(a & b, truth) - 1e-12


def test_lovasz_of_a_perfect_and_of_a_wrong_answer():
    target = torch.tensor([[[1, 2, 2]]])
    right = torch.tensor([[[[0.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]], [[0.0, 1.0, 1.0]]]])
    assert float(lovasz_softmax(right, target)) == 0.0
    assert float(lovasz_softmax(right[:, [0, 2, 1]], target)) == 1.0


def test_the_loss_of_three_pixels_by_hand():
    logits = logits_of([[0.1, 0.7, 0.2], [0.2, 0.3, 0.5], [0.4, 0.3, 0.3]])
    target = torch.tensor([[[1, 2, 0]]])
    # likelihood: -(1 ln 0.7 + 10 ln 0.5) / (1 + 10); unlabeled counts nothing
    likelihood = -(np.log(0.7) + 10 * np.log(0.5)) / 11
    # Lovász, static: errors 0.3 (true), 0.3 (the other pixel's 0.3): worst first, both 0.3 -> F({both}) = 1: 0.3
    # moving: errors 0.5 (true), 0.2: 0.5 F({true}) + 0.2 (F(both) - F({true})) = 0.5 * 1 + 0
    lovasz = (0.3 + 0.5) / 2
    loss = segmentation_loss(logits, target, torch.tensor([0.0, 1.0, 10.0]))
    assert float(loss) == pytest.approx(likelihood + lovasz, abs=1e-6)


def test_confidence_weighs_the_likelihood():
    logits = logits_of([[0.1, 0.7, 0.2], [0.2, 0.3, 0.5]])
    target, weight = torch.tensor([[[1, 2]]]), torch.tensor([0.0, 1.0, 10.0])
    sure = segmentation_loss(logits, target, weight, torch.tensor([[[1.0, 1.0]]]))
    doubtful = segmentation_loss(logits, target, weight, torch.tensor([[[1.0, 0.1]]]))
    assert float(sure) == pytest.approx(float(segmentation_loss(logits, target, weight)))
    likelihood = -(np.log(0.7) + np.log(0.5)) / 2  # the second weighs 10 * 0.1
    assert float(doubtful) == pytest.approx(likelihood + (0.3 + 0.5) / 2, abs=1e-6)


def test_an_image_without_labels_has_no_loss_and_a_gradient_of_zero():
    logits = torch.zeros(1, 3, 2, 2, requires_grad=True)
    loss = segmentation_loss(logits, torch.zeros(1, 2, 2, dtype=torch.int64), torch.tensor([0.0, 1.0, 10.0]))
    loss.backward()
    assert float(loss.detach()) == 0.0
    assert not logits.grad.any()
