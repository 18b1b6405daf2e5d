"""What an experiment comes to: a table in Markdown and JSON, a curve as a picture and JSON."""

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from automos.core.atomic import write_json
from automos.evaluation.moving import Counts, percent


@dataclass(frozen=True, eq=False)
class Row:
    """A line of a table: a method, its points counted, and the hours its training took."""

    method: str
    counts: Counts
    hours: float = 0.0


@dataclass(frozen=True)
class Curves:
    """IoU of the moving class in another environment against the number of epochs there (the paper's Fig. 3).

    Attributes
    ----------
    validation : dict of str to list of float
        By training, the IoU before it and after each epoch, over the pixels of validation scans, in [0, 1].
    test : dict of int to float
        By number of epochs of fine-tuning, the IoU over all points of the test recordings.
    retrained : float
        The same of the network that was trained there from scratch.
    """

    validation: dict[str, list[float]]
    test: dict[int, float]
    retrained: float


def write_table(rows: list[Row], path: Path) -> str:
    """Write the rows as JSON to `path`; return them as a Markdown table, ratios in percent."""
    lines = ["| method | IoU | precision | recall | training, h |", "|---|---:|---:|---:|---:|"]
    content = []
    for row in rows:
        ratios = row.counts.scores.ratios
        cells = map(percent, ratios.values())
        lines.append(f"| {row.method} | {' | '.join(cells)} | {f'{row.hours:.2f}' if row.hours else ''} |")
        content.append({"method": row.method, **ratios})
    write_json(path, content, indent=1)
    return "\n".join(lines)


def write_curves(curves: Curves, path: Path) -> None:
    """Draw the curves to `path` (.png) and write their values beside it (.json)."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import MaxNLocator

    figure, axes = plt.subplots(figsize=(6.5, 4), layout="constrained")
    colors = {"retrained": "tab:gray", "fine-tuned": "tab:blue"}
    for name, values in curves.validation.items():
        axes.plot(100 * np.array(values), color=colors.get(name), alpha=0.5, label=f"{name}, validation scans")
    epochs = sorted(curves.test)
    scores = [100 * curves.test[n] for n in epochs]
    axes.plot(epochs, scores, "o-", color=colors["fine-tuned"], label="fine-tuned, test recordings")
    axes.axhline(100 * curves.retrained, color=colors["retrained"], linestyle="--", label="retrained, test recordings")
    axes.set(xlabel="epochs in the other environment", ylabel="IoU of the moving class, %", ylim=(0, 100))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=120)
    plt.close(figure)
    write_json(path.with_suffix(".json"), asdict(curves), indent=1)
