#!/usr/bin/python3
"""Long attacks on studies and identifications on a cluster of hosts (environment BRASH_ICE_PROGRAM); needs root.

  faults.py deaths [N]     N studies and N / 4 identifications on two hosts, one of which dies at a random moment
  faults.py mpirun         what mpirun does when a process or a host dies, with and without --enable-recovery
  faults.py scaling        the same study with 1, 2 and 4 processes on two hosts
"""

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import campaign
from hosts import Cluster

LEASE = ["--lease", "3"]


class Lab:
    def __init__(self, directory):
        self.directory = directory
        self.out = os.path.join(directory, "out")

    def path(self, name):
        return os.path.join(self.directory, name)

    def start(self, host, command, log):
        with open(self.path(log), "w", encoding="utf-8") as stream:
            return host.start(command, stream, cwd=self.directory)

    def fresh(self):
        shutil.rmtree(self.out, ignore_errors=True)


def death(lab, command, expected, found, moment_s):
    """One campaign on two hosts, of which the second dies after a while. Returns what that cost, in runs."""
    lab.fresh()
    with Cluster(2, lab.directory) as cluster:
        first, second = cluster.hosts
        processes = [lab.start(host, command, f"{i}.txt") for i, host in enumerate((first, second))]
        time.sleep(moment_s)
        second.send(signal.SIGSTOP)
        lost = len(campaign.at_work(lab.out, second))
        second.die()
        processes[1].wait()
        code = processes[0].wait(600)
        if code != 0:
            raise AssertionError(f"exit code {code}: " + campaign.read(lab.path("0.txt")))
    if found(lab.out) != expected:
        raise AssertionError("other results than alone")
    if campaign.at_work(lab.out):
        raise AssertionError("a claim is left")
    return lost


def deaths(lab, count):
    random.seed(7)
    campaign.prepare(lab.directory)
    start = time.monotonic()
    campaign.run_alone(lab.directory, campaign.study_command("alone", "--jobs", "2"))
    length_s = time.monotonic() - start
    expected = campaign.results(lab.path("alone"))
    lost = [death(lab, campaign.study_command("out", "--share", "--jobs", "1", *LEASE), expected, campaign.results,
                  random.uniform(0.0, length_s)) for _ in range(count)]
    print(f"study: {count} deaths, all results the same; runs lost per death: {lost}", flush=True)

    campaign.prepare_record(lab.directory)
    start = time.monotonic()
    campaign.run_alone(lab.directory, campaign.identify_command("identified", "--screen", "--jobs", "2"))
    length_s = time.monotonic() - start
    expected = campaign.findings(lab.path("identified"))
    command = campaign.identify_command("out", "--screen", "--share", "--jobs", "1", *LEASE)
    lost = [death(lab, command, expected, campaign.findings, random.uniform(0.0, length_s))
            for _ in range(max(1, count // 4))]
    print(f"identify: {len(lost)} deaths, all results the same; runs lost per death: {lost}")


def mpirun(lab):
    campaign.prepare(lab.directory, lift_s=100)
    campaign.run_alone(lab.directory, campaign.study_command("alone", "--jobs", "2"))
    expected = campaign.results(lab.path("alone"))
    for recovery in ([], ["--enable-recovery"]):
        for victim in ("process", "link", "host"):
            lab.fresh()
            with Cluster(2, lab.directory) as cluster:
                first, second = cluster.hosts
                command = cluster.mpirun([first, second], 1, *recovery) + campaign.study_command("out", *LEASE)
                process = lab.start(first, command, "log.txt")
                campaign.wait_until(lambda: campaign.at_work(lab.out, second))
                time.sleep(0.2)
                if victim == "host":
                    second.die()
                elif victim == "link":
                    subprocess.run(["ip", "-n", second.name, "link", "set", "eth0", "down"], check=True)
                else:
                    for number in second.processes():
                        if campaign.read(f"/proc/{number}/cmdline").startswith(f"{campaign.PROGRAM}\0study"):
                            os.kill(number, signal.SIGKILL)
                start = time.monotonic()
                complete_s = None
                while process.poll() is None and time.monotonic() - start < 90:
                    if complete_s is None and os.path.exists(os.path.join(lab.out, "results.csv")):
                        complete_s = time.monotonic() - start
                    time.sleep(0.05)
                ended = f"ends after {time.monotonic() - start:.0f} s" if process.poll() is not None else "hangs"
            if os.path.exists(os.path.join(lab.out, "results.csv")):
                same = "complete, " + ("the same" if campaign.results(lab.out) == expected else "OTHER RESULTS")
            else:
                same = f"incomplete, {campaign.made(campaign.read(lab.path('log.txt')))} of {campaign.RUNS} made"
            print(f"{' '.join(recovery) or 'as shipped'}: {victim} dies: mpirun {ended} with {process.poll()}; "
                  f"the study is {same}", flush=True)


def scaling(lab):
    study = campaign.STUDY.replace("[1, 2, 3]", "[1, 2, 3, 4, 5, 6, 7, 8]")
    campaign.prepare(lab.directory, lift_s=200, study=study)
    for processes in (1, 2, 4):
        lab.fresh()
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        # Without mpirun, whose daemons take their processor time where we cannot see it.
        with Cluster(2, lab.directory) as cluster:
            command = campaign.study_command("out", "--share", "--jobs", "1")
            start = time.monotonic()
            started = [lab.start(cluster.hosts[i % 2], command, f"{i}.txt") for i in range(processes)]
            codes = [process.wait() for process in started]
            wall_s = time.monotonic() - start
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        if any(codes):
            raise AssertionError(campaign.read(lab.path("0.txt")))
        print(f"{processes} process(es): {wall_s:.1f} s on the clock, {cpu_s:.1f} s of processor time", flush=True)


def main():
    if len(sys.argv) < 2 or sys.argv[1] not in ("deaths", "mpirun", "scaling"):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as directory:
        lab = Lab(directory)
        if sys.argv[1] == "deaths":
            deaths(lab, int(sys.argv[2]) if len(sys.argv) > 2 else 20)
        elif sys.argv[1] == "mpirun":
            mpirun(lab)
        else:
            scaling(lab)


if __name__ == "__main__":
    main()
