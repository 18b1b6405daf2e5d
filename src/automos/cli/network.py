"""The commands of the network: train, run online, export, and reproduce the paper's experiments."""

from pathlib import Path
from typing import Annotated, Any

import typer

from automos.cli.options import Format, Recording, SettingsFile, app, console, output, pair, progress_of, read_settings
from automos.core.errors import InputError

Overrides = Annotated[list[str] | None, typer.Option("--set", help="one setting, e.g. network.model.channels=8")]
Device = Annotated[str, typer.Option(help="auto, cpu or gpu")]
Sources = list[str]


@app.command()
def train(
    data: Annotated[Sources, typer.Option(help="RECORDING with labels of its own, or RECORDING=RESULTS; repeatable")],
    out: Annotated[Path, typer.Option(help="folder for the network and its logs")] = Path("automos_network"),
    extra: Annotated[Sources | None, typer.Option(help="more of the same, never used for validation")] = None,
    validation: Annotated[
        Sources | None, typer.Option(help="to choose the best epoch by; default: the last of --data")
    ] = None,
    init: Annotated[Path | None, typer.Option(help="checkpoint to fine-tune; shipped: the one in the package")] = None,
    device: Device = "auto",
    devices: Annotated[int, typer.Option(min=1, help="GPUs (DDP)")] = 1,
    loaders: Annotated[
        int | None,
        typer.Option(min=0, help="processes that prepare scans; default: up to 8 beside a GPU, none on a CPU"),
    ] = None,
    settings: SettingsFile = None,
    set_: Overrides = None,
) -> None:
    """Train LMNet on labelled recordings; the best network is OUT/best.pt.

    [bold]Examples[/bold]

    automos train --data my_log=automos_runs/my_log             labels from automos label

    automos train --data kitti/sequences/00 --validation kitti/sequences/08 --extra road=automos_runs/road

    automos train --data my_log=automos_runs/my_log --init best.pt --set network.training.epochs=10
    """
    from automos.network.recordings import Source
    from automos.network.segment import shipped
    from automos.network.train import TrainingData, device_note
    from automos.network.train import train as train_on

    sources = [Source.parse(text) for text in data]
    held_out = [Source.parse(text) for text in validation or []]
    if not held_out and len(sources) > 1:
        held_out = [sources.pop()]
    together = TrainingData((*sources, *map(Source.parse, extra or [])), tuple(held_out))
    chosen = read_settings(settings, set_)
    init = shipped(".pt") if init == Path("shipped") else init
    console.print(device_note(device))
    with progress_of("train") as progress:
        say = lambda sentence: console.print(sentence, markup=False, highlight=False)  # noqa: E731
        best = train_on(together, out, chosen, init, device, devices, progress, loaders=loaders, report=say)
    output.print(f"IoU of the moving class {100 * best.card['validation_iou']:.1f} % on validation\n{out}/best.pt")


@app.command()
def segment(
    recording: Recording,
    lag: Annotated[float, typer.Option(help="seconds by which labels may come later than their scan")] = 0.0,
    method: Annotated[
        str, typer.Option(help="evidence: the method of automos label, scan by scan; lmnet: a network; auto")
    ] = "auto",
    weights: Annotated[
        Path | None, typer.Option(help="lmnet: checkpoint (.pt) or network (.onnx); default: the shipped one")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="results folder; default: automos_segmented/NAME")] = None,
    format: Format = None,
    probabilities: Annotated[
        bool, typer.Option("--probabilities", help="lmnet: write each point's probability to move")
    ] = False,
    device: Device = "auto",
    engine: Annotated[str, typer.Option(help="what runs the network: auto, torch, onnxruntime or openvino")] = "auto",
    threads: Annotated[int, typer.Option(min=0, help="of the network on a CPU; 0: one per core")] = 0,
    settings: SettingsFile = None,
    set_: Overrides = None,
) -> None:
    """Label every scan online: from itself, the scans before it and those of the next LAG seconds, as on a robot.

    [bold]Examples[/bold]

    automos segment my_log/                        each scan immediately

    automos segment my_log/ --lag 0.5              half a second later, with much better labels

    automos segment my_log/ --method lmnet         the small network that ships with AutoMOS, on the CPU

    automos segment my_log/ --weights best.pt --device gpu
    """
    from automos.live import segment as by_evidence
    from automos.network import segment as by_network
    from automos.readers import open_recordings
    from automos.results.claiming import results_folders

    if method not in ("auto", "evidence", "lmnet"):
        raise InputError(f"there is no method '{method}': choose evidence or lmnet")
    uses_network = method == "lmnet" or (method == "auto" and (weights is not None or probabilities))
    are_networks = weights is not None or probabilities or (engine, device, threads) != ("auto", "auto", 0)
    if not uses_network and are_networks:
        raise InputError(
            "--weights, --probabilities, --engine, --device and --threads are the network's: add --method lmnet, or "
            "leave them out"
        )
    if uses_network and lag > 0.0:
        raise InputError("the network labels each scan immediately: leave --lag out, or take --method evidence")
    chosen = read_settings(settings, set_)
    recordings = open_recordings(recording, format)
    folders = results_folders(recordings, out, Path("automos_segmented"))
    way: Any = by_evidence
    how: tuple[Any, ...] = chosen, lag
    if uses_network:
        way, how = by_network, (by_network.open_network(weights, engine, device, threads), chosen, probabilities)
    for sequence, folder in zip(recordings, folders, strict=True):
        with progress_of(sequence.name) as progress:
            run = way.segment_recording(sequence, folder, *how, progress)
        output.print(way.summary(run, folder))


@app.command("export-network")
def export_network(
    weights: Annotated[Path, typer.Argument(help="checkpoint (.pt)")],
    out: Annotated[Path | None, typer.Option(help="file to write; default: beside the checkpoint")] = None,
) -> None:
    """Write a checkpoint as ONNX, which OpenVINO and ONNX Runtime run; it is compared with the checkpoint."""
    from automos.network.train import require_training

    require_training()
    from automos.network.checkpoint import load_checkpoint
    from automos.network.export import export_onnx

    path = out or weights.with_suffix(".onnx")
    difference = export_onnx(load_checkpoint(weights), path)
    output.print(f"{path}\nlargest difference to the checkpoint: {difference:.1e}")


@app.command()
def reproduce(
    experiment: Annotated[str, typer.Argument(help="table2, table3 (with the curve of Fig. 3), or network")],
    out: Annotated[Path, typer.Option(help="folder of the experiment; interrupted, it continues")] = Path("reproduced"),
    train: Annotated[
        list[Path] | None, typer.Option(help="recording with manual labels, repeatable; default: simulated ones")
    ] = None,
    validation: Annotated[list[Path] | None, typer.Option(help="recording to choose epochs by")] = None,
    test: Annotated[list[Path] | None, typer.Option(help="recording to score")] = None,
    extra: Annotated[list[Path] | None, typer.Option(help="recording without labels")] = None,
    away_train: Annotated[list[Path] | None, typer.Option(help="table3: the other environment, without labels")] = None,
    away_validation: Annotated[list[Path] | None, typer.Option(help="table3: to choose its epochs by")] = None,
    away_test: Annotated[list[Path] | None, typer.Option(help="table3: to score there")] = None,
    predictions: Annotated[
        list[str] | None, typer.Option(help="NAME=FOLDER, another method's label files to score; repeatable")
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="the full network and image; default: the narrow one")] = False,
    device: Device = "auto",
    settings: SettingsFile = None,
    set_: Overrides = None,
) -> None:
    """Repeat an experiment of the paper with LMNet, on simulated worlds or on your own recordings.

    [bold]Examples[/bold]

    automos reproduce table2 --out reproduced          everything simulated, an hour or two on a CPU

    automos reproduce network --full                   what ships with AutoMOS, but the full network, on a GPU

    automos reproduce table2 --full --train=kitti/sequences/0{0..7} --validation kitti/sequences/08 --test ...
    """
    from automos.network.domains import DOMAINS
    from automos.network.experiments import SIZES, TUNING, Experiment, many_sensors, table_three, table_two
    from automos.network.tables import write_curves, write_table
    from automos.network.train import device_note

    if experiment not in SIZES:
        raise InputError(f"there is no experiment '{experiment}': choose table2, table3 or network")
    given = _data(train, validation, test, extra)
    console.print(device_note(device))
    base = SIZES[experiment][full]
    chosen, tuning = (read_settings(settings, set_, given) for given in (base, {**base, **TUNING}))
    with progress_of(experiment) as progress:
        work = Experiment(out, chosen, tuning, device, progress)
        home = given or work.simulated(DOMAINS["S" if experiment == "network" else "K"])
        if experiment == "network":
            rows = many_sensors(work, home)
        elif experiment == "table2":
            others = pair(predictions, "--predictions", "write --predictions NAME=FOLDER")
            rows = table_two(work, home, {name: Path(folder) for name, folder in others.items()})
        else:
            away = _data(away_train, away_validation, away_test, None) or work.simulated(DOMAINS["A"])
            rows, curves = table_three(work, home, away)
            write_curves(curves, out / "figure3.png")
    output.print(write_table(rows, out / f"{experiment}.json"))


def _data(train: Any, validation: Any, test: Any, extra: Any) -> Any:
    """Return the recordings that the user gave by purpose, None if none were given."""
    from automos.network.experiments import Data

    if not any((train, validation, test, extra)):
        return None
    if not (train and validation and test):
        raise InputError("recordings of your own need all of --train, --validation and --test (or the --away- ones)")
    return Data(tuple(train), tuple(validation), tuple(test), tuple(extra or ()))
