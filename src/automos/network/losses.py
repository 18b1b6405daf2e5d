"""LMNet's loss: weighted negative log-likelihood and Lovász-softmax (Berman et al., CVPR 2018), unlabeled ignored."""

from __future__ import annotations

import torch
from torch import Tensor

from automos.network.model import Class


def segmentation_loss(logits: Tensor, target: Tensor, class_weight: Tensor, confidence: Tensor | None = None) -> Tensor:
    """Return the scalar loss of a batch.

    Parameters
    ----------
    logits : (B, 3, H, W).
    target : (B, H, W) int64 of `Class`; UNLABELED pixels do not count.
    class_weight : (3,), 0 for UNLABELED.
    confidence : (B, H, W) in [0, 1], weight of each pixel in the likelihood; 1 everywhere where not given.
    """
    log_probability = torch.log_softmax(logits.float(), dim=1)
    weight = class_weight[target]  # (B, H, W)
    if confidence is not None:
        weight = weight * confidence
    picked = log_probability.gather(1, target[:, None])[:, 0]
    likelihood = -(weight * picked).sum() / weight.sum().clamp(min=1e-8)
    return likelihood + lovasz_softmax(log_probability.exp(), target)


def lovasz_softmax(probability: Tensor, target: Tensor) -> Tensor:
    """Return the mean over the classes present of the Lovász extension of 1 - IoU.

    Parameters
    ----------
    probability : (B, C, H, W).
    target : (B, H, W) int64; pixels of class 0 are left out, and class 0 is none of those scored.
    """
    is_labelled = target.reshape(-1) > Class.UNLABELED
    flat = probability.movedim(1, -1).reshape(-1, probability.shape[1])[is_labelled]
    truth = target.reshape(-1)[is_labelled]
    losses = []
    for c in range(1, probability.shape[1]):
        is_class = (truth == c).to(flat.dtype)
        if is_class.any():
            errors, order = (is_class - flat[:, c]).abs().sort(descending=True)
            losses.append(errors @ _jaccard_steps(is_class[order]))
    return torch.stack(losses).mean() if losses else probability.sum() * 0.0


def _jaccard_steps(is_class: Tensor) -> Tensor:
    """Return how much the Jaccard loss grows as pixels become wrong one after the other, worst first."""
    total = is_class.sum()
    intersection = total - is_class.cumsum(0)
    union = total + (1.0 - is_class).cumsum(0)
    loss = 1.0 - intersection / union
    return torch.cat([loss[:1], loss[1:] - loss[:-1]])
