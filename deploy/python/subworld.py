"""Runs, sweeps and scenes of Subworld from Python. deploy/python/README.md has examples.

This module starts the command `subworld` and reads what it writes: it has no simulation of its own.
"""

import hashlib
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import pandas

import subworld_results


class SubworldError(RuntimeError):
    """A command that failed: its last words, and its exit code in `code`."""

    def __init__(self, text: str, code: int = 1):
        super().__init__(text)
        self.code = code


def command() -> str:
    """The command `subworld`: $SUBWORLD, else that of this build or installation, else that of PATH."""
    here = Path(__file__).resolve().parent
    for candidate in (os.environ.get("SUBWORLD"), here.parent / "subworld", here.parents[2] / "bin/subworld"):
        if candidate and Path(candidate).is_file():
            return str(candidate)
    found = shutil.which("subworld")
    if not found:
        raise SubworldError("the command subworld is not found: install it, or set SUBWORLD to its path")
    return found


def words(scene, out, set=None, **flags) -> list:
    """The words of `subworld run`. `flags`: box_half_m=0.3 is --box-half-m 0.3, gui=True is --gui; a list has commas."""
    all_words = ["run", str(scene), "--out", str(out)]
    for name, value in flags.items():
        if value is None or value is False:
            continue
        all_words.append("--" + name.replace("_", "-"))
        if value is not True:
            all_words.append(",".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value))
    for key, value in (set or {}).items():
        all_words += set_words(key, value)
    return all_words


def set_words(key: str, value) -> list:
    return ["--set", f"{key}={json.dumps(value) if isinstance(value, (bool, list, dict)) else value}"]


@dataclass
class Result:
    """A run that has ended: `summary` is summary.json, `code` the exit code."""

    folder: Path
    code: int
    summary: dict = field(repr=False)

    @property
    def verdict(self) -> str:
        return self.summary.get("verdict", "")

    @property
    def ok(self) -> bool:
        return self.verdict.startswith("ok")

    @cached_property
    def tables(self) -> subworld_results.Run:
        """Histories as data frames: tables.world, tables.users[0], tables.devices[0], tables.bodies."""
        return subworld_results.load(self.folder)


class Run:
    """A run in progress, as `start` returns it. As a context manager it stops at the end of the block."""

    def __init__(self, folder: Path, arguments: list, meeting: list):
        self.folder = folder
        self._meeting = meeting  # flags by which `subworld control` meets the run
        self._log = tempfile.TemporaryFile(mode="w+")
        self._process = subprocess.Popen([command(), *arguments], stdout=self._log, stderr=subprocess.STDOUT)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()
        self._process.wait()

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    @property
    def log(self) -> str:
        self._log.seek(0)
        return self._log.read()

    def domain(self, timeout_s: float = 20.0) -> int:
        """That of DDS, once the run says it."""
        limit = time.monotonic() + timeout_s
        while not (domain := re.search(r"domain (\d+), results in", self.log)):
            if not self.running or time.monotonic() > limit:
                raise SubworldError(f"the run does not say its domain: {self._fault()}")
            time.sleep(0.01)
        if not self.running:
            raise SubworldError("the run is over")
        return int(domain[1])

    def control(self, *order, timeout_s: float = 20.0) -> str:
        """An order, as in control("pause") or control("engine", "ode", "--haptic"). Returns the answers."""
        done = subprocess.run(
            [command(), "control", *map(str, order), "--domain", str(self.domain(timeout_s)), "--wait", str(timeout_s), *self._meeting],
            capture_output=True, text=True, check=False,
        )
        if done.returncode != 0:
            raise SubworldError(done.stderr.strip(), done.returncode)
        return done.stdout

    def forces(self, user: int = 0):
        """A reader of the forces on a user's operator, live: `take()` returns those since its last call (subworld_core)."""
        import subworld_core  # pylint: disable=import-outside-toplevel

        return subworld_core.Forces(self.domain(), user, **dict(zip((word[2:] for word in self._meeting[::2]), self._meeting[1::2])))

    def _fault(self) -> str:
        errors = [line for line in self.log.splitlines() if "error" in line]
        return "\n".join(errors[-3:]) or self.log[-400:]

    def stop(self):
        """Ends the run in order; its results are kept."""
        if self.running:
            self._process.terminate()

    def wait(self, timeout_s: float = None) -> Result:
        """The result. Raises SubworldError where there is none, also of a run that goes on after `timeout_s`."""
        try:
            code = self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise SubworldError(f"the run has not ended within {timeout_s} s") from None
        file = self.folder / "summary.json"
        if code not in (0, 4) or not file.exists():
            raise SubworldError(self._fault() or f"ended with {code}, without results", code)
        return Result(self.folder, code, json.loads(file.read_text(encoding="utf-8")))


def start(scene, out=None, **settings) -> Run:
    """Starts a run; `settings` as for `run`."""
    folder = Path(out) if out else Path(tempfile.mkdtemp(prefix="subworld_"))
    meeting = [word for name in ("dds", "secure") if name in settings for word in (f"--{name}", str(settings[name]))]
    return Run(folder, words(scene, folder, **settings), meeting)


def run(scene, out=None, timeout_s: float = None, **settings) -> Result:
    """Runs a scene, a file or the name of a scene of Subworld, and returns the result.

    `out`: folder of the results; default: a new temporary one. `timeout_s`: after which the run is stopped, and
    SubworldError raised; default: never. `settings`: the flags of `subworld run` by their names
    (mode="lockstep", duration=0.5, scheme="paper"), and set={KEY: VALUE} for any setting of the scene file.
    """
    with start(scene, out, **settings) as started:
        return started.wait(timeout_s)


def row_of(result: Result) -> dict:
    """The main figures of a run: verdict, state hash, and those of each user."""
    row = {"verdict": result.verdict, "state_hash": result.summary.get("state_hash", "")}
    for user in result.summary.get("haptic", []):
        for name in ("force_rms_n", "force_max_n", "missed_by_run"):
            row[f"user_{user['user']}_{name}"] = user.get(name)
    return row


def sweep(scene, axes: dict, out, repeats: int = 1, jobs: int = 1, measure=row_of, **settings) -> pandas.DataFrame:
    """Runs every combination of `axes`, {KEY of a setting: values}, and returns a row for each run.

    `out` keeps a folder for each run, named by what was asked. What it has already is not run again, also of another
    sweep: add values, and only those are run. `jobs` runs at once: leave 1 for real time.
    `measure`: the columns of a row, from a Result.
    """
    base = settings.pop("set", None) or {}
    for key, values in axes.items():
        if isinstance(values, str) or not hasattr(values, "__iter__"):
            raise ValueError(f"axes: {key}: must be a list of values, not {values!r}")
    cells = [dict(zip(axes, values)) for values in itertools.product(*axes.values())]
    cells = [(cell, repeat) for cell in cells for repeat in range(repeats)]

    def one(position):
        cell, repeat = cells[position]
        asked = json.dumps([str(scene), base, cell, repeat, settings], sort_keys=True, default=str)
        folder = Path(out) / hashlib.sha256(asked.encode()).hexdigest()[:12]
        note = folder.with_suffix(".json")
        if not note.exists():
            shutil.rmtree(folder, ignore_errors=True)
            try:
                result = run(scene, folder, set={**base, **cell}, **settings)
            except SubworldError as wrong:
                raise SubworldError(f"{cell}: {wrong}", wrong.code) from wrong
            if result.verdict.startswith("stopped"):
                raise SubworldError(f"{cell}: {result.verdict}; call the sweep again, and it goes on")
            note.write_text(asked, encoding="utf-8")  # only now: a run that was interrupted is run again
        try:
            summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        except (OSError, ValueError) as wrong:
            raise SubworldError(f"{folder}/summary.json: {wrong}; remove {note}, and the run is made again") from wrong
        print(f"[{position + 1}/{len(cells)}] {cell}: {summary.get('verdict', '')[:80]}", file=sys.stderr)
        return {**cell, "repeat": repeat, "folder": str(folder), **measure(Result(folder, 0, summary))}

    if not cells:
        raise ValueError("a sweep needs values for each axis, and repeats of at least 1")
    Path(out).mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(jobs) as pool:
        return pandas.DataFrame(list(pool.map(one, range(len(cells)))))


class Scene:
    """Builds a scene file, with the keys of deploy/scenes/README.md. Methods return the scene, to be chained."""

    def __init__(self, name: str, description: str = "", **settings):
        self._data = {"name": name, "description": description or name, "settings": settings}

    def _add(self, part: str, item: dict):
        self._data.setdefault(part, []).append(item)
        return self

    def material(self, name: str, friction: float, restitution: float = 0.0):
        self._data.setdefault("materials", {})[name] = {"friction": friction, "restitution": restitution}
        return self

    def body(self, name: str, shape: str, **keys):
        return self._add("bodies", {"name": name, "shape": shape, **keys})

    def plane(self, name: str = "floor", **keys):
        return self.body(name, "plane", fixed=True, **keys)

    def box(self, name: str, size_m, mass_kg: float, position_m, **keys):
        return self.body(name, "box", size_m=list(size_m), mass_kg=mass_kg, position_m=list(position_m), **keys)

    def sphere(self, name: str, radius_m: float, mass_kg: float, position_m, **keys):
        return self.body(name, "sphere", radius_m=radius_m, mass_kg=mass_kg, position_m=list(position_m), **keys)

    def joint(self, name: str, type: str, bodies, **keys):
        return self._add("joints", {"name": name, "type": type, "bodies": list(bodies), **keys})

    def user(self, name: str, proxy: dict, **keys):
        return self._add("users", {"name": name, "proxy": proxy, **keys})

    def write(self, path) -> Path:
        """Writes the file; JSON is YAML too."""
        Path(path).write_text(json.dumps(self._data, indent=1, default=lambda one: one.tolist()) + "\n", encoding="utf-8")
        return Path(path)
