"""Studies with people, or with a simulated observer: conditions, trials, staircases, questions, one table.

deploy/python/README.md describes the study's file. `subworld study` is this module's main().
"""

import argparse
import csv
import fcntl
import json
import math
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
import webbrowser
from dataclasses import dataclass, field
from pathlib import Path

import yaml

import subworld
from subworld_study_page import Page


class StudyError(ValueError):
    """A study's file, or a folder, that cannot be used. The text names the place and the cure."""


# Psychometrics ------------------------------------------------------------------------------------------------------


def detected_ratio(value: float, threshold: float, slope: float, guess: float = 0.0, lapse: float = 0.0) -> float:
    """Share of the answers "yes" for a value, 1 (Weibull). At the threshold it is 63 %, without guesses and lapses."""
    return guess + (1 - guess - lapse) * (1 - math.exp(-((value / threshold) ** slope)))


def fitted_threshold(answers, slope: float, guess: float = 0.0, lapse: float = 0.01) -> float:
    """The threshold under which the answers, pairs (value, yes), are most likely."""
    lowest, highest = min(value for value, _ in answers), max(value for value, _ in answers)
    steps = 400
    grid = [lowest / 3 * (9 * highest / lowest) ** (i / steps) for i in range(steps + 1)]

    def likelihood(threshold):
        total = 0.0
        for value, yes in answers:
            ratio = min(max(detected_ratio(value, threshold, slope, guess, lapse), 1e-9), 1 - 1e-9)
            total += math.log(ratio if yes else 1 - ratio)
        return total

    return max(grid, key=likelihood)


class OneUpTwoDown:
    """Down a step after two answers "yes" in a row, up after each "no" (Levitt 1971): converges to 70.7 % "yes".

    Steps are factors. The first ones are the square of `step`, until the second turn.
    """

    def __init__(self, start: float, step: float, lowest: float, highest: float, **_):
        self.value, self._step, self._bounds = start, step, (lowest, highest)
        self._yes, self._turns, self._last = 0, 0, 0

    def answer(self, yes: bool):
        self._yes = self._yes + 1 if yes else 0
        direction = -1 if self._yes == 2 else (0 if yes else 1)
        if direction == 0:
            return
        self._yes = 0
        if self._last and direction != self._last:
            self._turns += 1
        self._last = direction
        factor = self._step ** (2 if self._turns < 2 else 1)
        self.value = min(max(self.value * factor**direction, self._bounds[0]), self._bounds[1])


class Quest:
    """The most likely threshold so far is the next value (Watson and Pelli 1983), on a grid of its logarithm."""

    def __init__(self, start: float, lowest: float, highest: float, slope: float = 3.5, guess: float = 0.0, **_):
        steps = 300
        self._grid = [lowest * (highest / lowest) ** (i / steps) for i in range(steps + 1)]
        spread = math.log(highest / lowest) / 2
        self._log = [-0.5 * (math.log(one / start) / spread) ** 2 for one in self._grid]
        self._slope, self._guess, self.value = slope, guess, start

    def answer(self, yes: bool):
        for i, threshold in enumerate(self._grid):
            ratio = detected_ratio(self.value, threshold, self._slope, self._guess, 0.01)
            self._log[i] += math.log(max(ratio if yes else 1 - ratio, 1e-9))
        peak = max(self._log)
        weights = [math.exp(one - peak) for one in self._log]
        mean = sum(w * math.log(one) for w, one in zip(weights, self._grid)) / sum(weights)
        self.value = math.exp(mean)


RULES = {"one_up_two_down": OneUpTwoDown, "quest": Quest}


class Observer:
    """Answers as a person with this threshold would."""

    def __init__(self, threshold: float, slope: float, seed: int):
        self._threshold, self._slope, self._random = threshold, slope, random.Random(seed)
        self.name = f"{threshold:g} {slope:g}"

    def says_yes(self, value: float) -> bool:
        return self._random.random() < detected_ratio(value, self._threshold, self._slope)


# The study ----------------------------------------------------------------------------------------------------------


def latin_square(count: int) -> list:
    """Orders of `count` conditions: each is once at each place, and follows each other one equally often.

    For an odd count the orders and their mirror images (Williams 1949).
    """
    first = [0]
    for i in range(1, count):
        first.append((i + 1) // 2 if i % 2 else count - i // 2)
    rows = [[(one + shift) % count for one in first] for shift in range(count)]
    return rows if count % 2 == 0 else rows + [row[::-1] for row in rows]


@dataclass
class Trial:
    number: int
    block: int
    condition: str
    set: dict


KEYS = {
    "name", "scene", "set", "flags", "conditions", "trials", "blocks", "order", "seed", "record", "instructions",
    "questions", "staircase", "pause",
}
STAIRCASE_KEYS = {"parameter", "rule", "start", "step", "lowest", "highest", "slope", "guess", "question"}


class Loader(yaml.SafeLoader):
    """Refuses two equal keys, of which the first would vanish."""

    def construct_mapping(self, node, deep=False):
        keys = [self.construct_object(key, deep=deep) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise StudyError(f"line {node.start_mark.line + 1}: {key} is there twice")
        return super().construct_mapping(node, deep)


COLUMNS = ["study", "participant", "trial", "block", "condition", "value", "set", "folder", "recording", "verdict"]
COLUMNS += ["state_hash", "force_rms_n", "started", "answered_s", "observer"]


@dataclass
class Study:
    """A study's file. `trials`: for each condition in each block; for a staircase, in all."""

    file: Path
    data: dict
    questions: list = field(default_factory=list)

    @staticmethod
    def load(file) -> "Study":
        try:
            data = yaml.load(Path(file).read_text(encoding="utf-8"), Loader)
        except OSError as wrong:
            raise StudyError(f"{file}: {wrong.strerror}") from wrong
        except (yaml.YAMLError, StudyError) as wrong:
            raise StudyError(f"{file}: {wrong}") from wrong
        if not isinstance(data, dict) or "scene" not in data:
            raise StudyError(f"{file}: names no scene")
        study = Study(Path(file), data, data.get("questions", []))
        study.check()
        return study

    def check(self):
        def refuse(text):
            raise StudyError(f"{self.file}: {text}")

        for key in self.data.keys() - KEYS:
            refuse(f"{key}: unknown key; there are {', '.join(sorted(KEYS))}")
        if ("conditions" in self.data) == ("staircase" in self.data):
            refuse("give either conditions or a staircase")
        if self.data.get("order", "random") not in ("random", "latin_square", "fixed"):
            refuse(f"order: {self.data['order']}: choose one of random, latin_square, fixed")
        for key, least in (("trials", 1), ("blocks", 1)):
            if not isinstance(self.data.get(key, least), int) or self.data.get(key, least) < least:
                refuse(f"{key}: {self.data[key]}: must be a whole number from {least}")
        for key in ("set", "flags", "conditions"):
            if not isinstance(self.data.get(key) or {}, dict):
                refuse(f"{key}: must be a list of KEY: VALUE")
        for key in {"out", "set"} & (self.data.get("flags") or {}).keys():
            refuse(f"flags.{key}: the study chooses it")
        if not isinstance(self.questions, list):
            refuse("questions: must be a list")
        names = [one.get("name") if isinstance(one, dict) else None for one in self.questions]
        for question, name in zip(self.questions, names):
            if not isinstance(question, dict) or not {"name", "text"} <= question.keys():
                refuse(f"questions: {question}: has no name, or no text")
            if name in COLUMNS or names.count(name) > 1:
                refuse(f"questions: {name}: is the name of another column of the table")
            if ("answers" in question) == ("from" in question):
                refuse(f"questions: {name}: has either answers, or from and to")
            if "answers" in question and (not isinstance(question["answers"], list) or len(question["answers"]) < 2
                                          or len(set(map(str, question["answers"]))) < len(question["answers"])):
                refuse(f"questions: {name}: answers are a list of at least two different ones")
            if any(isinstance(one, bool) for one in question.get("answers", [])):
                refuse(f'questions: {name}: put yes and no into quotes: answers: ["no", "yes"]')
            if "from" in question:
                ends = [question["from"], question.get("to")]
                if not all(isinstance(one, int) for one in ends) or ends[0] >= ends[1]:
                    refuse(f"questions: {name}: from and to are whole numbers, from < to")
        for name, changes in (self.data.get("conditions") or {}).items():
            if not isinstance(changes or {}, dict):
                refuse(f"conditions.{name}: must be a list of KEY: VALUE")
        stairs = self.data.get("staircase")
        if "staircase" not in self.data:
            return
        if not isinstance(stairs, dict):
            refuse("staircase: must be a list of KEY: VALUE")
        for key in stairs.keys() - STAIRCASE_KEYS:
            refuse(f"staircase.{key}: unknown key; there are {', '.join(sorted(STAIRCASE_KEYS))}")
        for key in ("parameter", "start", "lowest", "highest", "question"):
            if key not in stairs:
                refuse(f"staircase: has no {key}")
        if stairs.get("rule", "quest") not in RULES:
            refuse(f"staircase.rule: choose one of {', '.join(RULES)}")
        numbers = {"slope": 3.5, "guess": 0.0, "step": 1.2, **stairs}
        for key in ("start", "lowest", "highest", "slope", "guess", "step"):
            if (isinstance(numbers[key], bool) or not isinstance(numbers[key], (int, float))
                    or not math.isfinite(numbers[key])):
                refuse(f"staircase.{key}: {numbers[key]}: must be a finite number")
        if not 0 < stairs["lowest"] <= stairs["start"] <= stairs["highest"] or stairs["lowest"] == stairs["highest"]:
            refuse("staircase: 0 < lowest <= start <= highest must hold")
        if numbers["step"] <= 1 or numbers["slope"] <= 0 or not 0 <= numbers["guess"] < 0.9:
            refuse("staircase: step > 1, slope > 0 and 0 <= guess < 0.9 must hold")
        asked = [one for one in self.questions if one["name"] == stairs["question"] and len(one.get("answers", [])) == 2]
        if not asked:
            refuse(f"staircase.question: {stairs['question']}: is no question with two answers; the second means yes")

    def changes(self, trial: "Trial", value=None) -> dict:
        """Settings of a trial."""
        stairs = self.data.get("staircase")
        return {**(self.data.get("set") or {}), **trial.set, **({stairs["parameter"]: value} if stairs else {})}

    def try_settings(self, trials: list, value):
        """Raises StudyError for a scene or a setting that does not exist, before a person begins."""
        for condition in {trial.condition: trial for trial in trials}.values():
            words = [subworld.command(), "plan", str(self.data["scene"])]
            for key, one in self.changes(condition, value).items():
                words += subworld.set_words(key, one)
            done = subprocess.run(words, capture_output=True, text=True, check=False)
            if done.returncode:
                raise StudyError(f"{self.file}: {condition.condition}: {done.stderr.strip()}")

    def plan(self, participant: int) -> list:
        """The trials of a participant, always the same ones. In a staircase the value is set when it is known."""
        count = int(self.data.get("trials", 1))
        if "staircase" in self.data:
            return [Trial(i, 0, "staircase", {}) for i in range(count)]
        names = list(self.data["conditions"])
        order = self.data.get("order", "random")
        shuffle = random.Random(f"{self.data.get('seed', 0)} {participant}").shuffle
        square = latin_square(len(names))
        trials = []
        for block in range(int(self.data.get("blocks", 1))):
            if order == "random":
                of_block = names * count
                shuffle(of_block)
            else:
                row = square[(participant - 1 + block) % len(square)] if order == "latin_square" else range(len(names))
                of_block = [names[i] for i in row for _ in range(count)]
            for name in of_block:
                trials.append(Trial(len(trials), block, name, self.data["conditions"][name] or {}))
        return trials


class Table:
    """trials.csv: a row for each trial that is complete, written at once and whole."""

    def __init__(self, file: Path, columns: list):
        self._file, self._columns = file, columns
        self.rows = []
        # Two at once would run each trial twice.
        self._lock = open(file, "a", encoding="utf-8")  # pylint: disable=consider-using-with
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as held:
            raise StudyError(f"{file}: a study of this participant is under way; end it, or wait") from held
        try:
            text = file.read_text(encoding="utf-8")
        except UnicodeDecodeError as wrong:
            raise StudyError(f"{file}: is no table of a study: {wrong}") from wrong
        whole = text[: text.rfind("\n") + 1]
        if whole != text:  # the last row was cut off
            file.write_text(whole, encoding="utf-8")
        if whole:
            reader = csv.DictReader(whole.splitlines())
            if reader.fieldnames != columns:
                raise StudyError(f"{file}: is of another study; name another folder with --out")
            self.rows = list(reader)
            for line, row in enumerate(self.rows, 2):
                if None in row or None in row.values():
                    raise StudyError(f"{file}:{line}: is not whole; remove the line, and its trial is run again")
        else:
            self._append(columns)

    def close(self):
        self._lock.close()

    def add(self, row: dict):
        self._append([row.get(column, "") for column in self._columns])
        self.rows.append({column: str(row.get(column, "")) for column in self._columns})

    def _append(self, values: list):
        with open(self._file, "a", newline="", encoding="utf-8") as out:
            csv.writer(out, lineterminator="\n").writerow(values)
            out.flush()
            os.fsync(out.fileno())


class Terminal:
    """The person of a study at the terminal."""

    def confirm(self, text: str):
        input(f"{text} Press Enter to go on.")

    def begin(self, number: int, count: int, opens: bool):
        pass

    def watch(self, run: subworld.Run):
        pass

    def ask(self, question: dict) -> str:
        """Asks until the answer is one of those there are."""
        answers = question.get("answers")
        choices = [str(i + 1) for i in range(len(answers))] if answers else None
        hint = ", ".join(f"{i + 1} = {one}" for i, one in enumerate(answers)) if answers else (
            f"{question['from']} to {question['to']}")
        while True:
            text = input(f"{question['text']} ({hint}): ").strip()
            if answers and text in choices:
                return str(answers[int(text) - 1])
            if answers and text in map(str, answers):
                return text
            if not answers and text.isdigit() and question["from"] <= int(text) <= question["to"]:
                return text
            print("Please give one of these.")

    def over(self):
        pass


def conduct(study: Study, participant: int, out: Path, observer: Observer = None, runs: bool = True,
            person=Terminal()) -> dict:
    """Goes on with a participant's trials in a folder, from the first one that its table does not have.

    `person` answers, a Terminal or a Page, unless there is an `observer`.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as wrong:
        raise StudyError(f"--out {out}: {wrong.strerror}") from wrong
    names = [question["name"] for question in study.questions]
    table = Table(out / f"trials_{participant}.csv", COLUMNS + names)
    answering = (observer.name if observer else "") + ("" if runs else " without runs")
    if any(row["observer"] != answering for row in table.rows):
        raise StudyError(f"{out}: has answers of another observer, of a person, or without runs; name another folder "
                         "with --out")
    stairs = study.data.get("staircase")
    rule = RULES[stairs.get("rule", "quest")](**{"step": 1.2, **stairs}) if stairs else None
    yes = next(q["answers"][1] for q in study.questions if q["name"] == stairs["question"]) if stairs else None
    answers = []

    def note(value, answer):
        answers.append((value, answer == str(yes)))
        rule.answer(answers[-1][1])

    for row in table.rows:
        if stairs:
            note(float(row["value"]), row[stairs["question"]])
    plan = study.plan(participant)
    for row, trial in zip(table.rows, plan):
        if not stairs and (row["condition"], row["set"]) != (trial.condition, json.dumps(study.changes(trial))):
            raise StudyError(f"{study.file}: trial {trial.number} was {row['condition']} {row['set']}; the study has "
                             "changed since: undo that, or name another folder with --out")
    if runs:
        study.try_settings(plan[len(table.rows) :], rule.value if rule else None)
    if observer:
        person = None
    if person and not table.rows and study.data.get("instructions"):
        person.confirm(study.data["instructions"])
    for trial in plan[len(table.rows) :]:
        value = rule.value if rule else ""
        changes = study.changes(trial, value)
        if observer and stairs:  # so that a study that goes on draws what it would have drawn
            observer = Observer(observer._threshold, observer._slope, trial.number + 1000 * participant)
        before = plan[trial.number - 1].block if trial.number else trial.block
        if person and trial.block != before and study.data.get("pause", True):
            person.confirm(f"Block {before + 1} is over.")
        folder = out / f"participant_{participant}" / f"trial_{trial.number:03d}"
        row = {"study": study.data.get("name", study.file.stem), "participant": participant, "trial": trial.number}
        row |= {"block": trial.block, "condition": trial.condition, "value": value, "set": json.dumps(changes)}
        row["observer"] = answering
        row["started"] = time.strftime("%Y-%m-%dT%H:%M:%S")
        if person and runs:
            person.begin(trial.number, len(plan), bool((study.data.get("flags") or {}).get("page")))
        if runs:
            shutil.rmtree(folder, ignore_errors=True)  # of a trial that did not end
            flags = dict(study.data.get("flags") or {})
            if study.data.get("record"):
                folder.parent.mkdir(parents=True, exist_ok=True)
                flags["record"] = row["recording"] = f"{folder}.mcap"
            with subworld.start(study.data["scene"], folder, set=changes, **flags) as run:
                if person:
                    person.watch(run)
                result = run.wait()
            users = result.summary.get("haptic", [])
            row |= {"folder": str(folder), "verdict": result.verdict, "state_hash": result.summary["state_hash"]}
            row["force_rms_n"] = " ".join(f"{user['force_rms_n']:.6g}" for user in users)
        begun = time.monotonic()
        for question in study.questions:
            if person:
                row[question["name"]] = person.ask(question)
            elif stairs and question["name"] == stairs["question"]:
                row[question["name"]] = question["answers"][1 if observer.says_yes(value) else 0]
            else:
                row[question["name"]] = (question.get("answers") or [question.get("from")])[0]
        row["answered_s"] = f"{time.monotonic() - begun:.3f}"
        table.add(row)
        if stairs:
            note(value, row[stairs["question"]])
        # A person must not learn it.
        condition = "" if person else f" {trial.condition} {value}"
        print(f"[{trial.number + 1}/{len(plan)}]{condition}", file=sys.stderr)
    table.close()
    if person:
        person.over()
    summary = {"trials": len(table.rows), "table": str(out / f"trials_{participant}.csv")}
    if stairs and answers:
        threshold = fitted_threshold(answers, stairs.get("slope", 3.5), stairs.get("guess", 0.0))
        summary["threshold"] = f"{threshold:.4g}"
        if not stairs["lowest"] <= threshold <= stairs["highest"]:
            summary["threshold"] = "not reached: " + (
                f"below {stairs['lowest']}" if threshold < stairs["lowest"] else f"above {stairs['highest']}")
    return summary


def participant_number(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 99999:
        raise argparse.ArgumentTypeError(f"{text}: from 1 to 99999")
    return int(text)


def positive(text: str) -> float:
    if not 0 < float(text) < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: must be a positive number")
    return float(text)


def page_of(port: int) -> Page:
    try:
        page = Page(port)
    except (OSError, OverflowError) as wrong:
        raise StudyError(f"--page {port}: {wrong}; choose another port, or none: a free one is taken") from wrong
    print(f"subworld study: page: {page.address}", flush=True)
    if any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")):
        webbrowser.open(page.address)
        for name in ("DISPLAY", "WAYLAND_DISPLAY"):  # each run would open its page in a further tab
            os.environ.pop(name, None)
    return page


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(
        "subworld study", formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Conducts a study: conditions, trials, staircases, questions, and one table for each participant.",
        epilog="Examples:\n  subworld study deploy/python/study.yaml --participant 1 --out out/study\n"
        "  subworld study deploy/python/staircase.yaml --observer 400\n"
        "A study that was interrupted goes on where it was: give the same command again.",
    )
    parser.add_argument("file", help="the study's file (YAML)")
    parser.add_argument("--participant", type=participant_number, default=1, help="number of the participant, from 1 (default: 1)")
    parser.add_argument("--out", type=Path, help="folder of the results (default: out/NAME)")
    parser.add_argument("--page", type=int, nargs="?", const=0, metavar="PORT",
                        help="the person reads and answers in a browser on this machine (default: a free port)")
    parser.add_argument("--observer", type=positive, metavar="THRESHOLD",
                        help="a simulated observer answers: yes to 63 %% of the trials at this value")
    parser.add_argument("--observer-slope", type=positive, default=3.5, help="of the observer, Weibull (default: 3.5)")
    parser.add_argument("--no-runs", action="store_true", help="ask only, without running the scene: to try a staircase")
    given = parser.parse_args(arguments)
    for one in (signal.SIGTERM, signal.SIGHUP):  # the run under way ends, too
        signal.signal(one, signal.default_int_handler)
    try:
        study = Study.load(given.file)
        name = re.sub(r"[^\w-]", "_", str(study.data.get("name", study.file.stem)))
        out = given.out or Path("out") / name
        observer = Observer(given.observer, given.observer_slope, given.participant) if given.observer else None
        if observer and given.page is not None:
            raise StudyError("--observer, --page: either an observer answers, or a person; remove one of them")
        person = Terminal() if given.page is None else page_of(given.page)
        summary = conduct(study, given.participant, out, observer, not given.no_runs, person)
    except (StudyError, subworld.SubworldError) as wrong:
        print(f"subworld study: error: {wrong}", file=sys.stderr)
        return 2 if isinstance(wrong, StudyError) else 1
    except (KeyboardInterrupt, EOFError):
        print("\nsubworld study: interrupted; the same command goes on", file=sys.stderr)
        return 1
    print("\n".join(f"{name}: {value}" for name, value in summary.items()))
    return 0
