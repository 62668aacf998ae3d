"""Results of Subworld as pandas tables. deploy/results/README.md has examples.

load(DIR) reads the folder of a run or of a session, load_lab(DIR) that of a lab.
"""

import io
import json
import re
from dataclasses import dataclass, field
from pathlib import Path

import pandas


class ResultsError(ValueError):
    """A folder or file that holds no results. The text says what is wrong, and the cure."""


@dataclass
class Run:
    """A run: `summary` is summary.json. Tables have the simulated time `time_s` (s) as index, units in column names."""

    folder: Path
    summary: dict
    world: pandas.DataFrame  # a row for each cycle
    users: dict  # by the number of the user: a row for each haptic step
    devices: dict  # likewise, in the own time of the device
    bodies: pandas.DataFrame = field(default_factory=pandas.DataFrame)  # of `--bodies`; else empty

    @property
    def verdict(self) -> str:
        return self.summary.get("verdict", "")

    @property
    def gates(self) -> pandas.DataFrame:
        """The quality gates, by name; empty for a run without an orderly end."""
        table = pandas.DataFrame(self.summary.get("gates", []))
        return table.set_index("name") if "name" in table else table

    def name(self, user: int) -> str:
        """The name of a user in the scene."""
        names = self.summary.get("settings", {}).get("users", [])
        return names[user].get("name", f"user {user}") if user < len(names) else f"user {user}"


def load(path) -> Run:
    """The run or session in a folder, or of the summary.json in one. A history that is missing is an empty table."""
    folder, summary = _summary(path)
    if "lab" in summary:
        raise ResultsError(f"{folder}: holds the results of a lab; use load_lab()")
    return Run(
        folder,
        summary,
        _history(folder / "world.csv"),
        _by_user(folder, "haptic"),
        _by_user(folder, "device"),
        _history(folder / "bodies.csv"),
    )


def load_lab(path) -> dict:
    """All tables of a lab by their names: "results", and where they are "users", "felt", "traces/NAME" ..."""
    folder, summary = _summary(path)
    if "lab" not in summary:
        raise ResultsError(f"{folder}: holds no results of a lab; use load() for those of a run")
    return {
        str(file.relative_to(folder).with_suffix("")): _table(file) for file in sorted(folder.rglob("*.csv"))
    }


def lab_summary(path) -> dict:
    """summary.json of a lab: what was asked, machine, verdict."""
    return _summary(path)[1]


def norm(table: pandas.DataFrame, vector: str, unit: str = "n") -> pandas.Series:
    """The length of a vector in each row: norm(run.users[0], "operator_force") of the columns operator_force_x_n ..."""
    columns = [f"{vector}_{axis}_{unit}" for axis in "xyz"]
    missing = [column for column in columns if column not in table]
    if missing:
        raise ResultsError(f"there is no column {missing[0]}; there are: {', '.join(table.columns) or 'none'}")
    return (table[columns] ** 2).sum(axis=1, skipna=False) ** 0.5


def _summary(path):
    path = Path(path)
    if not path.exists():
        raise ResultsError(f"{path}: no such folder; name the folder that a run, a session or a lab wrote to")
    folder = path if path.is_dir() else path.parent
    file = folder / "summary.json"
    if not file.exists():
        parts = any(folder.glob("*_[0-9]*.csv")) or (folder / "world.csv").exists() or (folder / "hosts").exists()
        cure = "`subworld collect` makes one" if parts else "no run and no lab has ended here"
        raise ResultsError(f"{folder}: has no summary.json; {cure}")
    try:
        summary = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as wrong:
        raise ResultsError(f"{file}: {wrong}") from wrong
    if not isinstance(summary, dict):
        raise ResultsError(f"{file}: is no summary of a run or a lab")
    return folder, summary


def _by_user(folder: Path, kind: str) -> dict:
    files = {}
    for file in folder.glob(f"{kind}_*.csv"):
        number = re.fullmatch(rf"{kind}_(\d+)\.csv", file.name)
        if number:
            files[int(number[1])] = file
    return {user: _history(files[user]) for user in sorted(files)}


def _history(file: Path) -> pandas.DataFrame:
    table = _table(file) if file.exists() else pandas.DataFrame()
    return table.set_index("time_s") if "time_s" in table else table


def _table(file: Path) -> pandas.DataFrame:
    """A killed program may leave a last row that is not whole: it is not read."""
    data = file.read_bytes()
    data = data[: data.rfind(b"\n") + 1]
    if not data:
        return pandas.DataFrame()
    try:
        return pandas.read_csv(io.BytesIO(data))
    except ValueError as wrong:
        raise ResultsError(f"{file}: {wrong}") from wrong
