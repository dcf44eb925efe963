#!/usr/bin/python3
"""Writes records of lifts of the reduced rig whose truth is known, and the truth under seal.

  make_records.py --suite DIR [--cases NAME,...] [--purpose test|tune] [--seed N]   each case: fit, held-out, null
  make_records.py --nulls N DIR ...                                                 N no-effect lifts per procedure
  make_records.py --demo DIR                                                        the paper's own story

A record is DIR/case_NNNN_ROLE.csv with its manifest .yaml; nothing in either depends on the truth but the force. What
was done is in DIR/sealed/case_NNNN_ROLE.json, and which number is which case in DIR/sealed/index.json.
"""

import argparse
import concurrent.futures
import json
import math
import os
import sys
from dataclasses import dataclass, field

import numpy as np

import effects
from reduced_rig import SAMPLE_STEPS, TIME_STEP_S, Ice, PullUp, Rig, hoist_command

# The first seed of each purpose; a run of this program uses SEEDS_PER_RUN seeds, and --seed is below MAX_SEED.
SEED_BASE = {"tune": 0, "test": 1_000_000_000}
SEEDS_PER_RUN = 10_000
MAX_SEED = 10_000
LIFT_SPEED_MPS = 0.052
HOLDOUT_SPEED_MPS = 0.045
# What the manifest states, with its ±. The truth is drawn with half of that as standard deviation.
STATED = {"thickness_m": (1.2, 0.04), "void_fraction": (0.6, 0.06), "cohesion_pa": (200.0, 100.0),
          "friction_angle_deg": (50.0, 5.0)}
OTHER_ICE = {"thickness_m": 1.22, "void_fraction": 0.53, "cohesion_pa": 320.0, "friction_angle_deg": 45.0}
POSITION_STEP_M = 0.001
FORCE_STEP_N = 10.0


def procedure_segments(procedure, speed_mps, quiet_s, wait_s):
    """(duration_s, speed_mps) of each stretch."""
    def lift(height_m):
        return (height_m / speed_mps, speed_mps)
    return [(quiet_s, 0.0)] + {
        "lift": [lift(2.08), (5.0, 0.0)],
        "stop_and_hold": [lift(0.62), (wait_s, 0.0), lift(1.46), (5.0, 0.0)],
        "lower_lift": [lift(0.73), (3.0, 0.0), (0.26 / speed_mps, -speed_mps), (2.0, 0.0), lift(1.61), (5.0, 0.0)],
        "empty": [lift(2.08), (5.0, 0.0)]}[procedure]


@dataclass
class Case:
    """effects: (class, severity, other arguments). extra: (procedure, wait_s) of a further record of the same truth."""

    name: str
    expected: str  # verdict: none, effect, tie or unknown
    effects: tuple = ()
    procedure: str = "lift"
    wait_s: float = 12.0
    holdout_wait_s: float = 12.0
    extra: tuple = ()
    ice: dict = field(default_factory=dict)
    pink_n: float = 45.0
    clock_offset_s: float = 0.0
    position: str = "measured"
    lateral: bool = False


DROPS = (effects.BlockDrop, 1.0, {"times_s": (14.0, 16.2)})  # s after the lift began: near 55 s in the paper's time
# Lateral channels and commanded positions are spread so that neither points at an effect.
CASES = [
    Case("none_plain", "none", lateral=True),
    Case("none_other_ice", "none", ice=OTHER_ICE, position="commanded"),
    Case("none_strong_pink", "none", pink_n=180.0),
    Case("none_reversal", "none", procedure="lower_lift"),
    Case("clock_error", "none", clock_offset_s=0.5, procedure="stop_and_hold"),
    Case("drainage_strong", "effect", ((effects.Drainage, 1.0, {}),), lateral=True),
    Case("drainage_weak", "effect", ((effects.Drainage, 0.35, {}),)),
    Case("break_out", "effect", ((effects.FreezeBonds, 1.0, {}),), position="commanded"),
    Case("two_drops", "effect", (DROPS,)),
    Case("two_line_swell", "effect", ((effects.VesselHeave, 1.0, {}),), lateral=True),
    Case("speed_loss_encoder", "none", ((effects.CraneSpeed, 1.0, {}),)),
    Case("speed_loss_commanded", "effect", ((effects.CraneSpeed, 1.0, {}),), position="commanded"),
    Case("tilt_lateral", "effect", ((effects.PoleTilt, 1.0, {}),), lateral=True),
    Case("tilt_plain", "effect", ((effects.PoleTilt, 1.0, {}),)),
    Case("bias_with_empty", "effect", ((effects.LoadCellBias, 1.0, {}),), extra=("empty", 0.0)),
    Case("scale_alone", "tie", ((effects.LoadCellScale, 1.0, {}),)),
    Case("lag_stop", "effect", ((effects.LoadCellLag, 1.0, {}),), procedure="stop_and_hold"),
    Case("rate_alone", "tie", ((effects.RateDependence, 1.0, {}),)),
    Case("rate_stop", "effect", ((effects.RateDependence, 1.0, {}),), extra=("stop_and_hold", 12.0)),
    Case("refreezing_two_waits", "effect", ((effects.Refreezing, 1.0, {}),), procedure="stop_and_hold", wait_s=10.0,
         holdout_wait_s=25.0, extra=("stop_and_hold", 40.0)),
    Case("compliance", "effect", ((effects.Compliance, 1.0, {}),)),
    Case("thickness", "effect", ((effects.ThicknessField, 1.0, {}),), lateral=True),
    Case("drum_ripple", "unknown", ((effects.DrumRipple, 1.0, {}),)),
    Case("stick_slip", "unknown", ((effects.StickSlip, 1.0, {}),), position="commanded"),
    Case("rope_creep", "unknown", ((effects.RopeCreep, 1.0, {}),)),
    Case("wave_slap", "unknown", ((effects.WaveSlap, 1.0, {}),), lateral=True),
    Case("crew_stepping", "unknown", ((effects.CrewStepping, 1.0, {}),)),
    Case("hull_snag", "unknown", ((effects.HullSnag, 1.0, {}),)),
    Case("drift", "effect", ((effects.LoadCellDrift, 1.0, {}),)),
    Case("porosity", "effect", ((effects.PorosityGradient, 1.0, {}),), position="commanded"),
    Case("drop_and_bias", "effect", (DROPS, (effects.LoadCellBias, 1.0, {}))),
    Case("drainage_and_swell", "effect", ((effects.Drainage, 1.0, {}), (effects.VesselHeave, 1.0, {}))),
]
DEMO = Case("demo", "effect", ((effects.FreezeBonds, 0.8, {}), DROPS, (effects.Drainage, 0.6, {})))


@dataclass
class Job:
    """One record to be made. All chance comes from the two seeds: what a case's records share, and what they do not."""

    name: str
    title: str
    case: Case
    role: str
    procedure: str
    wait_s: float
    shared_seed: int
    own_seed: int
    speed_mps: float = LIFT_SPEED_MPS
    lift_start_s: float = float("nan")  # time of the record at which the lift begins; nan: after the quiet stretch
    with_effects: bool = True


def seeds(purpose, seed):
    """The seeds of one call, as a range. Ranges of different purposes or seeds have none in common."""
    if not 0 <= seed < MAX_SEED:
        raise ValueError(f"--seed {seed}, must lie in [0, {MAX_SEED})")
    first = SEED_BASE[purpose] + seed * SEEDS_PER_RUN
    return range(first, first + SEEDS_PER_RUN)


def true_ice(case, shared_seed, own_seed):
    """Drawn from what the manifest states; within a case, spots differ by a percent."""
    shared, own = np.random.default_rng([shared_seed, 1]), np.random.default_rng([own_seed, 1])
    values = {key: mean + 0.5 * deviation * float(np.clip(shared.standard_normal(), -1.5, 1.5))
              for key, (mean, deviation) in STATED.items()}
    values.update(case.ice)
    return Ice(**{key: value * (1.0 + 0.01 * float(own.standard_normal())) for key, value in values.items()})


def noise(count, rate_hz, white_n, pink_n, rng):
    """White noise plus noise of a power density that falls with 1/f over 0.02 Hz up; standard deviations in N."""
    frequency = np.fft.rfftfreq(count, 1.0 / rate_hz)
    spectrum = (rng.standard_normal(len(frequency)) + 1j * rng.standard_normal(len(frequency))) / np.sqrt(
        np.maximum(frequency, 0.02))
    spectrum[0] = 0.0
    pink = np.fft.irfft(spectrum, count)
    return white_n * rng.standard_normal(count) + pink_n * pink / pink.std()


def make_record(job, directory):
    """Runs the lift with and without its effects, and writes record, manifest and sealed truth."""
    case, rate_hz = job.case, 1.0 / (SAMPLE_STEPS * TIME_STEP_S)
    own = np.random.default_rng([job.own_seed, 2])
    ice, quiet_s = true_ice(case, job.shared_seed, job.own_seed), float(own.uniform(6.0, 8.0))
    active = []
    if job.with_effects:
        for index, (cls, severity, arguments) in enumerate(case.effects):
            arguments = dict(arguments)
            if "times_s" in arguments:
                arguments["times_s"] = [quiet_s + time for time in arguments["times_s"]]
            active.append(cls(severity, np.random.default_rng([job.shared_seed, 3, index]), **arguments))
    command = hoist_command(procedure_segments(job.procedure, job.speed_mps, quiet_s, job.wait_s))
    empty = job.procedure == "empty"
    model = PullUp(ice, job.own_seed, effects=active)
    truth = model.run(command, empty)
    plain = PullUp(ice, job.own_seed).run(command, empty) if active else truth

    # The cell was zeroed with the empty rig in the water; its clock may be off.
    zero_n = effects.empty_tension(model)
    clock_s = case.clock_offset_s + float(own.uniform(-0.04, 0.04))
    white_n, count = float(own.uniform(60.0, 80.0)), len(truth.time_s)
    clean_n, plain_n = (np.interp(truth.time_s - clock_s, truth.time_s, lift.tension_n) - zero_n
                        for lift in (truth, plain))
    force_n = clean_n + noise(count, rate_hz, white_n, case.pink_n, own)
    columns = {"time_s": ("%.2f", truth.time_s - truth.time_s[0])}
    if not math.isnan(job.lift_start_s):
        columns["time_s"] = ("%.2f", columns["time_s"][1] + round(job.lift_start_s - quiet_s, 2))
    columns["force_n"] = ("%.0f", np.round(force_n / FORCE_STEP_N) * FORCE_STEP_N + 0.0)
    position, speed = truth.hoist_position_m, truth.hoist_speed_mps
    if case.position == "commanded":
        speed = truth.hoist_command_mps
        position = position[0] + np.concatenate(([0.0], np.cumsum(speed[1:]))) / rate_hz
    columns["hoist_position_m"] = ("%.3f", np.round(position / POSITION_STEP_M) * POSITION_STEP_M)
    columns["hoist_speed_mps"] = ("%.3f", speed)
    if case.lateral:
        for axis, name in enumerate(("force_x_n", "force_y_n")):
            lateral_n = truth.lateral_n[:, axis] + noise(count, rate_hz, 15.0, 10.0, own)
            columns[name] = ("%.0f", np.round(lateral_n / FORCE_STEP_N) * FORCE_STEP_N + 0.0)
    path = os.path.join(directory, job.name)
    np.savetxt(f"{path}.csv", np.column_stack([values for _, values in columns.values()]),
               fmt=[form for form, _ in columns.values()], delimiter=",", header=",".join(columns), comments="")
    with open(f"{path}.yaml", "w", encoding="utf-8") as file:
        file.write(manifest(job))
    sealed = {
        "case": case.name, "role": job.role, "procedure": job.procedure, "wait_s": job.wait_s,
        "expected_verdict": case.expected if active else "none",
        "effects": [{"name": effect.name, "severity": effect.severity, "parameters": effect.parameters}
                    for effect in active],
        "ice": vars(ice), "seeds": {"shared": job.shared_seed, "own": job.own_seed}, "lift_speed_mps": job.speed_mps,
        "noise": {"white_n": white_n, "pink_n": case.pink_n}, "clock_offset_s": clock_s, "quiet_s": quiet_s,
        # At 10 Hz: the reading without noise, the same lift without the effects, and what the tension is made of.
        "clean": {key: np.round(values[::5], 2).tolist() for key, values in {
            "time_s": columns["time_s"][1], "force_n": clean_n, "force_without_effects_n": plain_n,
            **truth.components}.items()}}
    with open(os.path.join(directory, "sealed", f"{job.name}.json"), "w", encoding="utf-8") as file:
        json.dump(sealed, file)
    return job.name


def manifest(job):
    """The same text for every record but for title and kind of position."""
    rig, ice = Rig(), {key: f"{mean:g} ± {deviation:g}" for key, (mean, deviation) in STATED.items()}
    return f"""title: {job.title}
source: synthetic
tare_n: 0
position: {job.case.position}
rig: {{collector: {{shape: octagon, radius_m: {rig.radius_m:g}, rim_height_m: {rig.rim_height_m:g}, mass_kg: 200, \
displaced_volume_m3: {rig.displaced_volume_m3:g}, pole_mass_kg: 40}}, start: rim at the ice bottom}}
ice: {{{", ".join(f"{key}: {value}" for key, value in ice.items())}}}
notes: Synthetic record of a reduced model. Zeroed with the empty rig hanging in the water.
"""


def case_jobs(case, numbers, seed_range, first):
    """The records of a case, and the same without the effects under a number of their own, so that no name tells."""
    def job(number, role, shared, own, procedure=case.procedure, wait_s=case.wait_s, **more):
        return Job(f"case_{number:04d}_{role}", f"Pull-up test {number:04d}, {role} record", case, role, procedure,
                   wait_s, seed_range[first + shared], seed_range[first + own], **more)
    jobs = []
    for number, shared, with_effects in ((numbers[0], 0, True), (numbers[1], 4, False)):
        jobs += [job(number, "fit", shared, shared + 1, with_effects=with_effects),
                 job(number, "holdout", shared, shared + 2, wait_s=case.holdout_wait_s, speed_mps=HOLDOUT_SPEED_MPS,
                     with_effects=with_effects)]
        if case.extra:
            jobs.append(job(number, "extra", shared, shared + 3, *case.extra, with_effects=with_effects))
    return jobs


def suite_jobs(purpose, seed, names=()):
    """Jobs and index of the suite. A case has the same numbers and ten seeds whether or not others are made too."""
    seed_range = seeds(purpose, seed)
    numbers = np.random.default_rng([seed_range[0], 4]).permutation(9000)[:2 * len(CASES)] + 1000
    jobs, index = [], {}
    for place, case in enumerate(CASES):
        if names and case.name not in names:
            continue
        own_numbers = [int(number) for number in numbers[2 * place:2 * place + 2]]
        jobs += case_jobs(case, own_numbers, seed_range, 10 * place)
        index[case.name] = {"case": own_numbers[0], "null": own_numbers[1], "expected_verdict": case.expected}
    return jobs, index


def null_jobs(purpose, seed, count):
    """No-effect lifts, `count` per procedure, each with ice, packing and noise of its own."""
    if not 0 < count <= 1000:
        raise ValueError(f"--nulls {count}, must lie in [1, 1000]")
    seed_range, procedures = seeds(purpose, seed), ("lift", "stop_and_hold", "lower_lift")
    numbers = np.random.default_rng([seed_range[0], 5]).permutation(9000)[:3 * count] + 1000
    jobs, index = [], {procedure: [] for procedure in procedures}
    for place, number in enumerate(int(number) for number in numbers):
        procedure, base = procedures[place % 3], 1000 + 2 * place
        jobs.append(Job(f"case_{number:04d}_fit", f"Pull-up test {number:04d}, fit record",
                        Case("none", "none", procedure=procedure), "fit", procedure, 12.0, seed_range[base],
                        seed_range[base + 1]))
        index[procedure].append(number)
    return jobs, index


def demo_jobs(purpose, seed):
    """The paper's story, as record and held-out record, with the lift from 40 s of the test on."""
    seed_range = seeds(purpose, seed)
    return [Job(f"demo_{role}", f"Synthetic pull-up test after the paper's account, {role} record", DEMO, role, "lift",
                0.0, seed_range[9000], seed_range[own], speed, lift_start_s=40.0)
            for role, own, speed in (("fit", 9001, LIFT_SPEED_MPS), ("holdout", 9002, HOLDOUT_SPEED_MPS))], {}


def write(jobs, index, directory, workers):
    """Makes all records, several at a time, and the index. FileExistsError where the directory has one already."""
    os.makedirs(os.path.join(directory, "sealed"), exist_ok=True)
    with open(os.path.join(directory, "sealed", "index.json"), "x", encoding="utf-8") as file:
        json.dump(index, file, indent=1)
    with concurrent.futures.ProcessPoolExecutor(workers) as pool:
        for done in concurrent.futures.as_completed([pool.submit(make_record, job, directory) for job in jobs]):
            print(done.result(), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--suite", action="store_true", help="the case list")
    what.add_argument("--nulls", type=int, metavar="N", help="N no-effect records per procedure")
    what.add_argument("--demo", action="store_true", help="the paper's own story")
    parser.add_argument("directory", metavar="DIR")
    parser.add_argument("--cases", default="", help="only these, separated by commas: " + ", ".join(
        case.name for case in CASES))
    parser.add_argument("--purpose", choices=sorted(SEED_BASE), default="test", help="their seeds are disjoint")
    parser.add_argument("--seed", type=int, default=1, help=f"0 to {MAX_SEED - 1}")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="records made at a time")
    arguments = parser.parse_args()
    names = [name for name in arguments.cases.split(",") if name]
    unknown = sorted(set(names) - {case.name for case in CASES})
    if unknown:
        parser.error(f"--cases: no such case: {', '.join(unknown)}")
    try:
        if arguments.suite:
            jobs, index = suite_jobs(arguments.purpose, arguments.seed, names)
        elif arguments.nulls is not None:
            jobs, index = null_jobs(arguments.purpose, arguments.seed, arguments.nulls)
        else:
            jobs, index = demo_jobs(arguments.purpose, arguments.seed)
    except ValueError as error:
        parser.error(str(error))
    try:
        write(jobs, index, arguments.directory, max(arguments.jobs, 1))
    except FileExistsError as error:
        parser.error(f"{error.filename} is there already; numbers could clash, so choose another directory")
    return 0


if __name__ == "__main__":
    sys.exit(main())
