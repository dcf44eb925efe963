"""A study and an identification small enough for a test, how they are started on hosts, and what they leave."""

import glob
import json
import os
import re
import signal
import subprocess
import time

PROGRAM = os.environ.get("BRASH_ICE_PROGRAM", "brash_ice")
RUNS = 6

SCENARIO = """title: Small field
field: {length_x_m: 3.0, length_y_m: 3.0, thickness_m: 0.6, jitter_ratio: 0.1}
collector: {radius_m: 0.6}
procedure: {settle_duration_s: 1.0, lift_speed_mps: 0.01, lift_duration_s: %s}
solver: {threads: 1, active_set: false}
"""
RIG = """title: Small rig
field: {length_x_m: 3.6, length_y_m: 3.6, thickness_m: 0.6, jitter_ratio: 0.1, seed: 99}
collector: {radius_m: 0.9, rim_height_m: 0.2, displaced_volume_m3: 0.001, pole_radius_m: 0.02}
procedure: {settle_duration_s: 2.0, lift_speed_mps: 0.15, lift_duration_s: %s, hold_duration_s: 0}
solver: {threads: 1, active_set: false}
"""
STUDY = """title: Small study
scenario: small.yaml
seeds: [1, 2, 3]
grid: {ice.cohesion_pa: [100, 200]}
"""


def write(path, text):
    with open(path, "w", encoding="utf-8") as stream:
        stream.write(text)


def read(path):
    with open(path, encoding="utf-8") as stream:
        return stream.read()


def prepare(directory, lift_s=60, study=STUDY):
    write(os.path.join(directory, "small.yaml"), SCENARIO % lift_s)
    write(os.path.join(directory, "study.yaml"), study)


def study_command(out, *options):
    return [PROGRAM, "study", "study.yaml", "--out", out, "--no-report", *options]


def prepare_record(directory, lift_s=3):
    """A record of a run of our own, record.csv."""
    write(os.path.join(directory, "rig.yaml"), RIG % lift_s)
    run_alone(directory, [PROGRAM, "run", "rig.yaml", "--record", "record", "--out", "rig"])


def identify_command(out, *options):
    return [PROGRAM, "identify", "record.csv", "--out", out, "--no-report", *options]


def findings(out):
    """All that an identification finds; not how many runs this process made in which time."""
    report = json.loads(read(os.path.join(out, "report.json")))
    del report["runs"]["made"], report["runs"]["wall_s"]
    return report, read(os.path.join(out, "overlay.yaml"))


def run_alone(directory, command):
    run = subprocess.run(command, cwd=directory, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    if run.returncode != 0:
        raise AssertionError(run.stdout)
    return run.stdout


def made(text):
    """Runs that were made, by the lines that tell of them."""
    return len(re.findall(r" done in \d", text))


def results(out):
    """What must not depend on where it was made: the table, and every run's series and hash."""
    files = {"results.csv": read(os.path.join(out, "results.csv"))}
    for path in sorted(glob.glob(os.path.join(out, "runs", "*", "*", "*.csv"))):
        files[os.path.relpath(path, out)] = read(path)
    return files


def at_work(out, host=None):
    """Directories of runs with a claim by a host that has not been given back."""
    found = []
    for path in glob.glob(os.path.join(out, "runs", "**", "claim.*"), recursive=True):
        try:
            if host is None or read(path).startswith(host.name + ","):
                found.append(os.path.dirname(path))
        except FileNotFoundError:
            pass
    return found


def wait_until(condition, timeout_s=300.0):
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            raise AssertionError("waited in vain")
        time.sleep(0.01)


def stop_in_a_run(host, out):
    """Stops all processes of a host (SIGSTOP) while one of its runs is under way. Returns that run's directory."""
    end = time.monotonic() + 300.0
    while time.monotonic() < end:
        wait_until(lambda: at_work(out, host))
        host.send(signal.SIGSTOP)
        for run in at_work(out, host):
            if os.path.exists(os.path.join(run, "force.csv")) and not os.path.exists(os.path.join(run, "summary.json")):
                return run
        host.send(signal.SIGCONT)
        time.sleep(0.02)
    raise AssertionError("the host never has a run under way")
