"""Makes the blind records of test/blind and runs `brash_ice identify` on them. Used by validate and demo_identify."""

import glob
import json
import os
import shutil
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
GENERATOR = os.path.join(ROOT, "test", "blind", "make_records.py")
PROGRAM_PLACES = ("devel/lib/brash_ice_rig/brash_ice", "build/brash_ice")
SEALED = "sealed"
REFERENCES = 24  # of each procedure, which lack nothing: from them the tool learns what its simulator is off


class Failure(Exception):
    """Something that has to go through did not; the text says what."""


def find_program(given=""):
    """Path of brash_ice. Raises Failure where it is not built."""
    if given:
        if not os.access(given, os.X_OK):
            raise Failure(f"--program {given}: no such program")
        return os.path.abspath(given)
    for place in PROGRAM_PLACES:
        path = os.path.join(ROOT, place)
        if os.access(path, os.X_OK):
            return path
    found = shutil.which("brash_ice")
    if not found:
        raise Failure("brash_ice is not built: cmake -S . -B build && cmake --build build -j2, or give --program FILE")
    return found


def make_records(directory, *arguments):
    """Has the generator fill a directory, unless it did before. A directory is there whole or not at all."""
    if os.path.exists(os.path.join(directory, SEALED, "index.json")):
        return
    unfinished = directory + ".part"
    shutil.rmtree(unfinished, ignore_errors=True)
    os.makedirs(os.path.dirname(unfinished) or ".", exist_ok=True)
    what, *more = arguments  # the generator's own option, which names the directory last
    done = subprocess.run([sys.executable, "-B", GENERATOR, *what, unfinished, *more], capture_output=True, text=True,
                          check=False, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"})
    if done.returncode != 0:
        raise Failure(f"{GENERATOR}: {last_line(done.stderr)}")
    os.rename(unfinished, directory)


def make_references(directory):
    """Makes records of lifts that lack nothing, with seeds of their own; returns the paths of the copies, by procedure."""
    truth, records = os.path.join(directory, "truth", "references"), os.path.join(directory, "records", "references")
    make_records(truth, ["--nulls", str(REFERENCES)], "--purpose", "tune")
    copy_records(truth, records)
    return {procedure: [os.path.join(records, f"case_{number:04d}_fit.csv") for number in numbers]
            for procedure, numbers in read_sealed(truth, "index").items()}


def copy_records(directory, target):
    """Copies records and manifests, and nothing that is sealed."""
    os.makedirs(target, exist_ok=True)
    for path in sorted(glob.glob(os.path.join(directory, "*.csv")) + glob.glob(os.path.join(directory, "*.yaml"))):
        shutil.copyfile(path, os.path.join(target, os.path.basename(path)))


def read_sealed(directory, name):
    """A sealed file, or None where there is no such record."""
    path = os.path.join(directory, SEALED, f"{name}.json")
    if not os.path.exists(path):
        return None
    with open(path, encoding="utf-8") as stream:
        return json.load(stream)


def identify(program, records, holdout, out, cache, references=()):
    """Runs the program, unless out/report.json is there; returns "" or why there is no report.

    What the program says goes to out.log. holdout may be None. references are lifts that lack nothing.
    """
    report = os.path.join(out, "report.json")
    if os.path.exists(report):
        return ""
    os.makedirs(os.path.dirname(out), exist_ok=True)
    command = [program, "identify", *records, *(["--holdout", holdout] if holdout else []), "--out", out, "--cache",
               cache]
    for reference in references:
        command += ["--reference", reference]
    with open(f"{out}.log", "w", encoding="utf-8") as log:
        code = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                              check=False).returncode
    if code == 0 and os.path.exists(report):
        return ""
    with open(f"{out}.log", encoding="utf-8", errors="replace") as log:
        said = last_line(log.read())
    return f"exit code {code}{': ' + said if said else ''}"


def last_line(text):
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else ""
