"""Checks subworld_results.py on real results: check.py run DIR, check.py lab DIR, check.py errors EMPTY_DIR."""

import sys
from pathlib import Path

import subworld_results as results


def near(a, b):
    assert abs(a - b) <= 1e-6 * max(1.0, abs(b)), (a, b)


def check_run(folder):
    run = results.load(folder)
    assert run.verdict == run.summary["verdict"] == results.load(folder + "/summary.json").verdict
    assert len(run.gates) == len(run.summary["gates"]) and run.gates["ok"].all()
    assert run.world.index.name == "time_s" and len(run.world) == run.summary["world"]["cycles"]
    assert sorted(run.users) == sorted(run.devices) == [0, 1]
    for user, haptic in enumerate(run.summary["haptic"]):
        table = run.users[user]
        force = results.norm(table, "operator_force")
        assert table.index.is_monotonic_increasing and len(table) == haptic["steps"]
        near((force**2).mean() ** 0.5, haptic["force_rms_n"])
        near(force.max(), haptic["force_max_n"])
        assert run.name(user) == run.summary["settings"]["users"][user]["name"]
        assert len(run.devices[user]) == run.summary["device"][user]["steps"]
    assert run.bodies["body"].nunique() == run.summary["world"]["body_history"]["bodies"]
    refuse(lambda: results.norm(run.world, "operator_force"), "no column operator_force_x_n")
    refuse(lambda: results.load_lab(folder), "use load()")


def check_lab(folder):
    lab = results.load_lab(folder)
    assert len(lab["results"]) == results.lab_summary(folder)["points"]
    assert {"scheme", "ratio", "force_error_rms", "world_step_s_p99"} <= set(lab["results"])
    assert "users" in lab and any(name.startswith("traces/") for name in lab)
    refuse(lambda: results.load(folder), "use load_lab()")


def check_errors(folder):
    refuse(lambda: results.load(folder + "/none"), "no such folder")
    refuse(lambda: results.load_lab(folder + "/none"), "no such folder")
    (Path(folder) / "new").mkdir()
    refuse(lambda: results.load(folder + "/new"), "no run and no lab has ended here")
    (Path(folder) / "new/haptic_0.csv").write_text("time_s,members\n")
    refuse(lambda: results.load(folder + "/new"), "subworld collect")
    for text in ["", "{", "[1]", '"x"']:
        (Path(folder) / "new/summary.json").write_text(text)
        refuse(lambda: results.load(folder + "/new"), "summary.json")
    # A run that failed before it had a row.
    (Path(folder) / "new/summary.json").write_text('{"verdict": "failed: x"}')
    (Path(folder) / "new/world.csv").write_text("")
    run = results.load(folder + "/new")
    assert run.world.empty and run.users[0].empty and run.gates.empty and run.name(0) == "user 0"


def refuse(call, words):
    try:
        call()
    except results.ResultsError as wrong:
        assert words in str(wrong), wrong
    else:
        raise AssertionError(f"not refused: {words}")


if __name__ == "__main__":
    {"run": check_run, "lab": check_lab, "errors": check_errors}[sys.argv[1]](sys.argv[2])
    print("checked", sys.argv[1])
