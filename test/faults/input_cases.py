"""Inputs that ask for too much."""

import os
import resource
import time

from campaign import ROOT, SMALL, NotTried, case, require, write_text
from raw_ros import Master, Rig

SMALL_MACHINE_BYTES = 2 << 30


def measured_run(context, command, address_space_bytes=None):
    """@return exit code, text, seconds, peak resident memory in bytes"""
    def limit():
        if address_space_bytes is not None:
            resource.setrlimit(resource.RLIMIT_AS, (address_space_bytes, address_space_bytes))
    begin = time.monotonic()
    process = context.start(command, "measured.txt", preexec_fn=limit)
    _, status, usage = os.wait4(process.pid, 0)
    process.popen.returncode = os.waitstatus_to_exitcode(status)
    return process.popen.returncode, process.log(), time.monotonic() - begin, usage.ru_maxrss * 1024


@case("a scenario of 10 million particles on a machine with 2 GB (by address space limit)", quick=True)
def case_ten_million(context):
    settings = ["field.length_x_m=750", "field.length_y_m=300"]  # 2500 x 1000 x 4
    write_text(context.path("ten_million.yaml"), f"title: Too many\nscenario: {SMALL}\ncases: [{{name: a}}]\nsettings: {{"
               + ", ".join(setting.replace("=", ": ") for setting in settings) + "}\n")
    arguments = [part for setting in settings for part in ("--set", setting)]
    commands = {"run": ["run", SMALL, "--out", context.path("out"), *arguments],
                "study": ["study", context.path("ten_million.yaml"), "--out", context.path("study"), "--no-report"]}
    peak = 0
    text = ""
    for name, command in commands.items():
        code, text, seconds, bytes_used = measured_run(context, [context.brash_ice, *command], SMALL_MACHINE_BYTES)
        require(code == 2, f"{name}: exit code {code}: {text[-300:]}")
        require("makes 10 million particles, which need about" in text and "field.spacing_m" in text,
                f"{name}: the estimate is not named: {text}")
        require(seconds < 10.0 and bytes_used < 200e6, f"{name}: {seconds:.1f} s and {bytes_used / 1e6:.0f} MB")
        peak = max(peak, bytes_used)
    require(not os.path.exists(context.path("out")), "a refused scenario left a directory")
    return len(commands), f"refused with the estimate (\"{text.strip().split(': ', 1)[-1][:150]}\"); " \
                          f"peak memory {peak / 1e6:.0f} MB", "nothing"


@case("the estimate of memory against what a run takes")
def case_memory_estimate(context):
    # 144,000 particles; the collector stays small.
    settings = ["field.length_x_m=57.0", "field.length_y_m=57.0", "procedure.settle_duration_s=0.05",
                "procedure.lift_duration_s=0.05", "solver.active_set=false"]
    command = [context.brash_ice, "run", SMALL, "--out", context.path("out")]
    code, text, _, small = measured_run(context, [*command, "--set", "procedure.lift_duration_s=0.05"])
    require(code == 0, text)
    code, text, _, large = measured_run(context, command + [part for s in settings for part in ("--set", s)])
    require(code == 0, text)
    per_particle = (large - small) / (190 * 190 * 4 - 1024)
    estimate = 1000.0 + 30.0 * 4.0 / 3.0 * 3.14159265 * 2.8**3
    require(per_particle < estimate, f"a particle takes {per_particle:.0f} bytes, estimated {estimate:.0f}")
    return 1, f"{per_particle:.0f} bytes per particle, the estimate is {estimate:.0f}", "nothing"


def refused(context, name, command, words):
    code, text, seconds, _ = measured_run(context, command)
    require(code in (1, 2), f"{name}: exit code {code}: {text[-300:]}")
    require(any(word in text for word in words), f"{name}: reason not named: {text[-300:]}")
    require(len(text) < 20000, f"{name}: a message of {len(text)} characters")
    require(seconds < 10.0, f"{name}: took {seconds:.1f} s")


@case("overlong names: files, directories, keys, values, nodes, namespaces, checkpoints", quick=True)
def case_overlong_names(context):
    name, path = "n" * 300, "/".join(["d" * 200] * 30)
    yaml = context.path("long.yaml")
    write_text(yaml, "title: " + "t" * 20_000_000 + "\n")
    commands = {"output name": (["run", SMALL, "--out", context.path(name)], ["File name too long"]),
                "output path": (["run", SMALL, "--out", context.path(path)], ["File name too long"]),
                "scenario": (["run", name + ".yaml"], ["File name too long", "cannot be read"]),
                "overlay": (["run", SMALL, "--overlay", path], ["File name too long", "cannot be read"]),
                "key": (["run", SMALL, "--set", "k" * 100_000 + "=1"], ["unknown key", "must"]),
                "value": (["run", SMALL, "--set", "field.spacing_m=" + "9" * 100_000], ["must"]),
                "motion file": (["run", SMALL, "--set", "procedure.motion_file=" + path], ["cannot be read", "long"]),
                "file of 20 MB": (["check", yaml], ["at most", "larger", "too"]),
                "record": (["check", path + ".csv"], ["cannot be read", "File name too long"]),
                "resume": (["run", "--resume", path], ["File name too long", "cannot be read"])}
    for what, (command, words) in commands.items():
        refused(context, what, [context.brash_ice, *command], words)
    tried = len(commands)
    try:
        master = Master(context)
    except Exception:  # noqa: BLE001  # without ROS the rest cannot be tried
        return tried, "each refused with a reason", "nothing"
    from brash_ice_rig.srv import Checkpoint, LoadScenario
    master.set("/use_sim_time", True)
    rig = Rig(master, "r" * 400, start_paused="true", checkpoint_dir=context.path("saves"),
              scenario_dir=os.path.dirname(SMALL), frame_prefix="f" * 5000 + "/").wait_until_up()
    for service in ("/save_checkpoint", "/load_checkpoint"):
        answer = master.service(rig.name + service, Checkpoint, file="c" * 1_000_000)
        require(not answer.success and "plain name" in answer.message, answer.message[-200:])
        require(len(answer.message) < 2000, f"an answer of {len(answer.message)} characters")
    for fields in ({"scenario": path}, {"overlays": path}, {"settings": "k" * 1_000_000 + "=1"}):
        answer = master.service(rig.name + "/load_scenario", LoadScenario,
                                **{"scenario": "", "overlays": "", "settings": "", **fields})
        require(not answer.success and answer.message, f"{list(fields)}: loaded")
    require(rig.process.alive(), "the node ended")
    require(rig.stop() == 0, rig.process.log()[-300:])
    return tried + 6, "each refused with a reason; a node and a frame with long names work", "nothing"


@case("random legal scenarios: corners of ranges, values by orders of magnitude, effects on")
def case_random_scenarios(context):
    program = os.path.join(ROOT, "build", "simulation_test")
    if not os.path.exists(program):
        raise NotTried("simulation_test is not built")
    count = context.many(400, 40)
    code, text = context.run([program, "--gtest_filter=ExtremeScenarios.*"], 1200.0, env=context.environment(
        BRASH_ICE_RANDOM_SCENARIOS=str(count), BRASH_ICE_RANDOM_SEED=str(context.random.randrange(1, 10**6))))
    require(code == 0, text[-600:])
    told = [line for line in text.splitlines() if line.startswith(("corners:", "random scenarios:"))]
    return count, "no NaN, no crash; " + "; ".join(told), "nothing"
