#!/usr/bin/python3
"""Tests of the package as users get it: rosrun finds one program of each name, and what is installed works without the
sources. Environment: BUILD_DIR, DEVEL_PROGRAMS (where the devel space keeps its programs)."""

import glob
import os
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree

SOURCE_DIR = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD_DIR = os.environ["BUILD_DIR"]
DEVEL_PROGRAMS = os.environ["DEVEL_PROGRAMS"]
PACKAGE = "brash_ice_rig"


def programs_in(directory):
    return {name for name in os.listdir(directory)
            if os.path.isfile(os.path.join(directory, name)) and os.access(os.path.join(directory, name), os.X_OK)}


class DevelSpace(unittest.TestCase):
    def test_rosrun_finds_one_program_of_each_name(self):
        """Rosrun searches the whole package but <package>/build, and asks which one where it finds two."""
        places = {}
        for directory, subdirectories, files in os.walk(SOURCE_DIR):
            if directory == SOURCE_DIR:
                subdirectories[:] = [name for name in subdirectories if name not in ("build", ".git")]
            if not os.path.samefile(directory, DEVEL_PROGRAMS):
                for name in programs_in(directory) & set(files):
                    places.setdefault(name, []).append(directory)
        programs = programs_in(DEVEL_PROGRAMS)
        self.assertLessEqual({"brash_ice", "plot_force", "pull_up", "rig_node"}, programs)
        self.assertEqual({name: places[name] for name in programs if name in places}, {})


class InstallSpace(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.directory = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.directory.cleanup)
        subprocess.run(["cmake", "--install", BUILD_DIR, "--prefix", cls.directory.name], check=True,
                       stdout=subprocess.DEVNULL)
        cls.programs = os.path.join(cls.directory.name, "lib", PACKAGE)
        cls.share = os.path.join(cls.directory.name, "share", PACKAGE)

    def run_program(self, name, *arguments):
        outcome = subprocess.run([os.path.join(self.programs, name), *arguments], capture_output=True, text=True,
                                 check=False, cwd=self.directory.name, env={"PATH": "/usr/bin:/bin"})
        self.assertEqual(outcome.returncode, 0, outcome.stdout + outcome.stderr)
        return outcome.stdout

    def test_has_every_program_of_the_devel_space(self):
        programs = {name for name in programs_in(DEVEL_PROGRAMS) if not name.endswith("_test")}
        self.assertEqual(programs_in(self.programs), programs)

    def test_has_every_node_and_file_that_a_launch_file_names(self):
        launch_files = glob.glob(os.path.join(self.share, "launch", "*.launch"))
        self.assertEqual(len(launch_files), len(glob.glob(os.path.join(SOURCE_DIR, "launch", "*"))))
        for launch_file in launch_files:
            tree = xml.etree.ElementTree.parse(launch_file)
            for node in tree.iter("node"):
                if node.get("pkg") == PACKAGE:
                    self.assertIn(node.get("type"), programs_in(self.programs), launch_file)
            for word in " ".join(text for element in tree.iter() for text in element.attrib.values()).split():
                prefix, found, path = word.partition(f"$(find {PACKAGE})/")
                if found and "$" not in path:
                    places = [os.path.join(self.share, path), os.path.join(self.programs, path)]
                    self.assertTrue(any(map(os.path.exists, places)), f"{launch_file}: {prefix}{path}")

    def test_checks_the_scenarios_beside_it(self):
        scenarios = glob.glob(os.path.join(self.share, "config", "scenarios", "*.yaml"))
        self.assertGreater(len(scenarios), 0)
        self.run_program("brash_ice", "check", *scenarios)

    def test_scripts_find_their_modules(self):
        for script in ("identify_report", "plot_force", "study_report"):
            self.assertIn("usage: " + script, self.run_program(script, "--help"))


if __name__ == "__main__":
    unittest.main()
