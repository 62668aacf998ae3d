#!/usr/bin/python3
"""Checks the Python modules: check.py WHAT FOLDER, with the build's programs."""

import fcntl
import json
import math
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import subworld
import subworld_study
import yaml


def expect(condition, text):
    if not condition:
        sys.exit(f"check.py: {text}")


def staircases(_folder):
    """Observers with a known threshold. With 60 answers and this slope, the least possible RMS error is 2 %."""
    for rule, make in subworld_study.RULES.items():
        errors = []
        for seed in range(60):
            stairs = make(start=800, step=1.1, lowest=50, highest=3000, slope=8)
            observer, answers = subworld_study.Observer(400, 8, seed), []
            for _ in range(60):
                answers.append((stairs.value, observer.says_yes(stairs.value)))
                stairs.answer(answers[-1][1])
            errors.append(math.log(subworld_study.fitted_threshold(answers, 8) / 400))
        within = sum(abs(error) < 0.05 for error in errors) / len(errors)
        expect(within >= 0.9, f"{rule}: {within:.2f} of the thresholds are within 5 %")
        expect(abs(sum(errors) / len(errors)) < 0.015, f"{rule}: bias {sum(errors) / len(errors):.3f}")


def orders(_folder):
    for count in range(2, 8):
        rows = subworld_study.latin_square(count)
        for place in range(count):
            expect(len({row[place] for row in rows}) == count, f"{count}: not all are at place {place}")
        pairs = [(row[i], row[i + 1]) for row in rows for i in range(count - 1)]
        expect(len({pairs.count(pair) for pair in pairs}) == 1, f"{count}: some pairs are more often")


STUDY = """
name: kill
scene: press
set: {duration_s: 0.1, settle.duration_s: 0.1}
flags: {mode: lockstep, dds: cyclonedds}
conditions: {a: {}, b: {users.coupling.stiffness_n_m: 300}}
trials: 4
pause: false
questions: [{name: hard, text: "Hard?", answers: ["no", "yes"]}]
"""


def study(folder):
    """A study that is killed, and then goes on."""
    file, out = folder / "study.yaml", folder / "out"
    file.write_text(STUDY)
    words = [str(Path(subworld.command()).parent / "subworld_study"), str(file), "--out", str(out), "--observer", "1"]
    table = out / "trials_1.csv"
    killed = subprocess.Popen(words)
    while not table.exists() or table.read_text().count("\n") < 4:
        time.sleep(0.005)
    killed.kill()
    killed.wait()
    done = table.read_text()
    expect(done.count("\n") < 9, "it was over already")
    table.write_text(done + "kill,1,cut o")  # a row that was not written whole
    expect(subprocess.run(words, check=False).returncode == 0, "it does not go on")
    lines = table.read_text().splitlines()
    expect(table.read_text().startswith(done), "rows have changed")
    expect([line.split(",")[2] for line in lines[1:]] == [str(i) for i in range(8)], "trials are missing, or twice")
    expect(sum(",a," in line for line in lines) == 4, "conditions are not balanced")
    expect(all(",ok," in line for line in lines[1:]), "a trial has no verdict")

    def refused(words, says):
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        expect(done.returncode == 2 and says in done.stderr, f"{says}: {done.returncode} {done.stderr}")

    refused([*words, "--no-runs"], "without runs")
    file.write_text(STUDY.replace("stiffness_n_m: 300", "stiffness_n_m: 400"))
    refused(words, "has changed since")
    file.write_text(STUDY.replace("stiffness_n_m: 300", "stifness_n_m: 300"))
    refused([*words[:3], str(folder / "typo"), *words[4:]], "users.coupling.stifness_n_m")
    with open(table, "a", encoding="utf-8") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        refused(words, "is under way")


def mistakes(folder):
    """Study files that are wrong say so, before anything runs."""
    right = yaml.safe_load(STUDY)
    stairs = {"parameter": "h_s", "start": 2, "lowest": 1, "highest": 4, "question": "hard"}
    for change, says in [
        ({"trials": "x"}, "trials"), ({"set": [1]}, "set"), ({"flags": {"out": "x"}}, "flags.out"),
        ({"questions": [{"name": "verdict", "text": "?", "from": 1, "to": 2}]}, "verdict"),
        ({"questions": [{"name": "a", "text": "?", "from": 1}]}, "from and to"),
        ({"questions": [{"name": "a", "text": "?", "answers": [False, True]}]}, "quotes"),
        ({"conditions": None}, "either conditions"), ({"order": "x"}, "latin_square"), ({"sene": 1}, "unknown key"),
        ({"questions": [{"name": "a", "text": "?", "answers": []}]}, "at least two"), ({"conditions": {"a": 7}}, "conditions.a"),
        ({"conditions": None, "staircase": 5}, "staircase"),
        ({"conditions": None, "staircase": {**stairs, "highest": math.inf}}, "finite"),
        ({"staircase": stairs}, "either conditions"), ({"staircase": {**stairs, "step": 1}}, "either conditions"),
    ]:
        data = {**right, **change}
        if data.get("conditions") is None:
            del data["conditions"]
        file = folder / "wrong.yaml"
        file.write_text(yaml.safe_dump(data))
        try:
            subworld_study.Study.load(file)
            expect(False, f"{change} is accepted")
        except subworld_study.StudyError as wrong:
            expect(says in str(wrong), f"{change}: {wrong}")
    file.write_text("scene: press\nconditions: {a: {}, a: {}}\n")
    try:
        subworld_study.Study.load(file)
        expect(False, "a condition may be there twice")
    except subworld_study.StudyError as wrong:
        expect("twice" in str(wrong), str(wrong))


def module(folder):
    lines = []
    table = subworld.sweep("press", {"scheme": ["paper", "reduced"]}, out=folder / "sweep", mode="lockstep",
                           duration=0.1, dds="cyclonedds", measure=lambda r: lines.append(1) or subworld.row_of(r))
    expect(len(table) == 2 and all(table.verdict == "ok"), str(table))
    expect(table.state_hash.nunique() == 2, "the setting had no effect")
    before = {file: file.stat().st_mtime_ns for file in (folder / "sweep").rglob("summary.json")}
    again = subworld.sweep("press", {"scheme": ["paper", "reduced"]}, out=folder / "sweep", mode="lockstep",
                           duration=0.1, dds="cyclonedds")
    expect(list(again.state_hash) == list(table.state_hash), "the second call has another result")
    expect(all(file.stat().st_mtime_ns == since for file, since in before.items()), "it was run again")

    scene = subworld.Scene("built", duration_s=0.1).material("wood", friction=0.5).plane(material="wood")
    scene.box("cube", [0.1] * 3, 0.2, [0, 0, 0.05], material="wood")
    scene.user("one", {"shape": "sphere", "radius_m": 0.03, "mass_kg": 0.1, "position_m": [-0.2, 0, 0.05]})
    built = subworld.run(scene.write(folder / "built.yaml"), folder / "built", mode="lockstep", dds="cyclonedds")
    expect(built.ok and len(built.tables.users[0]) > 50, built.verdict)

    with subworld.start("press", folder / "live", mode="lockstep", duration=600, dds="cyclonedds") as live:
        reader, end = live.forces(), time.monotonic() + 30
        while len(reader.take()) == 0:
            expect(time.monotonic() < end, "no force in lock-step")
        expect("paused" in live.control("pause"), live.log)
        expect("resumed" in live.control("resume"), live.log)
    try:
        subworld.run("press", folder / "long", timeout_s=1, mode="lockstep", duration=600, dds="cyclonedds")
        expect(False, "it is not stopped")
    except subworld.SubworldError as wrong:
        expect("within 1 s" in str(wrong), str(wrong))
    try:
        subworld.sweep("press", {"friction": [1]}, out=folder / "wrong")
        expect(False, "no error")
    except subworld.SubworldError as wrong:
        expect(str(wrong).startswith("{'friction': 1}: "), str(wrong))
    stopped = json.loads((folder / "long" / "summary.json").read_text(encoding="utf-8"))
    expect(stopped["verdict"].startswith("stopped by SIGTERM"), stopped["verdict"])
    try:
        subworld.run("no_such_scene", folder / "none")
        expect(False, "no error")
    except subworld.SubworldError as wrong:
        expect(wrong.code == 2 and "no_such_scene" in str(wrong), str(wrong))


def core(folder):
    """The module in this process has the bits of the programs, and says what is wrong."""
    import subworld_core

    settings = {"duration_s": 0.3, "scheme": "paper", "disable": "suppression"}
    here = subworld_core.InProcess("lift", settings)
    here.finish()
    there = subworld.run("lift", folder / "there", mode="lockstep", dds="cyclonedds", set=settings)
    here.finish()  # has no effect any more
    expect(here.state_hash == there.summary["state_hash"], f"{here.state_hash}: another result than that of the programs")
    for user in (0, 1):
        table = there.tables.users[user]
        least = min(len(table), len(here.force_n(user)))
        away = abs(here.force_n(user)[:least, 0] - table.force_x_n.to_numpy()[:least]).max()
        expect(least > 250 and away < 1e-6, f"user {user}: {least} steps, {away} N away")
    for wrong, says in [
        (lambda: subworld_core.InProcess("nothing"), "neither a file nor"), (here.step, "over"),
        (lambda: subworld_core.InProcess("lift", {"ratio": 0}), "at least 1"), (lambda: here.force_n(2), "2 take part"),
        (lambda: subworld_core.add_scheme("paper", lambda *_: (0, 0)), "already"), (lambda: here.state("x"), "x"),
    ]:
        try:
            wrong()
            expect(False, f"no error: {says}")
        except (subworld_core.Error, LookupError) as error:
            expect(says in str(error), str(error))
    subworld_core.add_scheme("wrong", lambda owner, lag: (2, 0))
    try:
        subworld_core.InProcess("lift", {"scheme": "wrong"}).finish()
        expect(False, "a correction of 2 is accepted")
    except ValueError as error:
        expect("from 0 to 1" in str(error), str(error))


def live(folder):
    """Forces of a running simulation are those of its history."""
    seen = []
    with subworld.start("press", folder / "live", mode="realtime", duration=2, dds="cyclonedds") as run:
        reader = run.forces()
        while run.running:
            seen.extend(reader.take())
            time.sleep(0.002)
        result = run.wait()
    table = result.tables.users[0].operator_force_x_n
    expect(len(seen) > 500, f"{len(seen)} forces")
    times = [row[0] for row in seen if 0 < row[0] < 1.99]  # before the start and after the end, time stands still
    expect(times == sorted(set(times)), "a force was read twice, or late")
    of_history = table[(table.index >= times[0]) & (table.index <= times[-1])]
    away = abs(min(row[1] for row in seen) - of_history.min())
    expect(of_history.min() < -5 and away < 0.5, f"{of_history.min()} N, {away} N away")


def page(folder):
    """The examples of deploy/python/README.md; of the repeats one is enough."""
    os.chdir(folder)
    text = (Path(__file__).resolve().parents[3] / "deploy/python/README.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, re.S)
    expect(len(blocks) == 3, f"{len(blocks)} examples")
    for block in blocks:
        exec(block.replace("repeats=10", "repeats=1"), {})  # pylint: disable=exec-used


if __name__ == "__main__":
    globals()[sys.argv[1]](Path(sys.argv[2]))
