#!/usr/bin/python3
"""Attacks bag_to_record with bags whose bytes or messages are wrong. Whatever they hold, the outcome is a record or one
line that says why not. PYTHONPATH must lead to the package's messages; scripts/fuzz calls this.

Repeats a finding: bag_fuzz.py FILE."""

import argparse
import contextlib
import copy
import csv
import importlib.machinery
import importlib.util
import io
import os
import random
import resource
import signal
import sys
import tempfile
import time

import rosbag
import rospy
from brash_ice_rig.msg import ForceComponents, TakenCommand
from std_msgs.msg import String

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "test", "identify"))
sys.dont_write_bytecode = True

import bag_to_record_test  # pylint: disable=wrong-import-position

LONGEST_S = 20
MOST_MEMORY = 2 << 30
ODD_NUMBERS = [0.0, -1.0, 1e-300, 1e300, float("inf"), float("-inf"), float("nan")]
ODD_BYTES = [b"\0", b"\xff", b"\n", b"=", b"\0\0\0\x80", b"\xff\xff\xff\x7f", b"\xff\xff\xff\xff", b"uint8[] ", b"bz2"]


def load_script():
    path = os.path.join(ROOT, "scripts", "bag_to_record")
    loader = importlib.machinery.SourceFileLoader("bag_to_record", path)
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


def write_base(path):
    """A run of 2 s with all that bag_to_record looks at."""
    with rosbag.Bag(path, "w", chunk_threshold=4096) as bag:
        start = rospy.Time.from_sec(bag_to_record_test.START_S - 1.0)
        bag.write("/rig/sim/scenario",
                  String("title: Bag\nprocedure:\n  settle_duration_s: 1.0\n  motion_file: \"lift.csv\"\n"), start)
        bag.write("/rig/sim/motion_file", String("time_s,hoist_position_m\n0,-1.4\n2,-1.2\n"), start)
        for index, time_s in enumerate([-1.0, 0.0, 0.5]):
            stamp = rospy.Time.from_sec(bag_to_record_test.START_S + time_s)
            components = ForceComponents(time_s=time_s, weight_n=2354.4, buoyancy_n=302.5, tension_n=2000.0)
            components.header.stamp = stamp
            bag.write("/rig/ground_truth/force_components", components, stamp)
            command = TakenCommand(index=index, time_s=time_s, tare=index == 2)
            command.header.stamp = stamp
            bag.write("/rig/sim/commands", command, stamp)
        bag_to_record_test.write_run(bag, -1.0, 1.0)


class BadBytes:
    """Changes the file."""

    def __init__(self, base):
        with open(base, "rb") as stream:
            self.base = stream.read()

    def write(self, path, rng):
        data = bytearray(self.base)
        for _ in range(rng.choice([1, 1, 2, 4, 16])):
            at = rng.randrange(len(data))
            kind = rng.randrange(6)
            if kind == 0:
                data[at] ^= 1 << rng.randrange(8)
            elif kind == 1:
                odd = rng.choice(ODD_BYTES)
                data[at:at + len(odd)] = odd
            elif kind == 2:
                del data[at:at + rng.choice([1, 4, 100])]
            elif kind == 3:
                data[at:at] = data[at:at + rng.choice([1, 4, 100])]
            elif kind == 4 and rng.random() < 0.2:
                del data[at:]
            elif kind == 5:
                # Lengths of records stand everywhere.
                data[at:at + 4] = rng.choice([0, 1, len(data), rng.getrandbits(32)]).to_bytes(4, "little")
            if not data:
                return
        with open(path, "wb") as stream:
            stream.write(data)


class BadMessages:
    """Changes what the messages say."""

    def __init__(self, base):
        with rosbag.Bag(base) as bag:
            self.base = list(bag.read_messages())

    def write(self, path, rng):
        messages = list(self.base)
        for _ in range(rng.choice([1, 2, 8])):
            at = rng.randrange(len(messages))
            topic, message, stamp = messages[at]
            kind = rng.randrange(5)
            if kind == 0:
                del messages[at:at + rng.choice([1, 10, 100])]
            elif kind == 1:
                messages.insert(rng.randrange(len(messages)), messages[at])
            elif kind == 2:
                messages[at] = (rng.choice(messages)[0], message, stamp)
            else:
                message = copy.deepcopy(message)
                self.change(message, rng)
                messages[at] = (topic, message, stamp)
            if not messages:
                break
        with rosbag.Bag(path, "w") as bag:
            for topic, message, stamp in messages:
                bag.write(topic, message, stamp)

    @staticmethod
    def change(message, rng):
        name = rng.choice(message.__slots__)
        value = getattr(message, name)
        if name == "header":
            seconds = rng.choice([0, 1, 100, 101, 102, 2**32 - 1])
            value.stamp = rospy.Time(seconds, rng.choice([0, 1, 10**9 - 1]))
        elif isinstance(value, str):
            text = list(value)
            for _ in range(rng.choice([1, 2, 8])):
                at = rng.randrange(len(text) + 1)
                text[at:at + rng.choice([0, 1, 5])] = rng.choice(["", ":", "{", "[", "- ", "\n", "\t", "&a ", "*a", "é",
                                                                  "\0", "!!python/name:os.system ", "1e999", "null"])
            setattr(message, name, "".join(text))
        elif isinstance(value, bool):
            setattr(message, name, not value)
        elif isinstance(value, float):
            setattr(message, name, rng.choice(ODD_NUMBERS))
        elif isinstance(value, int):
            setattr(message, name, rng.choice([0, 1, 2, 7]))
        elif hasattr(value, "__slots__"):
            BadMessages.change(value, rng)


def check_record(files):
    """Raises AssertionError if what was written is no record."""
    with open(files[0], newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert rows, "a record has rows"
    times = [float(row["time_s"]) for row in rows]
    assert all(later > earlier for earlier, later in zip(times, times[1:])), "time increases"


def attack(script, path):
    """Raises whatever bag_to_record does not answer for itself."""
    with tempfile.TemporaryDirectory() as out:
        arguments = argparse.Namespace(bag=path, out=os.path.join(out, "record"), ns=None, run=None, source="field",
                                       force=False)
        # rosbag prints warnings.
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            try:
                check_record(script.convert(arguments))
            except (script.BadInput, OSError):
                pass


def too_long(*_):
    raise TimeoutError(f"more than {LONGEST_S} s")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("bag", nargs="?", help="a finding to repeat")
    parser.add_argument("--runs", type=int, help="bags; repeats")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--findings", default=".", help="directory for bags that show a fault")
    arguments = parser.parse_args()
    script = load_script()
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    if arguments.bag:
        attack(script, arguments.bag)
        return
    signal.signal(signal.SIGALRM, too_long)
    seed = 1 if arguments.runs else random.SystemRandom().getrandbits(32)
    rng = random.Random(seed)
    findings = {}
    begin_s = time.monotonic()
    runs = 0
    with tempfile.TemporaryDirectory() as directory:
        base, path = os.path.join(directory, "base.bag"), os.path.join(directory, "bad.bag")
        write_base(base)
        attack(script, base)
        sources = [BadBytes(base), BadMessages(base)]
        while runs < arguments.runs if arguments.runs else time.monotonic() - begin_s < arguments.seconds:
            # Bytes twice as often: they cost half.
            sources[runs % 3 // 2].write(path, rng)
            runs += 1
            signal.alarm(LONGEST_S)
            try:
                attack(script, path)
            except BaseException as error:  # pylint: disable=broad-except
                if isinstance(error, KeyboardInterrupt):
                    raise
                trace, frames = error.__traceback__, []
                while trace is not None:
                    frames.append((os.path.basename(trace.tb_frame.f_code.co_filename), trace.tb_lineno))
                    trace = trace.tb_next
                where = (type(error).__name__, str([f for f in frames if f[0] != "bag_fuzz.py"][:2]))
                if where not in findings:
                    finding = os.path.join(arguments.findings, f"bag-{len(findings)}.bag")
                    with open(path, "rb") as bad, open(finding, "wb") as kept:
                        kept.write(bad.read())
                    findings[where] = finding
                    print(f"bag: {type(error).__name__}: {error} at {frames[-3:]}: {finding}", file=sys.stderr)
            finally:
                signal.alarm(0)
    print(f"bag: {runs} inputs in {time.monotonic() - begin_s:.0f} s (seed {seed}), "
          + (f"{len(findings)} findings" if findings else "no finding"))
    sys.exit(1 if findings else 0)


if __name__ == "__main__":
    main()
