#!/usr/bin/python3
"""Tests of scripts/bag_to_record, and of `brash_ice check` on a bag (environment BRASH_ICE_PROGRAM), with bags written
here. PYTHONPATH must lead to the package's messages."""

import csv
import io
import math
import os
import subprocess
import sys
import tempfile
import unittest

import rosbag
import rospy
import yaml
from brash_ice_rig.msg import CraneState, ForceComponents, TakenCommand
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import String

SOURCE_DIR = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SCRIPT = os.path.join(SOURCE_DIR, "scripts", "bag_to_record")

START_S = 101.0  # stamp of time 0
QUIET_S = 8.0
SPEED_MPS = 0.052


def height_m(time_s):
    return -1.38 + SPEED_MPS * max(0.0, time_s)


def force_n(time_s):
    noise_n = 30.0 * ((int(round(1e3 * time_s)) * 7919 % 101) / 50.0 - 1.0)
    return 2052.0 + 12000.0 * min(1.0, max(0.0, time_s) / 20.0) + noise_n


def state_at(time_s, stamp_s):
    state = CraneState()
    state.header.stamp = rospy.Time.from_sec(stamp_s)
    state.time_s = time_s
    state.hoist_position_m = height_m(time_s)
    state.velocity_mps.z = SPEED_MPS if time_s > 0.0 else 0.0
    state.commanded_velocity_mps.z = state.velocity_mps.z
    return state


def write_run(bag, start_s, end_s, rig="/rig/", shift_s=0.0):
    """Force at 20 Hz, motion at 10 Hz. shift_s: of the stamps."""
    for i in range(int(round(20 * (end_s - start_s))) + 1):
        time_s = start_s + i / 20
        stamp_s = START_S + shift_s + time_s
        wrench = WrenchStamped()
        wrench.header.stamp = rospy.Time.from_sec(stamp_s)
        wrench.wrench.force.x, wrench.wrench.force.y, wrench.wrench.force.z = 1.0, -2.0, force_n(time_s)
        bag.write(rig + "load_cell/wrench", wrench, wrench.header.stamp)
        if i % 2 == 0:
            bag.write(rig + "crane/state", state_at(time_s, stamp_s), wrench.header.stamp)


class BagToRecord(unittest.TestCase):
    def setUp(self):
        self.directory = tempfile.TemporaryDirectory()
        self.addCleanup(self.directory.cleanup)
        self.bag_file = self.path("test.bag")

    def path(self, name):
        return os.path.join(self.directory.name, name)

    def run_script(self, *arguments):
        return subprocess.run([sys.executable, SCRIPT, *arguments], capture_output=True, text=True, check=False)

    def convert(self, *arguments):
        outcome = self.run_script(self.bag_file, *arguments)
        self.assertEqual(outcome.returncode, 0, outcome.stderr)
        return outcome.stdout.split()

    def refusal(self, *arguments):
        outcome = self.run_script(self.bag_file, *arguments)
        self.assertEqual(outcome.returncode, 1, outcome.stdout)
        self.assertTrue(outcome.stderr.startswith("bag_to_record: "), outcome.stderr)
        self.assertNotIn("Traceback", outcome.stderr)
        return outcome.stderr

    def simulated_bag(self):
        with rosbag.Bag(self.bag_file, "w") as bag:
            bag.write("/rig/sim/scenario", String("# brash_ice_rig 1\ntitle: Bag test\ncollector: {radius_m: 1.2}\n"),
                      rospy.Time.from_sec(START_S - QUIET_S))
            for after_s, buoyancy_n in [(0.0, 0.0), (1.0, 302.5), (20.0, 210.0)]:
                components = ForceComponents(time_s=after_s - QUIET_S, weight_n=2354.4, buoyancy_n=buoyancy_n)
                components.header.stamp = rospy.Time.from_sec(START_S - QUIET_S + after_s)
                bag.write("/rig/ground_truth/force_components", components, components.header.stamp)
            write_run(bag, -QUIET_S, 40.0)

    def rows(self, name="test.csv"):
        with open(self.path(name), newline="", encoding="utf-8") as stream:
            return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(stream)]

    def test_rows_are_force_and_motion_at_the_time_of_the_test(self):
        self.simulated_bag()
        names = [os.path.basename(path) for path in self.convert()]
        self.assertEqual(names, ["test.csv", "test.yaml", "test_rig.yaml"])
        rows = self.rows()
        self.assertEqual(len(rows), 20 * 48 + 1)
        for row in rows:
            time_s = row["time_s"]
            self.assertAlmostEqual(row["force_n"], force_n(round(20 * time_s) / 20), delta=1e-3)
            # A straight line between 10 Hz messages cuts the corner at the start by 1.3 mm.
            self.assertAlmostEqual(row["hoist_position_m"], height_m(time_s), delta=2e-3)
            self.assertEqual((row["force_x_n"], row["force_y_n"]), (1.0, -2.0))
            if abs(time_s) > 0.11:
                self.assertAlmostEqual(row["hoist_speed_mps"], SPEED_MPS if time_s > 0.0 else 0.0, delta=1e-6)
                self.assertAlmostEqual(row["hoist_command_mps"], SPEED_MPS if time_s > 0.0 else 0.0, delta=1e-6)
        self.assertAlmostEqual(rows[0]["time_s"], -QUIET_S, delta=1e-6)

    def test_manifest_holds_what_the_bag_knows(self):
        self.simulated_bag()
        self.convert()
        with open(self.path("test.yaml"), encoding="utf-8") as stream:
            manifest = yaml.safe_load(stream)
        self.assertEqual(manifest["title"], "Bag test")
        self.assertEqual(manifest["source"], "synthetic")
        self.assertEqual(manifest["rig"], "test_rig.yaml")
        self.assertAlmostEqual(manifest["tare_n"], 2354.4 - 302.5)

    def commanded_bag(self, indices, start_s=-QUIET_S, motion_file=""):
        """A run that was told something at each index, with the times of the ground truth."""
        with rosbag.Bag(self.bag_file, "w") as bag:
            first = rospy.Time.from_sec(START_S - QUIET_S)
            scenario = (f"# brash_ice_rig 1\ntitle: By hand\nprocedure:\n  settle_duration_s: {QUIET_S}\n"
                        f"  motion_file: \"{motion_file}\"\n  commands_file: \"/gone/commands.csv\"\n")
            bag.write("/rig/sim/scenario", String(scenario), first)
            if motion_file:
                bag.write("/rig/sim/motion_file", String("time_s,hoist_position_m\n0,0\n1,1\n"), first)
            for index in indices:
                command = TakenCommand(time_s=start_s + index / 3.0, index=index)
                command.header.stamp = rospy.Time.from_sec(START_S + command.time_s)
                if index % 2 == 1:
                    command.has_velocity, command.velocity_mps.z = True, 0.1 + 0.2
                if index == 2:
                    command.has_fold_target, command.fold_target = True, 1.0 / 3.0
                command.tare = index == 4
                if index == 5:
                    command.has_load_cell_noise, command.load_cell_noise_n = True, 20.0
                    command.has_load_cell_resolution, command.load_cell_resolution_n = True, 0.1
                bag.write("/rig/sim/commands", command, command.header.stamp)
            for i in range(20 * 9):
                components = ForceComponents(time_s=-QUIET_S + i * 0.05, weight_n=2000.0, tension_n=1800.0)
                components.header.stamp = rospy.Time.from_sec(START_S - QUIET_S + i / 20)
                bag.write("/rig/ground_truth/force_components", components, components.header.stamp)
            write_run(bag, -QUIET_S, 1.0)

    def manifest(self):
        with open(self.path("test.yaml"), encoding="utf-8") as stream:
            return yaml.safe_load(stream)

    def test_commands_make_a_record_that_repeats_to_the_last_bit(self):
        self.commanded_bag(range(6), motion_file="/elsewhere/way.csv")
        names = [os.path.basename(path) for path in self.convert()]
        self.assertEqual(names, ["test.csv", "test.yaml", "test_rig.yaml", "test_commands.csv", "test_motion.csv"])
        with open(self.path("test_commands.csv"), encoding="utf-8") as stream:
            lines = stream.read().splitlines()
        self.assertEqual(lines[0], "time_s,velocity_x_mps,velocity_y_mps,velocity_z_mps,fold_target,tare,"
                         "load_cell_noise_n,load_cell_resolution_n")
        self.assertEqual(lines[1], f"{-QUIET_S + 1 / 3.0!r},0.0,0.0,{0.1 + 0.2!r},,,,")
        self.assertEqual(lines[2], f"{-QUIET_S + 2 / 3.0!r},,,,{1.0 / 3.0!r},,,")
        self.assertEqual(lines[4], f"{-QUIET_S + 4 / 3.0!r},,,,,1,,")
        self.assertEqual(lines[5], f"{-QUIET_S + 5 / 3.0!r},0.0,0.0,{0.1 + 0.2!r},,,{20.0!r},{0.1!r}")
        self.assertEqual(len(lines), 1 + 5 + 1)
        self.assertTrue(lines[-1].endswith(",,,,,,,"))
        manifest = self.manifest()
        self.assertEqual((manifest["commands"], manifest["motion"]), ("test_commands.csv", "test_motion.csv"))
        self.assertAlmostEqual(manifest["tare_n"], 2000.0 - 1800.0, msg="what the tare took off")
        with open(self.path("test_rig.yaml"), encoding="utf-8") as stream:
            procedure = yaml.safe_load(stream)["procedure"]
        self.assertEqual((procedure["motion_file"], procedure["commands_file"]), ("", ""))
        # Times of the ground truth and forces, in digits that give back their bits.
        rows = self.rows()
        self.assertEqual(rows[1]["time_s"], -QUIET_S + 0.05)
        self.assertEqual(rows[7]["force_n"], force_n(-QUIET_S + 7 / 20))

    def test_each_run_has_the_scenario_that_was_loaded_for_it(self):
        with rosbag.Bag(self.bag_file, "w") as bag:
            for shift_s, title in [(0.0, "First"), (20.0, "Second")]:
                bag.write("/rig/sim/scenario", String(f"title: {title}\n"),
                          rospy.Time.from_sec(START_S - QUIET_S + shift_s))
                components = ForceComponents(weight_n=1000.0 + shift_s)
                components.header.stamp = rospy.Time.from_sec(START_S + shift_s)
                bag.write("/rig/ground_truth/force_components", components, components.header.stamp)
                write_run(bag, -QUIET_S, 1.0, shift_s=shift_s)
        for run, title, tare_n in [("1", "First", 1000.0), ("2", "Second", 1020.0)]:
            self.convert("--force", "--run", run)
            self.assertEqual(self.manifest()["title"], title)
            self.assertAlmostEqual(self.manifest()["tare_n"], tare_n)

    def test_commands_that_are_not_all_there_are_left_out_and_the_notes_say_why(self):
        for indices, start_s, reason in [([], 0.0, "no messages on sim/commands"),
                                         ([2, 3], -QUIET_S, "are missing"),
                                         ([0, 1, 3], -QUIET_S, "are missing"),
                                         ([0, 1], -QUIET_S + 3.0, "did not begin at the start")]:
            self.commanded_bag(indices, start_s)
            self.convert("--force")
            manifest = self.manifest()
            self.assertNotIn("commands", manifest)
            self.assertIn("cannot be repeated to the last bit: ", manifest["notes"])
            self.assertIn(reason, manifest["notes"])

    def test_program_checks_a_bag_as_the_record_that_it_becomes(self):
        self.simulated_bag()
        program = os.environ["BRASH_ICE_PROGRAM"]
        outcome = subprocess.run([program, "check", self.bag_file], capture_output=True, text=True, check=False)
        self.assertEqual(outcome.returncode, 0, outcome.stdout + outcome.stderr)
        self.assertIn(f'{self.bag_file}: record "Bag test" (synthetic)', outcome.stdout)
        self.assertIn("usable for identification: yes", outcome.stdout)
        self.assertEqual(os.listdir(self.directory.name), ["test.bag"])
        self.convert()
        again = subprocess.run([program, "check", self.path("test.csv")], capture_output=True, text=True, check=False)
        self.assertEqual(again.stdout.split("\n", 1)[1], outcome.stdout.split("\n", 1)[1])
        # Cut off, as by a full disk.
        with open(self.bag_file, "r+b") as stream:
            stream.truncate(20000)
        outcome = subprocess.run([program, "check", self.bag_file], capture_output=True, text=True, check=False)
        self.assertEqual(outcome.returncode, 2)
        self.assertIn("rosbag reindex", outcome.stderr)

    def test_pause_leaves_no_trace(self):
        with rosbag.Bag(self.bag_file, "w") as bag:
            write_run(bag, -1.0, 0.0)
            for i in range(1, 6):  # repeated, stamps creep by a microsecond
                stamp_s = START_S + 1e-6 * i
                bag.write("/rig/crane/state", state_at(0.0, stamp_s), rospy.Time.from_sec(stamp_s))
            write_run(bag, 0.05, 1.0, shift_s=5e-6)
        self.convert("--source", "lab")
        times_s = [row["time_s"] for row in self.rows()]
        self.assertTrue(all(b > a for a, b in zip(times_s, times_s[1:])))
        self.assertGreater(len(times_s), 36)
        self.assertAlmostEqual(times_s[-1], 0.95, delta=1e-4)

    def test_each_reset_starts_a_run_that_can_be_chosen(self):
        with rosbag.Bag(self.bag_file, "w") as bag:
            write_run(bag, -1.0, 2.0)
            write_run(bag, -1.0, 1.0, shift_s=10.0)
        self.assertIn("holds 2 runs, one after each reset; choose with --run 1 to --run 2",
                      self.refusal("--source", "lab"))
        self.convert("--source", "lab", "--run", "2")
        rows = self.rows()
        self.assertEqual(len(rows), 41)
        self.assertAlmostEqual(rows[-1]["time_s"], 1.0, delta=1e-6)
        self.assertIn("--run 3: the bag holds 2", self.refusal("--source", "lab", "--run", "3"))

    def test_several_rigs_must_be_told_apart(self):
        with rosbag.Bag(self.bag_file, "w") as bag:
            write_run(bag, -1.0, 1.0, rig="/rig_1/")
            write_run(bag, -1.0, 1.0, rig="/rig_2/")
        self.assertIn("choose with --ns: /rig_1/, /rig_2/", self.refusal("--source", "lab"))
        self.assertIn("no topic /rig_3/load_cell/wrench", self.refusal("--source", "lab", "--ns", "rig_3"))
        self.convert("--source", "lab", "--ns", "rig_2")

    def test_what_cannot_be_a_record_is_refused_with_its_reason(self):
        self.assertIn("No such file", self.refusal())
        with open(self.bag_file, "wb") as stream:
            stream.write(b"nonsense")
        self.refusal()
        with rosbag.Bag(self.bag_file, "w") as bag:
            bag.write("/chatter", String("x"), rospy.Time.from_sec(1.0))
        self.assertIn("no topic .../load_cell/wrench; the topics are /chatter", self.refusal())
        with rosbag.Bag(self.bag_file, "w") as bag:
            bag.write("/rig/load_cell/wrench", WrenchStamped(), rospy.Time.from_sec(1.0))
        self.assertIn("no messages on /rig/crane/state", self.refusal())
        with rosbag.Bag(self.bag_file, "w") as bag:
            write_run(bag, -1.0, 1.0)
        self.assertIn("give --source field, lab or synthetic", self.refusal())

    def test_a_damaged_bag_is_refused(self):
        with rosbag.Bag(self.bag_file, "w") as bag:
            write_run(bag, -1.0, 1.0)
        with open(self.bag_file, "rb") as stream:
            whole = stream.read()
        message = whole.rindex(b"conn=")  # in the header of the last message's record
        with open(self.bag_file, "wb") as stream:
            stream.write(whole[:message - 4] + b"\xff\xff" + whole[message - 2:])  # the length of a field is wrong
        outcome = self.run_script(self.bag_file, "--source", "field")
        self.assertEqual(outcome.returncode, 1, outcome.stdout)
        self.assertTrue(outcome.stderr.splitlines()[-1].startswith("bag_to_record: "), outcome.stderr)
        self.assertNotIn("Traceback", outcome.stderr)

    def test_definitions_in_a_bag_are_not_what_its_messages_are_read_by(self):
        with rosbag.Bag(self.bag_file, "w") as bag:
            write_run(bag, -1.0, 1.0)
        self.convert("--source", "field")
        rows = self.rows()
        with open(self.bag_file, "rb") as stream:
            whole = stream.read()
        for old, new in ((b"float64 x\n", b"string  x\n"), (b"float64 time_s", b"float64 tim__s")):
            self.assertIn(old, whole)
            with open(self.bag_file, "wb") as stream:
                stream.write(whole.replace(old, new))
            self.convert("--source", "field", "--force")
            self.assertEqual(self.rows(), rows)

    def test_messages_of_another_type_are_refused(self):
        for topic, message in [("crane/state", WrenchStamped()), ("sim/commands", String("x")),
                               ("load_cell/wrench", ForceComponents()), ("sim/scenario", CraneState())]:
            with rosbag.Bag(self.bag_file, "w") as bag:
                if topic != "load_cell/wrench":
                    bag.write("/rig/load_cell/wrench", WrenchStamped(), rospy.Time.from_sec(START_S))
                bag.write("/rig/" + topic, message, rospy.Time.from_sec(START_S))
            self.assertIn(f"/rig/{topic}: holds messages of type {message._type} ", self.refusal("--source", "field"))

    def test_times_that_are_no_numbers_or_go_back_make_no_rows(self):
        with rosbag.Bag(self.bag_file, "w") as bag:
            write_run(bag, -1.0, 1.0)
            for stamp_s, time_s in [(0.2, math.nan), (0.4, -0.5), (0.6, math.inf)]:
                components = ForceComponents(time_s=time_s, tension_n=math.nan)
                components.header.stamp = rospy.Time.from_sec(START_S + stamp_s)
                bag.write("/rig/ground_truth/force_components", components, components.header.stamp)
            state = state_at(math.nan, START_S + 0.9)
            bag.write("/rig/crane/state", state, state.header.stamp)
        self.convert("--source", "field")
        times = [row["time_s"] for row in self.rows()]
        self.assertEqual(len(times), 41 - 3)
        self.assertEqual(times, sorted(times))
        self.assertTrue(all(math.isfinite(time_s) for time_s in times))

    def test_code_in_the_message_definitions_of_a_bag_is_not_run(self):
        """Rosbag would make Python code of them: a field's name may hold statements."""
        trap = self.path("trap")
        wrench = WrenchStamped()
        content = io.BytesIO()
        wrench.serialize(content)
        for md5sum in ("0" * 32, WrenchStamped._md5sum):
            class Foreign:
                _type = WrenchStamped._type
                _md5sum = md5sum
                _full_text = WrenchStamped._full_text.replace(
                    "Wrench wrench", f"string 0;open({trap!r},'w');x=y\nWrench wrench", 1)
            with rosbag.Bag(self.bag_file, "w") as bag:
                bag.write("/rig/load_cell/wrench", (Foreign._type, content.getvalue(), md5sum, Foreign), raw=True)
            outcome = self.run_script(self.bag_file, "--source", "field")
            self.assertEqual(outcome.returncode, 1, outcome.stdout + outcome.stderr)
            self.assertFalse(os.path.exists(trap), "the bag's code was run")
            self.assertNotIn("Traceback", outcome.stderr)
            if md5sum != WrenchStamped._md5sum:
                self.assertIn("must be geometry_msgs/WrenchStamped as this version", outcome.stderr)

    def test_files_that_exist_are_replaced_only_if_asked(self):
        self.simulated_bag()
        self.convert("--out", self.path("other"))
        self.assertIn("other.csv exists; --force replaces it", self.refusal("--out", self.path("other")))
        self.convert("--out", self.path("other"), "--force")


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=1))
