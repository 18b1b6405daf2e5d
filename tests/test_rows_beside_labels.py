"""What tables show of networks, maps, the review, the simulator and costs, of results made by hand."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
import rows_beside_labels as rows
import rows_of_cost


def test_fine_tuning_has_a_column_for_each_network_kept_and_the_best():
    methods = ("LMNet + ours, retrained", "LMNet + ours, fine-tuned")
    scored = [{"method": method, "iou": iou} for method, iou in zip(methods, (0.6, 0.7), strict=True)]
    validation = {"fine-tuned": [0.2, 0.5, 0.4], "retrained": [0.0, 0.3, 0.1]}
    assert rows.fine_tuning({"rows": scored, "curves": {"validation": validation, "test": {"0": 0.4, "2": 0.65}}}) == [
        ["epochs in the other environment", "0", "2", "best"],
        ["fine-tuned, test recordings", "40.0", "65.0", "70.0"],
        ["fine-tuned, validation scans", "20.0", "40.0", "50.0"],
        ["retrained, test recordings", "", "", "60.0"],
        ["retrained, validation scans", "0.0", "10.0", "30.0"],
    ]


def test_self_training_has_three_ratios_a_round_and_a_dash_where_nothing_was_called_moving():
    found = {"labels": [95.0, 99.0, 96.0], "network": [0.0, None, 0.0], "labels with the network": [92.0, 99.5, 92.4]}
    assert rows.self_training({"city_HDL-64E_32": found})[1] == [
        "`city_HDL-64E_32`",
        "95.0 / 99.0 / 96.0",
        "0.0 / - / 0.0",
        "92.0 / 99.5 / 92.4",
    ]


def test_each_stage_of_a_network_has_its_median_and_its_99th_percentile():
    stages = {name: {"median": 1.0, "p99": 2.5} for name in ("odometry", "image", "network", "clean-up", "all")}
    row = {"engine": "torch on cpu", "image": "64 x 512", "points": 120000, "milliseconds": stages}
    heading, cells = rows.segment_speed([row | {"scans_per_second": 21.06, "cpu_milliseconds": 54.6}])
    assert heading[4:7] == ["image: projection, residuals", "network", "clean-up: kNN"]
    assert cells == ["torch on cpu", "64 x 512", "120,000", *["1.0 / 2.5"] * 5, "21.1", "55"]


def test_simulated_and_real_figures_stand_beside_their_ratio():
    pair = {"real": {"points": 120000.0, "moving": None}, "simulated": {"points": 108000.4, "moving": 0.01234}}
    assert rows.simulator_statistics({"drive / city": pair}) == [
        ["", "drive", "`city`", "ratio"],
        ["points", "120,000", "108,000", "0.90"],
        ["moving", "-", "0.01234", "-"],
    ]


def test_a_yardstick_that_no_pair_agrees_on_has_dashes():
    off = {"odometry_percent": 0.2, "reference_percent": 1.25, "close_odometry": 0.3, "close_reference": 0.05}
    found = {"drive, 5 s": {"pairs": 9, "agreed": 8, **off}, "canyon, 5 s": {"pairs": 3, "agreed": 0}}
    assert rows.reference_poses(found)[1:] == [
        ["drive, 5 s", "8 of 9", "0.20 %", "1.25 %", "30.0 %", "5.0 %"],
        ["canyon, 5 s", "0 of 3", "-", "-", "-", "-"],
    ]


def test_maps_have_the_usual_six_metrics():
    found = {"title": "X", "PR": 0.9, "RR": 0.8, "F1": 0.85, "SA": 1.0, "DA": None, "AA": None}
    assert rows.maps({"x": found})[1] == ["X", "90.0", "80.0", "85.0", "100.0", "-", "-"]


def test_samples_say_how_many_intervals_hold_the_truth():
    ratios = {"precision": 0.986, "recall": 0.936}
    row = {"samples": 100, "truth": ratios, "holds": {"precision": 97, "recall": 98}}
    width = {"width": {"precision": 0.09, "recall": 0.06}}
    cells = ["city-VLP-16-60-60", "98.6", "97 of 100", "93.6", "98 of 100", "9 and 6 points"]
    assert rows.sampling({"city-VLP-16-60-60-v5": row | width})[1] == cells


def test_the_review_has_its_queue_and_its_waits():
    queue = {"objects": 1204, "hold_95_percent": 316, "doubtful_points": 36000.2, "first_share": 0.76}
    found = {"a": queue | {"wrong_points": 3600}, "b": queue | {"wrong_points": None}}
    assert [row[1:] for row in rows.review_queue(found)[1:]] == [
        ["1,204", "316", "76 %", "36,000", "3,600"],
        ["1,204", "316", "76 %", "36,000", "-"],
    ]
    assert rows.review({"it opens": [1.0], "a decision": [0.01, 0.02, 0.03]})[1:] == [
        ["it opens", "1.000 s", "1.000 s"],
        ["a decision", "0.020 s", "0.029 s"],
    ]


def test_costs_name_presets_and_workers():
    row = {"recording": "drive, 154 scans", "cpu_seconds_per_scan": 0.196, "peak_mb": {"all": 649.2}}
    assert rows_of_cost.cost([row], [row | {"preset": "paper"}])[1:] == [
        ["drive, 154 scans", "`default`", "0.20", "649 MB"],
        ["drive, 154 scans", "`paper`", "0.20", "649 MB"],
    ]
    spent = {"recordings": 64, "wall_s": 100.0, "cpu_per_scan_s": 0.16, "busy": 0.98, "overhead_per_recording_s": 0.05}
    fleet = spent | {"peak_mb_first_quarter": 304.0, "peak_mb": 340.0}
    found = rows_of_cost.scale([fleet | {"what": "pool", "workers": 2}, fleet | {"what": "ray", "workers": 2}])
    assert [row[0] for row in found[1:]] == ["two processes", "Ray, two machines of one core"]
    assert found[1][1:] == ["64", "100.0", "0.160", "98 %", "0.05 s", "304 -> 340 MB"]


def test_libraries_have_a_row_an_implementation_and_one_a_package():
    sizes = {"version": "1.1", "licence": "GPL", "own MB": 0.2, "MB beside ours": 0.21}
    found = {"files": {".ply, ours": {"ms": 0.694, "points, wrong": 1}}, "packages": {"plyfile": sizes}}
    assert rows_of_cost.libraries(found)[1:] == [["files", ".ply, ours", "ms: 0.694; points, wrong: 1"]]
    assert rows_of_cost.packages(found)[1:] == [["plyfile", "1.1", "GPL", "0.2", "0.2"]]
    assert len(rows_of_cost.packages({"files": {}})) == 1  # the short form has none


def test_parts_of_recordings_have_a_column_each_and_forms_of_one_method_a_row():
    row = {"iou": 0.9, "precision": 1.0, "recall": None, "false": 1716}
    found = {
        "M-detector": {"a": row, "b": row},
        "M-detector, less": {"a": row, "b": row},
        "HMM-MOS": {"a": row, "b": row},
    }
    cell = "90.0 (100.0 / -), 1,716 false"
    forms = [["", "a", "b"], ["M-detector", cell, cell], ["M-detector, less", cell, cell]]
    assert rows.rivals_in_parts("M-detector")(found) == forms
    scores = {"iou": 0.741, "precision": 0.99, "recall": 0.746}
    assert rows.hmm_mos({"drive": {"methods": {"hmm_mos": scores}}})[2] == ["ours", "74.1", "99.0", "74.6"]


def test_the_first_minute_has_a_dash_where_a_command_was_not_repeated():
    run = {"wall": 32.4, "cpu": 60.1}
    assert rows_of_cost.first_minute({"automos demo": {"cold": run, "warm": run}})[1:] == [
        ["`automos demo`", "32 s (60 s CPU)", "32 s (60 s CPU)", "-"]
    ]
    found = {"city": {"movers": 45.2, "movers_seen": 28.0, "first_s": 1.0, "mean_ms": 87.4, "max_ms": 111.6}}
    assert rows_of_cost.simulator_speed(found)[1] == ["`city`", "45", "28", "87", "112"]
