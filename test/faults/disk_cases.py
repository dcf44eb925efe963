"""Disks that are full, and disks that cannot be written."""

import os
import subprocess

from campaign import SMALL, NotTried, case, read_bytes, require, same_run
from kill_cases import checkpoint_time, found, identify, identify_record, longer_run, reference_run, study, write_study
from raw_ros import Master, Rig

FULL = "No space left on device"


def enlarge(path):
    subprocess.run(["mount", "-o", "remount,size=200m", path], check=True)


@case("disk full during `brash_ice run` with autosave; more room, resumed", quick=True)
def case_disk_full_run(context):
    whole, _ = reference_run(context)
    sizes = [60_000, 300_000, 600_000, 900_000, 1_000_000, 1_100_000]
    sizes = context.many(sizes, sizes[1::4])
    resumed = 0
    for size in sizes:
        disk = context.mount_tmpfs(f"disk_{size}", size)
        out = os.path.join(disk, "run")
        code, text = context.run(longer_run(context, out, "--checkpoint-every", "0.5"))
        require(code == 1, f"exit code {code} on a full disk of {size} bytes: {text[-300:]}")
        require(FULL in text and disk in text, f"neither file nor reason is named: {text[-300:]}")
        require(not os.path.exists(os.path.join(out, "summary.json")), "a summary stands for a run that failed")
        checkpoint = os.path.join(out, "checkpoint.bin")
        enlarge(disk)
        command = longer_run(context, out)
        if os.path.exists(checkpoint):
            checkpoint_time(context, checkpoint)
            command = [context.brash_ice, "run", "--resume", checkpoint]
            resumed += 1
        code, text = context.run(command)
        require(code == 0, text)
        difference = same_run(whole, out)
        require(not difference, difference)
    return len(sizes), (f"exit code 1 with file and reason, no summary; {resumed} had a checkpoint, which was whole; the "
                        "resumed result is the uninterrupted one"), "at most the last autosave interval"


@case("disk full during `brash_ice study`; more room, the same command")
def case_disk_full_study(context):
    write_study(context)
    code, text = context.run(study(context, "whole"))
    require(code == 0, text)
    sizes = [20_000, 200_000, 500_000]
    for size in sizes:
        disk = context.mount_tmpfs(f"disk_{size}", size)
        out = os.path.join(disk, "out")
        code, text = context.run(study(context, out))
        require(code == 1, f"exit code {code}: {text[-300:]}")
        require(FULL in text, f"the reason is not named: {text[-300:]}")
        enlarge(disk)
        code, text = context.run(study(context, out))
        require(code == 0, text)
        require(read_bytes(context.path("whole", "results.csv")) == read_bytes(os.path.join(out, "results.csv")),
                "results.csv is another")
    return len(sizes), "exit code 1 with the reason; results.csv is then that of the undisturbed study", \
        "runs that could not be written"


@case("disk full during `brash_ice identify`; more room, the same command")
def case_disk_full_identify(context):
    identify_record(context)
    code, text = context.run(identify(context, "whole"), 600.0)
    require(code == 0, text)
    sizes = [100_000, 3_000_000]
    for size in sizes:
        disk = context.mount_tmpfs(f"disk_{size}", size)
        out = os.path.join(disk, "out")
        code, text = context.run(identify(context, out), 600.0)
        require(code == 1, f"exit code {code}: {text[-300:]}")
        require(FULL in text, f"the reason is not named: {text[-300:]}")
        require(not os.path.exists(os.path.join(out, "report.json")), "a report stands")
        enlarge(disk)
        code, text = context.run(identify(context, out), 600.0)
        require(code == 0, text)
        require(found(context, out) == found(context, "whole"), "report.json is another")
    return len(sizes), "exit code 1 with the reason, no report; then the report of the undisturbed identification", \
        "simulations that could not be written"


@case("disk full under the running node", quick=True)
def case_disk_full_node(context):
    master = Master(context)
    master.set("/use_sim_time", True)
    disk = context.mount_tmpfs("disk", 60_000)
    rig = Rig(master, output_dir=os.path.join(disk, "out"), checkpoint_dir=os.path.join(disk, "saves"),
              checkpoint_every_s="0.5", real_time_factor="2.0").wait_until_up()
    from brash_ice_rig.msg import SimStatus
    status = master.subscribe("/sim/status", SimStatus)
    status.wait_for(lambda message: message.time_s > 3.0, 30.0)
    log = rig.process.log()
    require(FULL in log and "not recorded any further" in log, f"the node does not say so: {log[-400:]}")
    require("goes on without this checkpoint" in log, f"nothing is said of the checkpoint: {log[-400:]}")
    code = rig.stop()
    require(code == 1, f"exit code {code} after files were lost")
    return 1, "the rig goes on and says what is not recorded; exit code 1", "the rows after the disk was full"


@case("read-only directory for the results", quick=True)
def case_read_only(context):
    if os.geteuid() != 0:
        raise NotTried("needs root to mount")
    directory = context.path("read_only")
    os.makedirs(directory)
    write_study(context)
    identify_record(context)
    context.mount_read_only(directory)
    commands = {"run": [context.brash_ice, "run", SMALL, "--out", os.path.join(directory, "run")],
                "run in it": [context.brash_ice, "run", SMALL, "--out", directory],
                "study": study(context, os.path.join(directory, "study")),
                "identify": identify(context, os.path.join(directory, "identify")),
                "replay": [context.brash_ice, "replay", context.path("record.csv"), "--out",
                           os.path.join(directory, "replay")]}
    for name, command in commands.items():
        code, text = context.run(command)
        require(code in (1, 2), f"{name}: exit code {code}: {text[-300:]}")
        require("Read-only file system" in text and directory in text, f"{name}: reason not named: {text[-300:]}")
    try:
        master = Master(context)
    except NotTried:
        return len(commands), "each command ends at once with path and reason", "nothing"
    rig = Rig(master, output_dir=os.path.join(directory, "node"))
    code = rig.process.wait(20.0)
    require(code == 2 and "Read-only file system" in rig.process.log(), rig.process.log()[-300:])
    return len(commands) + 1, "each command and the node end at once with path and reason", "nothing"
