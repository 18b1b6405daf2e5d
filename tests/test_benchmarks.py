"""Benchmarks: their experiments, recordings by name, what got worse, and tables that show what is stored, no more."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from automos import ArraySequence, load_settings
from automos.core.errors import InputError

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
import ablation
import bodies
import catalog
import experiment
import lags
import recordings
import rows
import run
import tables

HEAD = {"commit": "abc", "date": "2026-01-01", "status": "done"}


def labelled(recording: str, iou: float, false: int = 0, moving: int = 10, **more: object) -> dict:
    counts = {"true_points": moving, "missed_points": 0, "false_points": false, "scored_points": 1000}
    cost = {"cpu_seconds": 6.0, "scans": 60, "peak_mb": 400.2}
    found = {"iou": iou, "precision": 1.0, "recall": iou, "called_moving": 7, "points": 70_000, **counts, **cost}
    return {"recording": recording, "method": "default", **found, "head": HEAD, **more}


@pytest.mark.parametrize("page", tables.pages(), ids=lambda page: page.name)
def test_a_page_shows_the_stored_results(page):
    text, results = page.read_text(), tables.read_results()
    assert set(tables.names_in(text)) <= set(tables.TABLES)
    assert text.count("<!-- table ") == text.count("<!-- end -->") == len(list(tables.names_in(text)))
    assert tables.with_tables(text, results) == text, "run python benchmarks/run.py --write"


def test_every_stored_result_has_a_table_and_names_its_making():
    for name, result in tables.read_results().items():
        assert name in {table.benchmark for table in tables.TABLES.values()} & catalog.BENCHMARKS.keys()
        assert all(len(lines) > 1 for _, lines in tables.shown(name, result))
        assert result["made_by"].startswith("python benchmarks/")
        assert all({"commit", "date", "status"} <= row["head"].keys() for row in result["rows"])


def test_every_benchmark_has_experiments_whose_measure_there_is_and_a_shorter_form():
    for name, benchmark in catalog.BENCHMARKS.items():
        if benchmark.measure.endswith(".py"):
            assert (run.HERE / benchmark.measure).exists()
            continue
        module, function = benchmark.measure.split(":")
        assert f"def {function}(" in (run.HERE / f"{module}.py").read_text(), name
        all_of_it, short = benchmark.experiments(), benchmark.experiments(quick=True)
        assert len(set(map(str, all_of_it))) == len(all_of_it)
        assert 0 < len(short) <= len(all_of_it)
        assert all(isinstance(experiment.settings_digest(e.method, e.change), str) for e in short)


def test_seeds_are_those_of_worlds_alone():
    found = catalog.BENCHMARKS["gate"].experiments(recordings=["city:VLP-16:60:100@dust", "my_log"], seeds=[101, 102])
    assert [e.recording for e in found] == ["city:VLP-16:60:101@dust", "my_log", "city:VLP-16:60:102@dust"]


def test_a_refusal_is_a_row_and_what_was_done_is_kept(tmp_path, monkeypatch):
    calls = []

    def performed(command, check):
        calls.append(command)
        task = experiment.Experiment(**experiment.json.loads(Path(command[2]).read_text()))
        row = experiment.perform(task, Path(command[4]))
        Path(command[3]).write_text(experiment.json.dumps(row))
        return type("Done", (), {"returncode": 0})

    monkeypatch.setattr(experiment.subprocess, "run", performed)
    monkeypatch.setattr(experiment, "commit", lambda: "abc")
    nothing_there = experiment.Experiment("labels:score", "no_such_recording", "default")
    found = [experiment.result_of(nothing_there, tmp_path) for _ in range(2)]
    assert len(calls) == 2
    assert found[0]["head"]["status"] == found[1]["head"]["status"]
    assert found[0]["recording"] == "no_such_recording"
    assert re.match("refused: .*no_such_recording does not exist", found[0]["head"]["status"])  # there, or in a folder
    assert found[0]["head"]["seconds"] >= 0.0

    monkeypatch.setattr(experiment, "perform", lambda task, store: {"head": HEAD})
    anything = experiment.Experiment("labels:score", "anything", "default")
    assert experiment.result_of(anything, tmp_path) == experiment.result_of(anything, tmp_path) == {"head": HEAD}
    assert len(calls) == 3


def test_stamps_are_off_by_a_tenth_of_a_millisecond_and_by_the_same_in_every_run(tmp_path):
    scans = [np.full((4, 3), 5.0)] * 200
    whole = ArraySequence(scans, 0.1 * np.arange(200))
    off = recordings.Jittered(whole, 3).stamps - whole.stamps
    assert 0.8e-4 < off.std() < 1.2e-4
    assert np.array_equal(recordings.Jittered(whole, 3).stamps - whole.stamps, off)
    assert recordings.Jittered(whole, 3)[7].stamp == pytest.approx(0.7 + off[7])


def test_a_case_that_there_is_not_is_named(tmp_path):
    with pytest.raises(InputError, match="no case 'in snow'"), recordings.opened("city:VLP-16:2:0@in snow", tmp_path):
        pass


def test_a_world_is_simulated_once_and_a_recorder_keeps_its_points(tmp_path):
    with recordings.opened("city:VLP-16:2:0", tmp_path) as plain:
        n = len(plain.sequence[1])
        assert plain.sequence.truth(1).shape == (n,)
        assert len(list((tmp_path / "worlds").iterdir())) == 1
    with recordings.opened("city:VLP-16:2:0@shuffled", tmp_path) as made:
        assert len(made.sequence[1]) == n
        assert made.bodies is None


@pytest.mark.parametrize("name", [*ablation.CHOICES, *ablation.ODOMETRY])
def test_what_a_change_takes_back_is_there(name):
    overrides, constants = ablation.parsed(name)
    load_settings("default", None, overrides)
    with ablation.changed(constants):
        pass


def test_a_change_gives_settings_and_constants_other_values_and_names_what_it_does_not_know():
    place = "automos.objects.terms:PIECE"
    overrides, constants = ablation.parsed(f"tracking.max_gap=0.5 + {place}=0")
    assert (overrides, constants) == ({"tracking.max_gap": 0.5}, {place: 0})
    from automos.objects import terms

    before = terms.PIECE
    with ablation.changed(constants):
        assert terms.PIECE == 0
    assert before == terms.PIECE
    assert ablation.cumulative(["a=1", "b=2"]) == ["a=1", "a=1 + b=2"]
    with pytest.raises(InputError, match="'no such rule' is no change"):
        ablation.parsed("no such rule")


def test_what_got_worse_is_named_and_better_is_not():
    before = [labelled("city:VLP-16:60:1", 0.9, 5), labelled("country:VLP-16:60:1", 0.0, 3, 0)]
    after = [labelled("city:VLP-16:60:1", 0.88, 5), labelled("country:VLP-16:60:1", 0.0, 9, 0, called_moving=9)]
    said = "\n".join(run.verdicts(after, before))
    assert "city:VLP-16:60:1 fell from 90.0 to 88.0" in said
    assert "mean of VLP-16 fell from 90.0 to 88.0" in said
    assert "points called moving where nothing moves grew from 7 to 9" in said
    assert run.verdicts(before, before) == ["[green]nothing is worse in 2 experiments"]
    assert run.verdicts(before, []) == ["nothing to compare with"]


def test_the_gate_has_a_row_a_world_and_means_over_worlds_in_which_something_moves():
    found = [labelled("city:VLP-16:60:1", 0.5, 3), labelled("country:VLP-16:60:1", 0.0, 1200, 0)]
    assert rows.gate(found, {"VLP-16": [0.001, 0.0064]}) == [
        ["world", "VLP-16"],
        ["`city`", "50.0 (3)"],
        ["`country`", "(1,200)"],
        ["**mean**", "**50.0**"],
        ["processor seconds a scan", "0.10"],
        ["peak memory, MB", "400"],
        ["calibration error, moving", "0.006"],
        ["calibration error, static", "0.001"],
    ]


def test_jittered_runs_have_their_median_and_their_worst():
    found = [labelled(f"drive~{k}", iou) for k, iou in enumerate((0.9, 0.5, 0.8))]
    assert rows.jitter(found)[1] == ["drive", "3", "80.0", "50.0", "90.0"]


def test_a_convention_costs_what_its_own_drive_loses():
    found = [
        labelled("city:VLP-16:40:1@plain", 0.9),
        labelled("city:VLP-16:40:1@shuffled", 0.89),
        labelled("city:VLP-16:40:1@dust", 0.7),
        labelled("city:VLP-16:40:1@boat, its points left out", 0.6),
        labelled("city:VLP-16:40:1@boat", 0.598),
    ]
    assert rows.conventions(found)[1:] == [
        ["shuffled", "1.0", "+1.0 city VLP-16"],
        ["dust", "20.0", "+20.0 city VLP-16"],
        ["the other 1", "0.2 at most", ""],
    ]


def test_an_ablation_says_what_a_change_costs_where_that_is_notable():
    worlds = ("city:VLP-16:60:1", "hills:VLP-16:60:1")
    found = [labelled(name, 0.9) for name in worlds]
    found += [labelled(name, iou, change="no rule") for name, iou in zip(worlds, (0.8, 0.91), strict=True)]
    found += [labelled(name, 0.9, change="no other") for name in worlds]
    assert rows.ablation(found)[1:] == [
        ["everything", "+0.00", "0.0 city", "-0.0 city", "0"],
        ["no rule", "+4.50", "10.0 city", "1.0 hills", "0"],
        ["the other 1: below 0.5", "", "", "", ""],
    ]


def test_drives_that_are_off_or_warned_of_are_named_and_the_others_counted():
    found = [("a", 0.001, []), ("b", 0.2, []), ("c", 0.002, ["poses"])]
    drives = [{"recording": name, "off": off, "said": said, "missing": 7 * (name == "b")} for name, off, said in found]
    assert rows.trust(drives)[1:] == [
        ["b", "20.0 %", "no"],
        ["c", "0.2 %", "yes"],
        ["the other 1", "0.1 % at most", "no"],
    ]
    assert rows.ablation_odometry(drives)[1] == ["(nothing)", "1 of 3", "1", "1", "0.15 %"]


def test_methods_have_means_over_worlds_and_false_points_elsewhere():
    found = [labelled("city:X:60:1", 0.5, 10, title="T"), labelled("country:X:60:1", 0.0, 30, 0, title="T")]
    assert rows.methods_of_worlds(found)[1] == ["`default`", "50.0", "100.0", "50.0", "50.0 `city`", "0.5"]


def test_fine_tuning_has_a_column_for_each_network_kept_and_the_best():
    methods = ("LMNet + ours, retrained", "LMNet + ours, fine-tuned")
    scored = [{"method": method, "iou": iou} for method, iou in zip(methods, (0.6, 0.7), strict=True)]
    validation = {"fine-tuned": [0.2, 0.5, 0.4], "retrained": [0.0, 0.3, 0.1]}
    curves = {"validation": validation, "test": {"0": 0.4, "2": 0.65}}
    assert rows.fine_tuning([{"scores": scored, "curves": curves}]) == [
        ["epochs in the other environment", "0", "2", "best"],
        ["fine-tuned, test recordings", "40.0", "65.0", "70.0"],
        ["fine-tuned, validation scans", "20.0", "40.0", "50.0"],
        ["retrained, test recordings", "", "", "60.0"],
        ["retrained, validation scans", "0.0", "10.0", "30.0"],
    ]


def test_a_table_says_of_which_state_its_rows_are(tmp_path):
    new = {**HEAD, "commit": "def"}
    drive = [labelled("kitti_0005", 0.9, title="A"), {**labelled("kitti_0005", 0.8), "method": "paper", "head": new}]
    written = tables.markdown("presets-drive", {"methods-drive": {"rows": drive}})
    assert "| `default` | 90.0 | 100.0 | 90.0 |" in written
    assert "`python benchmarks/run.py methods-drive`, abc, 2026-01-01: `default`; def, 2026-01-01: `paper`." in written
    assert tables.markdown("jitter", {}) == "Not run yet: `python benchmarks/run.py jitter`.\n"


def test_a_stored_result_has_a_line_a_row_and_reads_back():
    result = {"made_by": "x", "leaves_out": "y", "rows": [labelled("a", 0.5), labelled("b", 0.6)]}
    text = run.as_text(result)
    assert experiment.json.loads(text) == result
    assert sum(line.startswith('  {"recording"') for line in text.splitlines()) == 2


def test_a_part_done_again_replaces_its_like_and_leaves_the_others():
    stored = {"made_by": "x", "rows": [labelled("a", 0.5), labelled("b", 0.6), labelled("b", 0.7, lag=1.0)]}
    failed = {**labelled("a", 0.0), "head": {**HEAD, "status": "failed: exit code 1"}}
    part = {"made_by": "y", "rows": [failed, labelled("b", 0.8), labelled("c", 0.9)]}
    found = [(row["recording"], row["iou"]) for row in run.merged(part, stored, ["lag"])["rows"]]
    assert found == [("a", 0.5), ("b", 0.8), ("b", 0.7), ("c", 0.9)]
    assert run.merged(part, {"rows": []})["rows"] == part["rows"][1:]
    assert catalog.BENCHMARKS["lags"].varied == ["lag"]
    assert catalog.BENCHMARKS["methods-drive"].varied == []


def test_labels_of_networks_have_the_mean_of_seeds_and_their_spread():
    def row(labels, seed, iou):
        return {"labels": labels, "seed": seed, "scores": {"drive": {"iou": iou}}, "head": HEAD}

    found = rows.labels_of_networks([row("true", 0, 0.5), row("automatic", 0, 0.4), row("true", 1, 0.7)])
    assert found[0] == ["labels", "networks", "`drive`"]
    assert found[1:] == [["true", "2", "60.0 (50.0 to 70.0)"], ["automatic", "1", "40.0 (40.0 to 40.0)"]]


def test_a_digest_counts_what_shapes_labels_and_the_whole_package_where_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(experiment, "PACKAGE", tmp_path)
    for name in ("voxels.py", "network/lmnet.onnx"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("before")
    of_labels, of_all = experiment.code_digest(), experiment.code_digest(())
    (tmp_path / "network/lmnet.onnx").write_text("after")
    assert experiment.code_digest() == of_labels
    assert experiment.code_digest(()) != of_all
    (tmp_path / "voxels.py").write_text("after")
    assert experiment.code_digest() != of_labels


def test_bins_of_bodies_are_merged_until_each_has_thirty():
    assert bodies.merged(np.array([40, 10, 5, 20, 0, 31, 29])) == [slice(0, 1), slice(1, 4), slice(4, 7)]
    assert bodies.merged(np.array([10, 5])) == []


def test_as_many_bodies_move_as_their_probability_says_or_the_table_shows_by_how_much_not():
    counts, points = np.zeros((20, 3)), np.zeros((20, 3))
    counts[0], counts[10] = (100, 1.0, 1), (100, 51.0, 80)
    points[0], points[10] = (1000, 10.0, 10), (500, 255.0, 400)
    row = {"bodies": counts.tolist(), "points_of_bodies": points.tolist()}
    heading, sure, doubtful = bodies.calibration([row])
    assert sure[:3] == ["0.010", "100", "0.010"]
    assert sure[heading.index("interval is off by")] == "0.00"
    low, high = bodies.interval(100, 80)
    assert 0.72 < low < 0.75 < 0.85 < high < 0.88
    assert doubtful[heading.index("interval is off by")] == f"{low - 0.51:.2f}"
    assert doubtful[-2:] == ["500 at 0.510", "0.800"]


def test_a_departure_counts_the_metres_until_half_of_the_points_are_called_moving():
    stamps, moves = 0.1 * np.arange(20), np.arange(20) >= 12
    places = [np.array([max(k - 11, 0) * 0.2, 0.0, 0.0]) for k in range(20)]
    called = np.where(np.arange(20) >= 14, 0.6, 0.4)
    found = lags._departure(3, stamps, [40] * 20, moves, called, places)
    assert found == {"object": 3, "at": pytest.approx(1.2), "points": 40, "metres": pytest.approx(0.4)}
    assert np.isnan(lags._departure(3, stamps, [40] * 20, moves, [0.0] * 20, places)["metres"])
    assert lags._departure(3, stamps, [20] * 20, moves, called, places) is None  # not in plain view
    assert lags._departure(3, stamps[8:], [40] * 12, moves[8:], called[8:], places[8:]) is None  # not long enough


def test_lags_have_a_row_a_recording_then_worlds_starts_and_departures():
    made = [
        labelled("city:VLP-16:60:1", 0.8 + 0.1 * (lag == "all"), 5, lag=lag, start_iou=0.5, departures=metres)
        for lag, metres in ((0.0, [{"metres": 0.5}, {"metres": None}]), ("all", [{"metres": 0.0}]))
    ]
    heading, world, whole, start, median, worst = rows.lags(made)
    assert heading == ["recording", "0 s", "all"]
    assert world == ["`city:VLP-16:60:1`", "80.0 (5)", "90.0 (5)"]
    assert (whole[1:], start[1:]) == (["80.0", "90.0"], ["50.0", "50.0"])
    assert (median[1:], worst[1:]) == (["inf", "0.00"], ["inf", "0.00"])


def test_a_trainers_loader_is_not_given_modules_of_the_folder_that_one_is_in(tmp_path):
    semantic = tmp_path / "LiDAR-MOS" / "mos_SalsaNext" / "train" / "tasks" / "semantic"
    (semantic / "dataset" / "kitti").mkdir(parents=True)
    (semantic / "__init__.py").write_text("import sys\nsys.path.insert(0, '../../')\n")  # as theirs does
    (semantic / "dataset" / "kitti" / "parser.py").write_text("import own\nclass SemanticKitti: pass\n")
    (semantic.parents[1] / "own.py").touch()
    (tmp_path / "own.py").write_text("raise RuntimeError\n")
    (tmp_path / "here" / "below" / "semantickitti").mkdir(parents=True)
    (tmp_path / "here" / "below" / "semantickitti" / "dataset.json").write_text("{}")
    loaders = Path(__file__).parents[1] / "benchmarks" / "consumers" / "loaders.py"
    words = [sys.executable, str(loaders), "LiDAR-MOS", "../..", "."]
    done = subprocess.run(words, cwd=tmp_path / "here" / "below", capture_output=True, text=True)
    assert (done.returncode, done.stdout[:9]) == (0, "0 images "), done.stderr
