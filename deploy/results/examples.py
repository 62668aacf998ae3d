#!/usr/bin/env python3
"""Three plots of results. They need python3-pandas and python3-matplotlib.

    examples.py force DIR                  the force on each operator over time, of a run or a session
    examples.py error LAB_DIR              the force error against the run time, of `subworld lab coupling`
    examples.py lateness DIR [DIR ...]     how late the haptic steps of several runs in real time begin

--out FILE names the picture; otherwise it is NAME.png here.
"""

import argparse

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plots

import subworld_results as results

PERCENT = [50, 75, 90, 95, 99, 99.5, 99.9, 99.99, 100]


def force(axes, folders):
    run = results.load(folders[0])
    for user, table in run.users.items():
        axes.plot(table.index, results.norm(table, "operator_force"), linewidth=0.8, label=run.name(user))
    axes.set(title=f"{run.summary['scene']}: {run.verdict}", xlabel="simulated time, s", ylabel="force, N")


def error(axes, folders):
    rows = results.load_lab(folders[0])["results"]
    rows["cpu"] = rows["world_cpu_s_per_s"] + rows["haptic_cpu_s_per_s"] + rows["synchronise_cpu_s_per_s"]
    for (scene, scheme), points in rows.groupby(["scene", "scheme"], sort=False):
        points = points.sort_values("cpu")
        axes.loglog(points["cpu"], 100 * points["force_error_rms"], "o-", label=f"{scene}, {scheme}")
    axes.set(xlabel="CPU time, s for each simulated s", ylabel="RMS error of the felt force, %")


def lateness(axes, folders):
    for folder in folders:
        run = results.load(folder)
        for user, table in run.users.items():
            if not table["lateness_s"].any():
                print(f"{folder}: no step was late: a run in lock-step has no clock")
                continue
            late_ms = 1e3 * table["lateness_s"].quantile([p / 100 for p in PERCENT])
            axes.semilogy(range(len(PERCENT)), late_ms, "o-", label=f"{run.folder.name}, {run.name(user)}")
    axes.set_xticks(range(len(PERCENT)), [f"{p:g}" for p in PERCENT])
    axes.set(xlabel="percent of the steps", ylabel="begin at most so late, ms")


def main():
    known = {plot.__name__: plot for plot in (force, error, lateness)}
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("plot", choices=known)
    words.add_argument("folders", nargs="+", metavar="DIR")
    words.add_argument("--out", help="picture")
    asked = words.parse_args()
    figure, axes = plots.subplots(figsize=(9, 5))
    try:
        known[asked.plot](axes, asked.folders)
    except results.ResultsError as wrong:
        raise SystemExit(f"examples.py: error: {wrong}") from wrong
    axes.grid(alpha=0.3)
    axes.legend()
    figure.tight_layout()
    out = asked.out or f"{asked.plot}.png"
    figure.savefig(out, dpi=120)
    print(f"picture: {out}")


if __name__ == "__main__":
    main()
