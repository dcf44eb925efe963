#!/usr/bin/python3
"""No shell is ever built from input, and nothing that was read is run. Looks at the sources, and gives programs names
that a shell would run. Environment: BRASH_ICE_PROGRAM."""

import ast
import glob
import json
import os
import re
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree

SOURCE_DIR = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAM = os.environ["BRASH_ICE_PROGRAM"]
SMALL = os.path.join(SOURCE_DIR, "test", "ros", "small.yaml")
SHIPPED = ("src", "include", "scripts", "launch")

# Whatever a shell makes of these would leave the file "trap" in the working directory.
TRAPS = ["$(touch trap)", "`touch trap`", "; touch trap;", "x' ; touch trap ; '", 'x" ; touch trap ; "', "| touch trap",
         "\ntouch trap\n", "--version; touch trap"]


def files_of(*patterns):
    found = []
    for pattern in patterns:
        found += glob.glob(os.path.join(SOURCE_DIR, pattern), recursive=True)
    return sorted(path for path in found if os.path.isfile(path))


def read(path):
    with open(path, encoding="utf-8") as stream:
        return stream.read()


def python_scripts():
    return [path for path in files_of("scripts/*", "test/**/*.py")
            if path.endswith(".py") or read(path).startswith("#!/usr/bin/python3")]


def shell_scripts():
    return [path for path in files_of("scripts/*") if path.endswith(".bash") or "bash" in read(path).split("\n", 1)[0]]


class Python:
    """What in a Python file could hand text to a shell or an interpreter."""

    CALLS = {"os.system", "os.popen", "os.execlp", "os.spawnlp", "commands.getoutput", "subprocess.getoutput",
             "subprocess.getstatusoutput", "eval", "exec", "compile", "pickle.load", "pickle.loads", "marshal.loads",
             "yaml.load", "yaml.unsafe_load", "yaml.full_load", "shelve.open", "numpy.load", "np.load"}
    SHELLS = {"sh", "bash", "dash", "/bin/sh", "/bin/bash"}

    def __init__(self, text):
        self.tree = ast.parse(text)

    def findings(self):
        for node in ast.walk(self.tree):
            if not isinstance(node, ast.Call):
                continue
            name = ast.unparse(node.func)
            if name in self.CALLS:
                yield node.lineno, name
            for keyword in node.keywords:
                constant = isinstance(keyword.value, ast.Constant)
                if keyword.arg == "shell" and not (constant and keyword.value.value is False):
                    yield node.lineno, f"{name}(shell=...)"
            for argument in node.args:
                if not isinstance(argument, (ast.List, ast.Tuple)) or len(argument.elts) < 3:
                    continue
                words = [part.value if isinstance(part, ast.Constant) else None for part in argument.elts]
                # A shell with a text that is written down whole, and input as its arguments, is none built from input.
                if words[0] in self.SHELLS and words[1] == "-c" and words[2] is None:
                    if not isinstance(argument.elts[2], ast.Name) or not self.is_constant(argument.elts[2].id):
                        yield node.lineno, f"{words[0]} -c"

    def is_constant(self, name):
        """Whether each assignment of a name is a text without anything put in."""
        values = [node.value for node in ast.walk(self.tree) if isinstance(node, ast.Assign)
                  and any(isinstance(target, ast.Name) and target.id == name for target in node.targets)]
        return bool(values) and all(isinstance(value, ast.Constant) for value in values)


class Sources(unittest.TestCase):
    def test_the_search_itself_finds_what_it_looks_for(self):
        for text in ("import os\nos.system(x)", "subprocess.run(x, shell=True)", "subprocess.run(x, shell=y)", "eval(x)",
                     "yaml.load(x)", "subprocess.run(['bash', '-c', f'ls {x}'])",
                     "s = 'ls ' + x\nsubprocess.run(['sh', '-c', s])"):
            self.assertTrue(list(Python(text).findings()), text)
        for text in ("subprocess.run([x, y])", "yaml.safe_load(x)", "s = 'ls $1'\nsubprocess.run(['sh', '-c', s, x])"):
            self.assertEqual(list(Python(text).findings()), [], text)

    def test_no_python_script_hands_text_to_a_shell_or_an_interpreter(self):
        scripts = [path for path in python_scripts() if path != os.path.abspath(__file__)]
        self.assertGreater(len(scripts), 15)
        found = [f"{os.path.relpath(path, SOURCE_DIR)}:{line}: {what}" for path in scripts
                 for line, what in Python(read(path)).findings()]
        self.assertEqual(found, [])

    def test_no_program_calls_a_shell(self):
        pattern = re.compile(r"\b(?:std::)?(system|popen|execl|execlp|execle|execvp|execvpe|wordexp|posix_spawnp|dlopen)\s*\(")
        sources = files_of("src/**/*.cpp", "include/**/*.h")
        self.assertGreater(len(sources), 100)
        found = []
        for path in sources:
            text = re.sub(r"//[^\n]*|/\*.*?\*/", "", read(path), flags=re.S)
            found += [f"{os.path.relpath(path, SOURCE_DIR)}: {match.group(1)}" for match in pattern.finditer(text)]
        self.assertEqual(found, [])

    def test_no_shell_script_evaluates_text(self):
        scripts = shell_scripts()
        self.assertGreaterEqual(len(scripts), 4)
        for path in scripts:
            for line in read(path).splitlines():
                code = line.split(" #")[0].strip()
                self.assertNotRegex(code, r"(^|[;&|] *)eval\b|\b(bash|sh) -c\b", f"{path}: {line}")

    def test_launch_files_run_only_programs_that_they_name(self):
        """Arguments of roslaunch come behind the program and its options; roslaunch itself splits the line and calls no
        shell. A launch-prefix is fixed."""
        launch_files = files_of("launch/*.launch")
        self.assertGreaterEqual(len(launch_files), 4)
        for path in launch_files:
            tree = xml.etree.ElementTree.parse(path)
            for node in tree.iter():
                command = node.get("command")
                if command is not None:
                    self.assertRegex(command, r"^\$\(find brash_ice_rig\)/\w+ ", path)
                for name in ("type", "pkg"):
                    if node.tag == "node":
                        self.assertNotIn("$(", node.get(name), path)
                prefix = node.get("launch-prefix", "")
                self.assertNotIn("value", prefix)
                for argument in re.findall(r"arg\('(\w+)'\)|\$\(arg (\w+)\)", prefix):
                    self.assertEqual("".join(argument), "debug", path)


def load_launch_file(name, environment):
    """Environment of each node of a launch file, as roslaunch reads it in a process of its own."""
    script = ("import json, sys, roslaunch.config, roslaunch.xmlloader\n"
              "config = roslaunch.config.ROSLaunchConfig()\n"
              "roslaunch.xmlloader.XmlLoader(resolve_anon=False).load(sys.argv[1], config, argv=[], verbose=False)\n"
              "print(json.dumps({node.name: dict(node.env_args) for node in config.nodes}))\n")
    devel = os.path.dirname(os.path.dirname(os.path.dirname(PROGRAM)))
    base = {name: value for name, value in os.environ.items() if name not in ("ROS_HOSTNAME", "ROS_IP", "ROS_MASTER_URI")}
    base.update(ROS_PACKAGE_PATH=SOURCE_DIR + ":/usr/share", CMAKE_PREFIX_PATH=devel + ":/usr")
    with tempfile.TemporaryDirectory() as home:
        outcome = subprocess.run(["/usr/bin/python3", "-c", script, os.path.join(SOURCE_DIR, "launch", name)],
                                 env={**base, "HOME": home, **environment}, capture_output=True, text=True, check=False)
    if outcome.returncode != 0:
        raise AssertionError(outcome.stderr)
    return json.loads(outcome.stdout.strip().splitlines()[-1])


@unittest.skipUnless(os.path.exists(os.path.join(os.path.dirname(PROGRAM), "rig_node")), "built without ROS")
class Launch(unittest.TestCase):
    FILES = ("pull_up.launch", "record.launch", "replay.launch", "teleop.launch")

    def test_nodes_are_for_this_computer_only_unless_the_user_says_otherwise(self):
        for name in self.FILES:
            for environment in ({}, {"ROS_MASTER_URI": "http://localhost:11999"}):
                nodes = load_launch_file(name, environment)
                self.assertTrue(nodes, name)
                for node, variables in nodes.items():
                    self.assertEqual(variables.get("ROS_HOSTNAME"), "localhost", f"{name}: {node}")

    def test_a_user_who_names_an_address_or_another_master_is_obeyed(self):
        for environment in ({"ROS_IP": "10.0.0.1"}, {"ROS_HOSTNAME": "rig"}, {"ROS_MASTER_URI": "http://rig:11311"}):
            for node, variables in load_launch_file("pull_up.launch", environment).items():
                self.assertNotIn("ROS_HOSTNAME", variables, f"{node} with {environment}")


class Names(unittest.TestCase):
    """Programs get names that a shell would run."""

    def setUp(self):
        self.directory = tempfile.TemporaryDirectory()
        self.addCleanup(self.directory.cleanup)

    def run_program(self, *command):
        environment = {**os.environ, "OMP_WAIT_POLICY": "passive", "ROS_MASTER_URI": "http://localhost:1"}
        outcome = subprocess.run(command, cwd=self.directory.name, capture_output=True, text=True, check=False,
                                 timeout=120, env=environment, stdin=subprocess.DEVNULL)
        for directory, _, files in os.walk(self.directory.name):
            self.assertNotIn("trap", files, f"{command} was run by a shell, in {directory}")
        return outcome

    def test_files_directories_keys_and_cases_are_names_only(self):
        short = ["--set", "procedure.settle_duration_s=0.1", "--set", "procedure.lift_duration_s=0.1"]
        for trap in TRAPS:
            self.run_program(PROGRAM, "check", trap)
            self.run_program(PROGRAM, "check", trap + ".bag")
            self.run_program(PROGRAM, "run", SMALL, "--set", trap)
            self.run_program(PROGRAM, "run", SMALL, "--overlay", trap)
            self.run_program(PROGRAM, "run", "--resume", trap)
        outcome = self.run_program(PROGRAM, "run", SMALL, *short, "--out", TRAPS[0], "--record", TRAPS[1])
        self.assertEqual(outcome.returncode, 0, outcome.stderr)
        self.assertTrue(os.path.exists(os.path.join(self.directory.name, TRAPS[0], "force.csv")))

    def test_a_bag_is_handed_to_its_script_by_name(self):
        for trap in TRAPS:
            if "/" in trap:
                continue
            with open(os.path.join(self.directory.name, trap), "wb") as stream:
                stream.write(b"#ROSBAG V2.0\n")
            self.assertEqual(self.run_program(PROGRAM, "check", trap).returncode, 2)

    def test_the_cases_of_a_study_are_directories_only(self):
        with open(os.path.join(self.directory.name, "study.yaml"), "w", encoding="utf-8") as stream:
            stream.write(f"title: \"$(touch trap)\"\nscenario: {SMALL}\nsettings: {{procedure.settle_duration_s: 0.1, "
                         "procedure.lift_duration_s: 0.1}\ncases: [{name: \"$(touch trap)\"}]\n")
        self.run_program(PROGRAM, "study", "study.yaml", "--out", "`touch trap`", "--no-report")

    def test_checkpoint_and_output_follow_no_planted_link(self):
        """The unfinished checkpoint has a name that can be guessed; a link there must not lead elsewhere."""
        victim = os.path.join(self.directory.name, "victim")
        with open(victim, "w", encoding="utf-8") as stream:
            stream.write("precious")
        out = os.path.join(self.directory.name, "out")
        os.makedirs(out)
        os.symlink(victim, os.path.join(out, "checkpoint.bin.partial"))
        outcome = self.run_program(PROGRAM, "run", SMALL, "--set", "procedure.lift_duration_s=0.5", "--out", "out",
                                   "--checkpoint-every", "0.2")
        self.assertEqual(outcome.returncode, 1, outcome.stderr)
        self.assertEqual(read(victim), "precious")


if __name__ == "__main__":
    unittest.main()
