#!/usr/bin/python3
"""Studies and identifications on a cluster of two hosts (environment BRASH_ICE_PROGRAM), and the death of one of them.

Exits with 77, for skipped, and the reason where this machine does not let us make hosts (hosts.py)."""

import os
import shutil
import signal
import sys
import tempfile
import time
import unittest

import campaign
from hosts import Cluster, Unavailable

LEASE = ["--lease", "3"]
PATIENCE_S = 400  # on a machine that others load, too; ctest has the last word


class ClusterTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(temporary.cleanup)
        cls.directory = temporary.name
        campaign.prepare(cls.directory)
        campaign.run_alone(cls.directory, campaign.study_command("alone"))
        cls.expected = campaign.results(cls.path("alone"))

    @classmethod
    def path(cls, name):
        return os.path.join(cls.directory, name)

    def setUp(self):
        self.cluster = Cluster(2, self.directory)
        self.cluster.__enter__()
        self.addCleanup(self.cluster.__exit__)
        self.first, self.second = self.cluster.hosts
        self.out = self.path("out")
        self.addCleanup(shutil.rmtree, self.out, ignore_errors=True)

    def start(self, host, command, log):
        with open(self.path(log), "w", encoding="utf-8") as stream:
            return host.start(command, stream, cwd=self.directory)

    def text(self, log):
        return campaign.read(self.path(log))

    def mpirun(self, command, log):
        return self.start(self.first, self.cluster.mpirun([self.first, self.second], 1) + command, log)

    def start_on_both(self):
        command = campaign.study_command("out", "--share", "--jobs", "1", *LEASE)
        return [self.start(host, command, f"{i}.txt") for i, host in enumerate(self.cluster.hosts)]

    def expect_the_same_results(self):
        self.assertEqual(campaign.results(self.out), self.expected)
        self.assertEqual(campaign.at_work(self.out), [])

    def test_mpirun_over_two_hosts_gives_the_same_bits(self):
        mpirun = self.mpirun(campaign.study_command("out"), "log.txt")
        self.assertEqual(mpirun.wait(PATIENCE_S), 0, self.text("log.txt"))
        lines = self.text("log.txt").splitlines()
        counts = [campaign.made("\n".join(line for line in lines if line.startswith(f"[1,{rank}]"))) for rank in (0, 1)]
        self.assertEqual(sum(counts), campaign.RUNS, self.text("log.txt"))
        self.assertGreater(min(counts), 0, "both hosts make runs")
        self.expect_the_same_results()

    def test_the_death_of_a_host_costs_the_run_that_it_had_at_work(self):
        processes = self.start_on_both()
        lost = campaign.stop_in_a_run(self.second, self.out)
        self.second.die()
        self.assertNotEqual(processes[1].wait(10), 0)
        self.assertIn(lost, campaign.at_work(self.out), "nobody has noticed yet")
        self.assertEqual(processes[0].wait(PATIENCE_S), 0, self.text("0.txt"))
        counts = [campaign.made(self.text(f"{i}.txt")) for i in (0, 1)]
        self.assertEqual(sum(counts), campaign.RUNS, "what the dead host had finished is not made again")
        self.expect_the_same_results()

    def test_a_host_that_hangs_and_comes_back_does_no_harm(self):
        processes = self.start_on_both()
        lost = campaign.stop_in_a_run(self.second, self.out)
        campaign.wait_until(lambda: os.path.exists(os.path.join(lost, "claim.2")) or processes[0].poll() is not None)
        self.second.send(signal.SIGCONT)
        for process, log in zip(processes, ("0.txt", "1.txt")):
            self.assertEqual(process.wait(PATIENCE_S), 0, self.text(log))
        self.assertEqual(sum(campaign.made(self.text(f"{i}.txt")) for i in (0, 1)), campaign.RUNS)
        self.expect_the_same_results()

    def test_where_mpirun_gives_up_with_a_host_the_same_command_goes_on(self):
        mpirun = self.mpirun(campaign.study_command("out", *LEASE), "log.txt")
        campaign.stop_in_a_run(self.second, self.out)
        self.second.die()
        self.assertNotEqual(mpirun.wait(PATIENCE_S), 0, "Open MPI ends all when it loses a host")
        made_before = campaign.made(self.text("log.txt"))
        at_work = len(campaign.at_work(self.out))
        self.assertFalse(os.path.exists(os.path.join(self.out, "results.csv")))
        self.cluster.revive(self.second)
        again = self.mpirun(campaign.study_command("out", *LEASE), "again.txt")
        self.assertEqual(again.wait(PATIENCE_S), 0, self.text("again.txt"))
        self.assertLessEqual(campaign.made(self.text("again.txt")), campaign.RUNS - made_before)
        self.assertLessEqual(at_work, 2)
        self.expect_the_same_results()

    def test_an_identification_over_two_hosts_finds_the_same(self):
        campaign.prepare_record(self.directory)
        campaign.run_alone(self.directory, campaign.identify_command("identified_alone", "--screen"))
        mpirun = self.mpirun(campaign.identify_command("out", "--screen"), "log.txt")
        self.assertEqual(mpirun.wait(PATIENCE_S), 0, self.text("log.txt"))
        self.assertEqual(campaign.findings(self.out), campaign.findings(self.path("identified_alone")))
        self.assertEqual(self.text("log.txt").count("/report.json"), 1, "one process writes it")


def reason_to_skip():
    if shutil.which("mpirun") is None:
        return "mpirun is not installed (package openmpi-bin)"
    with tempfile.TemporaryDirectory() as directory:
        try:
            with Cluster(1, directory):
                return ""
        except Unavailable as error:
            return f"this machine does not let us make hosts: {error}"


if __name__ == "__main__":
    reason = reason_to_skip()
    if reason:
        print(f"skipped: {reason}", file=sys.stderr)
        sys.exit(77)
    unittest.main()
