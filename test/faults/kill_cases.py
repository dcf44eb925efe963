"""kill -9 at random moments."""

import contextlib
import json
import os
import signal
import time

from campaign import SMALL, case, last_time, read_bytes, read_text, require, same_run, wait_until, write_text
from raw_ros import Master, Rig

INTERVAL_S = 0.25  # between two checkpoints, simulated

# Long enough to be killed somewhere in the middle.
LONGER = ["procedure.lift_speed_mps=0.02", "procedure.lift_duration_s=20", "load_cell.noise_n=15",
          "solver.active_set=false"]


def longer_run(context, out, *arguments):
    settings = [part for setting in LONGER for part in ("--set", setting)]
    return [context.brash_ice, "run", SMALL, *settings, "--out", out, *arguments]


def reference_run(context, *arguments):
    """The run that nobody disturbs. @return its directory and how long it took, s"""
    directory = context.path("reference")
    begin = time.monotonic()
    code, text = context.run(longer_run(context, directory, *arguments))
    require(code == 0, text)
    return directory, time.monotonic() - begin


def checkpoint_time(context, path):
    """Time of a checkpoint, which must be good, s."""
    code, text = context.run([context.brash_ice, "check", path])
    require(code == 0, f"a checkpoint under its own name is damaged: {text}")
    return float(text.split("a checkpoint at ")[1].split(" s of")[0])


def require_little_lost(reached_s, kept_s, most_s):
    """Of a run that was killed. @param reached_s  last time in its force.csv; None: resumed, it had written nothing yet"""
    lost_s = 0.0 if reached_s is None else reached_s - kept_s
    require(lost_s < most_s + 0.011, f"{lost_s:.3f} s were lost, at most {most_s} s may be")


def kill_until_done(context, out, interval_s, kills, longest_s):
    """Runs, kills, resumes, until a run gets to its end or there were enough kills; then to the end in any case.
    @return number of kills"""
    checkpoint = os.path.join(out, "checkpoint.bin")
    done = 0
    while True:
        resumes = os.path.exists(checkpoint)
        command = [context.brash_ice, "run", "--resume", checkpoint] if resumes else longer_run(context, out)
        process = context.start([*command, "--checkpoint-every", str(interval_s)])
        if done < kills:
            time.sleep(context.random.uniform(0.0, longest_s))
        if done == kills or not process.kill9():
            process.wait()
            require(process.popen.returncode == 0, process.log())
            return done
        done += 1
        reached = last_time(out)
        if os.path.exists(checkpoint):
            require_little_lost(reached, checkpoint_time(context, checkpoint), interval_s)
        else:
            require(reached is None or reached + 1.0 < interval_s + 0.011, "no checkpoint after the first interval")


def kill_runs(context, kills, interval_s):
    whole, duration_s = reference_run(context)
    done = rounds = 0
    while done < kills:
        rounds += 1
        out = context.path(f"killed_{rounds}")
        done += kill_until_done(context, out, interval_s, kills - done, 0.6 * duration_s)
        difference = same_run(whole, out)
        require(not difference, f"after kills the result is another: {difference}")
    return done, rounds


@case("kill -9 of `brash_ice run`, resumed each time", quick=True)
def case_kill_run(context):
    done, rounds = kill_runs(context, context.many(40, 4), INTERVAL_S)
    return done, (f"{rounds} runs reached their end over kills; force.csv, plug.csv and state hash are those of the "
                  "uninterrupted run"), f"at most the last autosave interval ({INTERVAL_S} s simulated)"


@case("kill -9 while a checkpoint is written (one every other sample)")
def case_kill_checkpoint_write(context):
    done, rounds = kill_runs(context, context.many(30, 3), 0.02)
    return done, f"every checkpoint.bin was whole; {rounds} runs ended with the uninterrupted result", \
        "at most two samples"


@case("damaged checkpoints: cut short, longer, a flipped bit, an unfinished .partial", quick=True)
def case_damaged_checkpoints(context):
    directory, _ = reference_run(context, "--checkpoint-every", "2")
    content = read_bytes(os.path.join(directory, "checkpoint.bin"))
    damaged = context.path("damaged.bin")
    count = context.many(200, 20)
    for k in range(count):
        kind = k % 3
        if kind == 0:
            bad = content[:context.random.randrange(len(content))]
        elif kind == 1:
            at = context.random.randrange(len(content))
            bad = content[:at] + bytes([content[at] ^ (1 << context.random.randrange(8))]) + content[at + 1:]
        else:
            bad = content + bytes(context.random.randrange(1, 4096))
        with open(damaged, "wb") as stream:
            stream.write(bad)
        for command in (["check", damaged], ["run", "--resume", damaged, "--out", context.path("never")]):
            code, text = context.run([context.brash_ice, *command])
            require(code == 2, f"exit code {code} for a damaged checkpoint: {text}")
            require("damaged.bin" in text, f"the file is not named: {text}")
            if k >= 3 and kind != 1:
                break
        require(not os.path.exists(context.path("never")), "a damaged checkpoint began a run")
    return count, "each was refused with exit code 2, naming file and reason; nothing was begun", "nothing"


def write_study(context):
    write_text(context.path("study.yaml"),
               f"title: Small\nscenario: {SMALL}\nsettings: {{procedure.lift_duration_s: 2.0, field.jitter_ratio: 0.1}}\n"
               "seeds: [1, 2]\ngrid: {ice.cohesion_pa: [100, 200, 300]}\n")


def at_work(directory):
    """Whether a program that was told this directory still runs. Runs of a study that was killed end by themselves, and
    until then the directory is not free."""
    for name in os.listdir("/proc"):
        if name.isdigit():
            with contextlib.suppress(OSError):
                if (directory + "/").encode() in read_bytes(f"/proc/{name}/cmdline"):
                    return True
    return False


def study(context, out):
    return [context.brash_ice, "study", context.path("study.yaml"), "--out", context.path(out), "--jobs", "2",
            "--no-report"]


@case("kill -9 of `brash_ice study`, or of one of its runs; the same command again")
def case_kill_study(context):
    write_study(context)
    begin = time.monotonic()
    code, text = context.run(study(context, "whole"))
    require(code == 0, text)
    duration_s = time.monotonic() - begin
    kills = parents = 0
    rounds = 0
    while kills < context.many(25, 2):
        rounds += 1
        out = f"killed_{rounds}"
        while True:
            process = context.start(study(context, out))
            time.sleep(context.random.uniform(0.0, 0.6 * duration_s))
            children = process.children()
            if children and context.random.random() < 0.3:
                os.kill(context.random.choice(children), signal.SIGKILL)
                kills += 1
                code = process.wait()
                # The killed run may just have been done.
                require(code in (0, 1), f"exit code {code}: {process.log()}")
                if code == 1:
                    require("signal 9" in process.log(), "the killed run is not named: " + process.log())
                continue
            if not process.kill9():
                require(process.popen.returncode == 0, process.log())
                break
            kills += 1
            parents += 1
            require(wait_until(lambda: not at_work(context.path(out)), 10.0), "runs outlived their study")
            if kills >= context.many(25, 2):
                code, text = context.run(study(context, out))
                require(code == 0, text)
                break
        require(read_bytes(context.path("whole", "results.csv")) == read_bytes(context.path(out, "results.csv")),
                "results.csv is another after kills")
    return kills, (f"{parents} kills of the study, {kills - parents} of a run; no run outlived its study by 10 s; results.csv "
                   "is that of the uninterrupted study"), "the runs that were at work"


def identify_record(context):
    """A record with noise, made from a small run."""
    write_text(context.path("small.yaml"), """title: Small field
field: {length_x_m: 3.6, length_y_m: 3.6, thickness_m: 0.6, jitter_ratio: 0.1, seed: 99}
collector: {radius_m: 0.9, rim_height_m: 0.2, displaced_volume_m3: 0.001, pole_radius_m: 0.02}
procedure: {settle_duration_s: 2.0, lift_speed_mps: 0.15, lift_duration_s: 8.0, hold_duration_s: 5.0}
solver: {threads: 1, active_set: false}
""")
    code, text = context.run([context.brash_ice, "run", context.path("small.yaml"), "--out", context.path("run")])
    require(code == 0, text)
    rows = [line.split(",") for line in read_text(context.path("run", "force.csv")).splitlines()[1:]]
    force = [float(row[1]) for row in rows if float(row[0]) > -0.005]
    lines = ["time_s,force_n,hoist_position_m"]
    for k in range(1050):
        time_s = k * 0.02 - 8.0
        at = min(max(round(time_s / 0.01), 0), len(force) - 1)
        lines.append(f"{k * 0.02:.2f},{force[at] + context.random.gauss(0.0, 15.0):.0f},"
                     f"{-0.74 + 0.15 * min(max(time_s, 0.0), 8.0):.4f}")
    write_text(context.path("record.csv"), "\n".join(lines) + "\n")
    write_text(context.path("record.yaml"),
               "source: synthetic\ntare_n: 0\nposition: measured\nrig: run/scenario.yaml\nice: {thickness_m: 0.6, "
               "void_fraction: 0.6 ± 0.03, cohesion_pa: 200 ± 50, friction_angle_deg: 50 ± 3}\n")


def identify(context, out):
    return [context.brash_ice, "identify", context.path("record.csv"), "--out", context.path(out), "--no-report"]


def found(context, out):
    report = json.loads(read_text(context.path(out, "report.json")))
    report.pop("runs")  # how many were made, and how long that took
    return report


@case("kill -9 of `brash_ice identify`; the same command again")
def case_kill_identify(context):
    identify_record(context)
    begin = time.monotonic()
    code, text = context.run(identify(context, "whole"), 600.0)
    require(code == 0, text)
    duration_s = time.monotonic() - begin
    kills = of_runs = rounds = 0
    wanted = context.many(15, 2)
    while kills < wanted:
        rounds += 1
        while True:
            process = context.start(identify(context, f"killed_{rounds}"))
            if kills < wanted:
                time.sleep(context.random.uniform(0.0, 0.25 * duration_s))
                children = process.children()
                if children and kills % 3 == 2:
                    with contextlib.suppress(ProcessLookupError):  # it may just have ended
                        os.kill(context.random.choice(children), signal.SIGKILL)
                        kills += 1
                        of_runs += 1
                    code = process.wait(600.0)
                    require(code in (0, 1), f"exit code {code}: {process.log()[-300:]}")
                    require(code == 0 or "signal 9" in process.log(), process.log()[-300:])
                    if code == 0:
                        break
                    require(not os.path.exists(context.path(f"killed_{rounds}", "report.json")), "a report stands")
                    continue
                if process.kill9():
                    kills += 1
                    require(not os.path.exists(context.path(f"killed_{rounds}", "report.json")),
                            "a killed identification left a report")
                    require(wait_until(lambda: not at_work(context.path(f"killed_{rounds}")), 10.0),
                            "simulations outlived their identification")
                    continue
            require(process.wait(600.0) == 0, process.log())
            break
        require(found(context, f"killed_{rounds}") == found(context, "whole"), "report.json is another after kills")
    return kills, f"{kills - of_runs} kills of the identification, {of_runs} of a simulation (exit code 1, named); " \
                  f"{rounds} ended with the report of the uninterrupted one", "the simulations that were at work"


@case("kill -9 of the node; started anew, its autosave loaded")
def case_kill_node(context):
    master = Master(context)
    master.set("/use_sim_time", True)
    whole, duration_s = reference_run(context)
    from brash_ice_rig.srv import Checkpoint
    from std_srvs.srv import Trigger
    kills = rounds = 0
    wanted = context.many(20, 2)
    while kills < wanted:
        rounds += 1
        saves = context.path(f"saves_{rounds}")
        checkpoint = os.path.join(saves, "checkpoint.bin")
        life = 0
        while True:
            life += 1
            out = context.path(f"out_{rounds}_{life}")
            rig = Rig(master, f"rig_{rounds}_{life}", start_paused="true", exit_at_end="true", real_time_factor="0.0",
                      settings=";".join(LONGER), checkpoint_dir=saves, checkpoint_every_s=str(INTERVAL_S),
                      output_dir=out).wait_until_up()
            if os.path.exists(checkpoint):
                answer = master.service(rig.name + "/load_checkpoint", Checkpoint, file="")
                require(answer.success, answer.message)
                out = os.path.join(out, "run_2")
            require(master.service(rig.name + "/resume", Trigger).success, "resume")
            if kills < wanted:
                time.sleep(context.random.uniform(0.0, 0.6 * duration_s))
                if rig.process.kill9():
                    kills += 1
                    reached = last_time(out)
                    if os.path.exists(checkpoint):
                        # The last but one may be all that is on the disk while the last is being written.
                        require_little_lost(reached, checkpoint_time(context, checkpoint), 2.0 * INTERVAL_S)
                    continue
            require(rig.process.wait(60.0) == 0, rig.process.log())
            break
        difference = same_run(whole, out)
        require(not difference, f"after kills the result is another: {difference}")
    return kills, f"{rounds} tests reached their end over kills with the result of the uninterrupted run", \
        f"at most the last autosave interval ({INTERVAL_S} s simulated), twice that if the disk lags"
