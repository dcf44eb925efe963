#!/usr/bin/python3
"""Tests of scripts/bench on a small field (environment BRASH_ICE_STEP_BENCH). None of them judges a speed."""

import json
import math
import os
import subprocess
import tempfile
import unittest

SOURCE_DIR = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SCRIPT = os.path.join(SOURCE_DIR, "scripts", "bench")
PROGRAM = os.environ["BRASH_ICE_STEP_BENCH"]

OUR_ROWS = {f"{phase}.threads_{threads}" for phase in ("elastic", "plastic", "size_2500", "size_10000")
            for threads in (1, 2)} | {f"lift.scale_{scale}" for scale in ("0.001", "0.01", "0.1", "1")}
PEER_ROWS = {f"peer.{method}{ratio}" for method in ("dem", "elastic", "plastic")
             for ratio in ("", ".over_elastic", ".over_plastic")}

# What LAMMPS prints: the loop before the one that counts comes first.
PEER = """#!/bin/sh
[ "$1" = -h ] && { echo 'Large-scale Atomic/Molecular Massively Parallel Simulator - 1 Jan 2000'; exit 0; }
steps=$(echo "$*" | sed 's/.*-var timed_steps \\([0-9]*\\).*/\\1/')
method=$(echo "$*" | sed 's/.*-var method \\([a-z]*\\).*/\\1/')
cat <<TEXT
Loop time of 99 on 1 procs for 20 steps with 2500 atoms
Pair    | 98         | 98         | 98         |   0.0 | 98.99
Loop time of 2.5 on 1 procs for $steps steps with 2500 atoms

80.0% CPU use with 1 MPI tasks x 1 OpenMP threads
Pair    | 1.5        | 1.5        | 1.5        |   0.0 | 60.00
peer method=$method particles=2500 step_s=0.001 rise_m=0.05 load_n=-0
TEXT
"""
PEER_STEPS = {"dem": 1000, "elastic": 100, "plastic": 100}


class Bench(unittest.TestCase):
    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.directory = directory.name
        self.out = os.path.join(self.directory, "bench.json")

    def bench(self, *arguments, program=PROGRAM):
        return subprocess.run([SCRIPT, "--smoke", "--program", program, "--out", self.out, *arguments], text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False)

    def rows(self, run):
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)
        with open(self.out, encoding="utf-8") as stream:
            self.result = json.load(stream)
        for row in self.result["rows"]:
            for key in ("value", "median", "low", "high"):
                self.assertTrue(math.isfinite(row[key]) and row[key] > 0.0, row)
            self.assertIn(row["text"], run.stdout)
            self.assertLessEqual(row["low"], row["median"])
            self.assertLessEqual(row["median"], row["high"])
        return {row["id"]: row for row in self.result["rows"]}

    def write_peer(self, text):
        path = os.path.join(self.directory, "lmp")
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(text)
        os.chmod(path, 0o755)
        return path

    def test_every_row_is_there_without_a_peer(self):
        run = self.bench("--lammps", "")
        rows = self.rows(run)
        self.assertEqual(set(rows), OUR_ROWS)
        self.assertTrue(self.result["same_state"])
        for key in ("cpu", "cores", "caches_of_one_core", "simd", "memory_gib", "os", "kernel"):
            self.assertIn(key, self.result["machine"])
        self.assertGreater(self.result["machine"]["memory_gib"], 0.1)
        self.assertRegex(self.result["program"]["compiler"], r"^(gcc|clang) \d+")
        self.assertIsNone(self.result["program"]["lammps"])

        elastic = rows["elastic.threads_1"]
        self.assertEqual(elastic["particles"], 2500)
        self.assertAlmostEqual(elastic["time_s"], -2.9, places=6)
        self.assertAlmostEqual(rows["plastic.threads_2"]["time_s"], 0.05, places=6)
        self.assertAlmostEqual(elastic["value"] * elastic["steps_per_s"] * 2500, 1e9, delta=1e3)
        for size in (2500, 10000):
            row = rows[f"size_{size}.threads_1"]
            self.assertEqual(row["particles"], size)
            self.assertAlmostEqual(row["ratio_to_10000"], row["value"] / rows["size_10000.threads_1"]["value"])
            self.assertAlmostEqual(row["ratio_by_processor_time"],
                                   row["processor_ns"] / rows["size_10000.threads_1"]["processor_ns"])
            # A particle's position, velocity and stress alone are 64 bytes.
            self.assertGreater(row["peak_memory_bytes_per_particle"], 64)
        soft, stiff = rows["lift.scale_0.001"], rows["lift.scale_1"]
        self.assertTrue(soft["whole"])
        self.assertAlmostEqual(soft["simulated_s"], 0.05)
        self.assertFalse(stiff["whole"])
        # The step goes with one over the wave speed, rounded down to a part of 10 ms.
        self.assertAlmostEqual(soft["step_s"] / stiff["step_s"], math.sqrt(1000.0), delta=7.0)
        for row in (soft, stiff):
            self.assertAlmostEqual(row["value"], row["simulated_s"] / row["wall_s"])

    def test_a_peer_is_set_in_ratio_to_ours(self):
        rows = self.rows(self.bench("--lammps", self.write_peer(PEER)))
        self.assertEqual(set(rows), OUR_ROWS | PEER_ROWS)
        self.assertEqual(self.result["program"]["lammps"], "1 Jan 2000")
        for method, steps in PEER_STEPS.items():
            peer = rows[f"peer.{method}"]
            self.assertAlmostEqual(peer["value"], 1e9 * 2.5 / (2500 * steps))
            self.assertAlmostEqual(peer["pair_ns"], 1e9 * 1.5 / (2500 * steps))
            self.assertAlmostEqual(peer["processor_ns"], 0.8 * peer["value"])
            self.assertAlmostEqual(peer["real_time_factor"], steps * 0.001 / 2.5)
            for phase in ("elastic", "plastic"):
                ours, ratio = rows[f"{phase}.threads_1"], rows[f"peer.{method}.over_{phase}"]
                self.assertAlmostEqual(ratio["value"], peer["value"] / ours["value"])
                self.assertAlmostEqual(ratio["ratio_by_processor_time"], peer["processor_ns"] / ours["processor_ns"])

    def test_a_failed_measurement_is_told(self):
        run = self.bench("--lammps", self.write_peer("#!/bin/sh\necho 'ERROR: Lost atoms'\nexit 3\n"))
        self.assertEqual(run.returncode, 1)
        self.assertIn("ERROR: Lost atoms", run.stderr)
        self.assertFalse(os.path.exists(self.out))
        run = self.bench("--out", os.path.join(self.directory, "none", "bench.json"))
        self.assertEqual(run.returncode, 1)
        self.assertIn("there is no directory for", run.stderr)
        run = self.bench("--lammps", "", program="/bin/false")
        self.assertEqual(run.returncode, 1)
        self.assertIn("step_bench ended with exit code 1", run.stderr)

    def test_bad_arguments_are_refused(self):
        run = self.bench(program=os.path.join(self.directory, "none"))
        self.assertEqual(run.returncode, 2)
        self.assertIn("--program", run.stderr)
        run = self.bench("--quick")
        self.assertEqual(run.returncode, 2)
        self.assertIn("--quick", run.stderr)


class StepBench(unittest.TestCase):
    def step_bench(self, *arguments, lines=""):
        scenario = os.path.join(SOURCE_DIR, "config", "scenarios", "pull_up.yaml")
        small = ["--set", "field.length_x_m=6", "--set", "field.length_y_m=6"]
        return subprocess.run([PROGRAM, scenario, *small, *arguments], text=True, input=lines, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, check=False)

    def test_stretches_begin_where_they_are_told_to(self):
        run = self.step_bench(lines="-2.9 0.05\n-2.95 0.02\n")
        self.assertEqual(run.returncode, 0, run.stderr)
        header, first, second = map(json.loads, run.stdout.splitlines())
        self.assertEqual(header["particles"], 20 * 20 * 4)
        self.assertAlmostEqual(first["time_s"], -2.9)
        self.assertAlmostEqual(first["simulated_s"], 0.05)
        self.assertEqual(first["steps"], round(0.05 / header["step_s"]))
        self.assertEqual(first["stage"], "settle")
        # A time that has passed: at once.
        self.assertAlmostEqual(second["time_s"], -2.85)
        self.assertNotEqual(first["state_hash"], second["state_hash"])

    def test_bad_input_is_refused(self):
        for arguments, lines in (((), "now 1\n"), ((), "0 0\n"), ((), "0\n"), (("--set", "solver.threads=0"), ""),
                                 (("--fast",), "")):
            self.assertEqual(self.step_bench(*arguments, lines=lines).returncode, 2, (arguments, lines))


if __name__ == "__main__":
    unittest.main()
