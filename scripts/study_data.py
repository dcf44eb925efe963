"""Reads the output directory of `brash_ice study`: what was run, and the results of each run."""

import base64
import csv
import os
import re
import xml.etree.ElementTree
from dataclasses import dataclass, field

import numpy as np
import yaml

FIGURE_KINDS = ("hardening", "force", "bars", "snapshots", "plug")
FINDINGS = ("paper",)
# Columns of results.csv that every study has; all others are optional.
RESULT_COLUMNS = ("case", "seed", "status", "peak_force_n", "peak_time_s", "residual_force_n")
FORCE_WORDS = ("stage",)  # columns of force.csv that are no numbers
FRAME_FIELDS = ("plastic_strain", "damage")


class BadInput(Exception):
    """The directory does not hold what a study writes; the text names the file, the entry and the rule."""


class Missing(Exception):
    """A figure that this study does not hold; the text says what is missing."""


@dataclass
class Case:
    """One case of the study."""

    name: str
    title: str = ""
    settings: dict = field(default_factory=dict)


@dataclass
class Frame:
    """The particles at one instant: position_m (n, 3), plastic_strain (n) and damage (n), without units both."""

    time_s: float
    position_m: np.ndarray
    plastic_strain: np.ndarray
    damage: np.ndarray


class Run:
    """One case with one seed: its row of results.csv, and the files of its directory, each read when asked for."""

    def __init__(self, case, seed, row, directory):
        self.case = case
        self.seed = seed
        self.row = row
        self.status = row["status"]
        self.directory = directory
        self._read = {}

    @property
    def failed(self):
        return self.status.startswith("failed")

    def result(self, column):
        """A number of results.csv. Raises Missing where it is not there."""
        text = self.row.get(column) or ""
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise Missing(f"{self.name} has no {column}")
        return value

    @property
    def name(self):
        return f"{self.case}, seed {self.seed}"

    def scenario(self):
        """The effective scenario as nested dicts; empty where the run left none."""
        return self._once("scenario.yaml", lambda path: read_yaml(path) if os.path.exists(path) else {})

    def scenario_value(self, key):
        """A scenario value by its dotted key. Raises Missing where the scenario does not hold it."""
        value = self.scenario()
        for part in key.split("."):
            if not isinstance(value, dict) or part not in value:
                raise Missing(f"{self.name} has no {key} in scenario.yaml")
            value = value[part]
        return value

    def scenario_number(self, key):
        value = self.scenario_value(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise Missing(f"{self.name}: {key} = {value} in scenario.yaml is no number")
        return float(value)

    def version(self):
        """Version of the program that ran it: toYaml() writes it into the first line of scenario.yaml."""
        path = os.path.join(self.directory, "scenario.yaml")
        try:
            with open(path, encoding="utf-8") as stream:
                match = re.match(r"# .*\bbrash_ice_rig ([0-9][0-9A-Za-z.+-]*?):?\s", stream.readline())
        except OSError:
            return ""
        return match.group(1) if match else ""

    def force(self):
        """Columns of force.csv from the end of settling to the end of the test, as arrays."""
        return self._once("force.csv", self._read_force)

    def plug(self):
        """Columns of plug.csv as arrays. Raises Missing where the run wrote none."""
        if not os.path.exists(os.path.join(self.directory, "plug.csv")):
            raise Missing(f"{self.name} has no plug.csv")
        return self._once("plug.csv", lambda path: read_table(path, ["time_s"]))

    def lift_start(self):
        """Time at which the lift begins, s: 0 where the collector starts under the ice."""
        force = self.force()
        lifting = np.flatnonzero(force["stage"] == "lift")
        if lifting.size == 0:
            raise Missing(f"{self.name} has no stage lift")
        return float(force["time_s"][lifting[0]])

    def frame_times(self):
        """(time_s, path) of each snapshot in vtk/run.pvd; empty where the run wrote none."""
        return self._once(os.path.join("vtk", "run.pvd"), self._read_collection)

    def frame(self, time_s):
        """The snapshot nearest to a time. Raises Missing where the run wrote none."""
        frames = self.frame_times()
        if not frames:
            raise Missing(f"{self.name} wrote no snapshots (output.vtk_interval_s is 0)")
        found_s, path = min(frames, key=lambda frame: abs(frame[0] - time_s))
        return read_frame(path, found_s)

    def _once(self, name, read):
        if name not in self._read:
            self._read[name] = read(os.path.join(self.directory, name))
        return self._read[name]

    def _read_force(self, path):
        columns = read_table(path, ["time_s", "force_n", "hoist_position_m", "fold_ratio", "stage"], FORCE_WORDS)
        kept = (columns["stage"] != "settle") & (columns["stage"] != "done")
        if not kept.any():
            raise BadInput(f"{path}: no sample after settling")
        return {name: values[kept] for name, values in columns.items()}

    @staticmethod
    def _read_collection(path):
        if not os.path.exists(path):
            return []
        frames = []
        for data_set in read_xml(path).iter("DataSet"):
            if data_set.get("name") == "ice":
                frames.append((float(data_set.get("timestep")), os.path.join(os.path.dirname(path),
                                                                             data_set.get("file"))))
        return frames


class Study:
    """A study's directory."""

    def __init__(self, directory):
        self.directory = directory
        self.path = os.path.join(directory, "study.yaml")
        content = read_yaml(self.path)
        if not isinstance(content, dict):
            raise BadInput(f"{self.path}: must be a map")
        self.title = str(content.get("title") or os.path.basename(os.path.abspath(directory)))
        self.scenario = str(content.get("scenario") or "")
        self.cases = self._read_cases(content.get("cases"))
        self.findings = content.get("findings")
        if self.findings is not None and self.findings not in FINDINGS:
            raise BadInput(f"{self.path}: findings = {self.findings}, must be {' or '.join(FINDINGS)}")
        self.runs, self.changed_keys = self._read_results(os.path.join(directory, "results.csv"))
        self.seeds = list(dict.fromkeys(run.seed for run in self.runs))
        self.figures = self._read_figures(content.get("figures"))

    def case(self, name):
        return next(case for case in self.cases if case.name == name)

    def runs_of(self, name):
        """The runs of a case that did not fail, by seed."""
        return [run for run in self.runs if run.case == name and not run.failed]

    def failed_runs(self):
        return [run for run in self.runs if run.failed]

    def versions(self):
        return sorted({run.version() for run in self.runs} - {""})

    def _read_cases(self, content):
        if not isinstance(content, list) or not content:
            raise BadInput(f"{self.path}: cases must be a list with at least one case")
        cases = []
        for entry in content:
            if not isinstance(entry, dict) or not str(entry.get("name") or ""):
                raise BadInput(f"{self.path}: cases: each needs a name, and {entry} has none")
            name = str(entry["name"])
            if "/" in name or name in (".", "..") or name in (case.name for case in cases):
                raise BadInput(f"{self.path}: cases: name = {name}, must be a directory name of its own")
            settings = entry.get("settings") or {}
            if not isinstance(settings, dict):
                raise BadInput(f"{self.path}: cases: settings of {name} must be a map")
            # Titles often begin with the name, which stands before them wherever they are shown.
            title = str(entry.get("title") or "")
            cases.append(Case(name, title[len(name) + 1:].strip() if title.startswith(f"{name}:") else title, settings))
        return cases

    def _read_results(self, path):
        try:
            with open(path, newline="", encoding="utf-8") as stream:
                reader = csv.DictReader(stream)
                names = reader.fieldnames or []
                rows = list(reader)
        except OSError as error:
            raise BadInput(f"{path}: {error.strerror}") from error
        missing = [name for name in RESULT_COLUMNS if name not in names]
        if missing:
            raise BadInput(f"{path}: no column {', '.join(missing)}")
        if not rows:
            raise BadInput(f"{path}: no run")
        known = [case.name for case in self.cases]
        runs = []
        for row in rows:
            if row["case"] not in known:
                raise BadInput(f"{path}: case = {row['case']}, must be one of study.yaml: {', '.join(known)}")
            if not re.fullmatch(r"[0-9]+", row["seed"] or "") or not row["status"]:
                raise BadInput(f"{path}: {row['case']}: seed = {row['seed']}, status = {row['status']}, "
                               "must be a whole number and a text")
            directory = os.path.join(self.directory, "runs", row["case"], f"seed_{row['seed']}")
            runs.append(Run(row["case"], int(row["seed"]), row, directory))
        # Scenario keys are the columns with a dot; figures have none.
        return runs, [name for name in names if "." in name]

    def _read_figures(self, content):
        if content is None:
            content = [{"kind": "force"}, {"kind": "bars"}]
        if not isinstance(content, list):
            raise BadInput(f"{self.path}: figures must be a list")
        figures = []
        for number, entry in enumerate(content, 1):
            where = f"{self.path}: figure {number}"
            if not isinstance(entry, dict) or entry.get("kind") not in FIGURE_KINDS:
                kind = entry.get("kind") if isinstance(entry, dict) else entry
                raise BadInput(f"{where}: kind = {kind}, must be one of {', '.join(FIGURE_KINDS)}")
            figure = {"kind": entry["kind"], "title": str(entry.get("title") or "")}
            names = [case.name for case in self.cases]
            if entry["kind"] == "snapshots":
                figure["case"] = str(entry.get("case", names[0]))
                asked = [figure["case"]]
                figure["times_s"] = entry.get("times_s")
                if (not isinstance(figure["times_s"], list) or not figure["times_s"] or
                        not all(isinstance(time, (int, float)) for time in figure["times_s"])):
                    raise BadInput(f"{where}: times_s = {figure['times_s']}, must be a list of numbers")
            else:
                asked = figure["cases"] = [str(name) for name in entry.get("cases") or names]
            unknown = [name for name in asked if name not in names]
            if unknown:
                raise BadInput(f"{where}: case = {unknown[0]}, must be one of {', '.join(names)}")
            figures.append(figure)
        return figures


def read_yaml(path):
    try:
        with open(path, encoding="utf-8") as stream:
            return yaml.safe_load(stream)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}") from error
    except (ValueError, yaml.YAMLError) as error:
        raise BadInput(f"{path}: {error}") from error


def read_xml(path):
    try:
        return xml.etree.ElementTree.parse(path).getroot()
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}") from error
    except xml.etree.ElementTree.ParseError as error:
        raise BadInput(f"{path}: {error}") from error


def read_table(path, wanted, words=()):
    """The columns of a CSV file as arrays: numbers, except those named in words."""
    try:
        with open(path, newline="", encoding="utf-8") as stream:
            reader = csv.reader(stream)
            names = next(reader, [])
            rows = [row for row in reader if row]
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}") from error
    missing = [name for name in wanted if name not in names]
    if missing:
        raise BadInput(f"{path}: no column {', '.join(missing)}")
    # The last line of a run that was stopped may be cut off.
    if rows and len(rows[-1]) < len(names):
        rows.pop()
    if not rows or any(len(row) != len(names) for row in rows):
        raise BadInput(f"{path}: must have rows of {len(names)} columns")
    columns = {}
    for name, texts in zip(names, zip(*rows)):
        try:
            columns[name] = np.array(texts, dtype=str if name in words else float)
        except ValueError as error:
            raise BadInput(f"{path}: column {name}: {error}") from error
    return columns


def read_frame(path, time_s):
    """A snapshot as src/output/vtk_writer.cpp writes it: each array in base64, led by its length in 8 bytes."""
    root = read_xml(path)
    if root.get("header_type") != "UInt64":
        raise BadInput(f"{path}: header_type = {root.get('header_type')}, must be UInt64")
    order = "<" if root.get("byte_order") == "LittleEndian" else ">"
    arrays = {}
    for data in root.iter("DataArray"):
        if data.get("type") == "Float32":
            raw = base64.b64decode(data.text or "")
            arrays[data.get("Name")] = np.frombuffer(raw, dtype=order + "f4", offset=8).astype(float)
    missing = [name for name in ("position_m", *FRAME_FIELDS) if name not in arrays]
    if missing:
        raise BadInput(f"{path}: no array {', '.join(missing)}")
    return Frame(time_s, arrays["position_m"].reshape(-1, 3), arrays["plastic_strain"], arrays["damage"])


def moving_mean(time_s, values, window_s=1.0):
    """Centred mean over a window: (times, means), both shorter by the window."""
    if time_s.size < 2:
        raise Missing("fewer than two samples")
    period_s = (time_s[-1] - time_s[0]) / (time_s.size - 1)
    half = int(round(0.5 * window_s / period_s))
    if time_s.size < 2 * half + 1:
        raise Missing(f"the run is shorter than {window_s:g} s")
    kernel = np.full(2 * half + 1, 1.0 / (2 * half + 1))
    return time_s[half:time_s.size - half], np.convolve(values, kernel, mode="valid")
