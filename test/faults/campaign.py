"""What the cases of the fault campaign share: programs that are started and ended, places to work in, what is promised.

A case is a function with the decorator @case. It returns an Outcome, raises Broken where a promise does not hold, and
NotTried where this machine cannot stage the fault. Only processes that a case has started are ever ended.
"""

import atexit
import dataclasses
import json
import os
import random
import re
import shutil
import signal
import subprocess
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SMALL = os.path.join(ROOT, "test", "ros", "small.yaml")


class Broken(Exception):
    """A promise that did not hold."""


class NotTried(Exception):
    """The fault cannot be staged here; says why."""


@dataclasses.dataclass
class Outcome:
    tried: int  # how often the fault was staged
    happened: str
    lost: str = "nothing"


@dataclasses.dataclass
class Case:
    name: str
    attack: str
    function: callable
    quick: bool  # part of the quick subset


CASES = []


def case(attack, quick=False):
    """Registers a function `case_NAME(context)`."""
    def register(function):
        CASES.append(Case(function.__name__.removeprefix("case_"), attack, function, quick))
        return function
    return register


def require(fulfilled, text):
    if not fulfilled:
        raise Broken(text)


def read_bytes(path):
    with open(path, "rb") as stream:
        return stream.read()


def read_text(path):
    return read_bytes(path).decode("utf-8", "replace")


def write_text(path, text):
    with open(path, "w", encoding="utf-8") as stream:
        stream.write(text)


_running = []


@atexit.register
def end_all():
    for process in list(_running):
        process.kill()


class Process:
    """A program in a process group of its own, with its output in a file."""

    def __init__(self, command, log, **options):
        self.log_path = log
        self.command = [str(part) for part in command]
        with open(log, "wb") as stream:
            self.popen = subprocess.Popen(self.command, stdin=subprocess.DEVNULL, stdout=stream,
                                          stderr=subprocess.STDOUT, start_new_session=True, **options)
        _running.append(self)

    @property
    def pid(self):
        return self.popen.pid

    def log(self):
        return read_text(self.log_path)

    def alive(self):
        return self.popen.poll() is None

    def send(self, number):
        if self.alive():
            os.kill(self.pid, number)

    def kill9(self):
        """kill -9 of the program alone; its children are on their own. @return whether it still ran"""
        was_alive = self.alive()
        self.send(signal.SIGKILL)
        self.popen.wait()
        return was_alive

    def kill(self):
        """Ends the whole group, at the end of a case."""
        try:
            os.killpg(self.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        self.popen.wait()
        if self in _running:
            _running.remove(self)

    def wait(self, timeout_s=120.0):
        """@return the exit code, < 0 for a signal"""
        try:
            return self.popen.wait(timeout_s)
        except subprocess.TimeoutExpired:
            tail = self.log()[-600:]
            self.kill()
            raise Broken(f"{' '.join(self.command[:3])} did not end within {timeout_s:g} s: {tail}") from None

    def children(self):
        """Process ids of its direct children."""
        found = []
        for name in os.listdir("/proc"):
            if not name.isdigit():
                continue
            try:
                stat = read_text(f"/proc/{name}/stat")
            except OSError:
                continue
            if int(stat.rsplit(")", 1)[1].split()[1]) == self.pid:
                found.append(int(name))
        return found

    def resident_bytes(self):
        return int(re.search(r"VmRSS:\s+(\d+) kB", read_text(f"/proc/{self.pid}/status")).group(1)) * 1024


class Context:
    """What one case works with."""

    def __init__(self, name, quick, seed, programs, scratch=None):
        self.quick = quick
        self.random = random.Random(f"{seed} {name}")
        self.programs = programs
        self.directory = tempfile.mkdtemp(prefix=f"brash_ice_faults_{name}_", dir=scratch)
        self._mounts = []
        self._processes = []

    def close(self):
        for process in self._processes:
            process.kill()
        for path in reversed(self._mounts):
            subprocess.run(["umount", path], check=False)
        shutil.rmtree(self.directory, ignore_errors=True)

    def path(self, *parts):
        return os.path.join(self.directory, *parts)

    def many(self, full, quick):
        return quick if self.quick else full

    @property
    def brash_ice(self):
        return os.path.join(self.programs, "brash_ice")

    @property
    def rig_node(self):
        program = os.path.join(self.programs, "rig_node")
        if not os.path.exists(program):
            raise NotTried("built without ROS")
        return program

    def environment(self, **changes):
        # Waiting threads sleep already: otherwise the program would start itself anew.
        return {**os.environ, "OMP_WAIT_POLICY": "passive", **changes}

    def start(self, command, log="log.txt", **options):
        options.setdefault("env", self.environment())
        process = Process(command, self.path(log), **options)
        self._processes.append(process)
        return process

    def run(self, command, timeout_s=120.0, **options):
        """@return exit code and all that was printed"""
        process = self.start(command, "command_log.txt", **options)
        code = process.wait(timeout_s)
        return code, process.log()

    def mount_tmpfs(self, name, size_bytes):
        path = self.path(name)
        os.makedirs(path, exist_ok=True)
        self._mount(["mount", "-t", "tmpfs", "-o", f"size={size_bytes}", "brash_ice_faults", path], path)
        return path

    def mount_read_only(self, directory):
        self._mount(["mount", "--bind", directory, directory], directory)
        if subprocess.run(["mount", "-o", "remount,bind,ro", directory], check=False).returncode != 0:
            raise NotTried("cannot mount read-only here")

    def _mount(self, command, path):
        outcome = subprocess.run(command, check=False, capture_output=True, text=True)
        if outcome.returncode != 0:
            raise NotTried("needs root and mount: " + outcome.stderr.strip())
        self._mounts.append(path)

    def unmount(self, path):
        subprocess.run(["umount", path], check=True)
        self._mounts.remove(path)


def wait_until(condition, timeout_s=20.0, interval_s=0.02):
    """@return whether the condition came to hold in time"""
    end = time.monotonic() + timeout_s
    while True:
        if condition():
            return True
        if time.monotonic() > end:
            return False
        time.sleep(interval_s)


def summary(directory):
    return json.loads(read_text(os.path.join(directory, "summary.json")))


def same_run(left, right):
    """Whether two directories hold the same run to the last bit."""
    for name in ("force.csv", "plug.csv"):
        if read_bytes(os.path.join(left, name)) != read_bytes(os.path.join(right, name)):
            return f"{name} differs"
    one, other = summary(left), summary(right)
    for key in ("state_hash", "status", "peak_force_n", "residual_force_n", "step_count"):
        if one[key] != other[key]:
            return f"{key} of summary.json differs"
    return ""


def last_time(directory):
    """Time of the last whole row of force.csv, s; None without one."""
    try:
        text = read_text(os.path.join(directory, "force.csv"))
    except FileNotFoundError:
        return None
    rows = text[:text.rfind("\n") + 1].splitlines()[1:]
    return float(rows[-1].split(",", 1)[0]) if rows else None


def print_table(rows):
    """| attack | how often tried | what happened | what was lost | command that repeats it |"""
    print("| attack | tried | what happened | lost | command |\n|---|---|---|---|---|")
    for row in rows:
        happened = " ".join(row["happened"].split()).replace("|", "/")
        print(f"| {row['attack']} | {row['tried']} | {happened} | {row['lost']} | `{row['command']}` |")
