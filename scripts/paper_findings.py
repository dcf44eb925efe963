"""What the paper states about the pull-up test and its simulations, against the figures of a study.

One Statement per claim, with a rule that is the same for every study; no rule was changed after a study had been held
against it. The figures come from results.csv, force.csv and plug.csv of the study's runs. Section and figure numbers
are the paper's. Nothing is compared with the paper's measured curve: its text gives no numbers of it.
"""

import csv
from dataclasses import dataclass
from typing import Callable, Optional

import numpy as np

from study_data import Missing, moving_mean

AGREES = "agrees"
DIFFERS = "differs"
OPEN = "cannot be checked"

REFERENCE = "B-1"  # the simulation that the paper's Fig. 15 and its summary are about
SEED_SHARE = 2.0 / 3.0  # a statement about an order holds if it holds in the mean and in this share of the seeds
FORCE_WINDOW_S = 1.0  # forces are compared as means over this, as the peak of summary.json
END_TOLERANCE_S = 0.6  # a run that ends this much before an asked time still counts: plug.csv has a row each 0.5 s
TEST_START_S = 40.0  # the simulations begin at t = 40 s of the field test (section 6)


@dataclass
class Finding:
    """One row of the table. value is the row's main figure, nan where there is none."""

    id: str
    section: str
    statement: str
    rule: str
    figure: str
    value: float
    unit: str
    verdict: str
    reason: str


@dataclass
class Result:
    """What a check found."""

    figure: str
    value: float
    unit: str
    holds: bool
    note: str = ""


@dataclass
class Statement:
    """A claim of the paper. Without a check it cannot be checked, and reason says why."""

    id: str
    section: str
    text: str
    rule: str = ""
    check: Optional[Callable] = None
    reason: str = ""


def evaluate(study):
    """One Finding per Statement, in the order of STATEMENTS."""
    findings = []
    for claim in STATEMENTS:
        verdict, figure, value, unit, reason = OPEN, "", float("nan"), "", claim.reason
        if claim.check:
            try:
                result = claim.check(study)
                verdict = AGREES if result.holds else DIFFERS
                figure, value, unit, reason = result.figure, result.value, result.unit, result.note
            except Missing as missing:
                reason = f"{missing}."
        findings.append(Finding(claim.id, claim.section, claim.text, claim.rule, figure, value, unit, verdict, reason))
    return findings


def write_csv(findings, path):
    with open(path, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["id", "section", "figure", "value", "unit", "verdict"])
        for finding in findings:
            value = "" if np.isnan(finding.value) else f"{finding.value:.6g}"
            writer.writerow([finding.id, finding.section, finding.figure, value, finding.unit, finding.verdict])


def write_markdown(findings, path):
    """The table of doc/validation.md."""
    def cell(text):
        return text.replace("|", "\\|")

    with open(path, "w", newline="\n", encoding="utf-8") as stream:
        stream.write("| section | the paper | here | verdict | rule; remark |\n|---|---|---|---|---|\n")
        for finding in findings:
            verdict = f"**{finding.verdict}**" if finding.verdict == DIFFERS else finding.verdict
            remark = "; ".join(part for part in (finding.rule, finding.reason) if part)
            stream.write(f"| {finding.section} | {cell(finding.statement)} | {cell(finding.figure) or '–'} | {verdict} | "
                         f"{cell(remark)} |\n")


# ------------------------------------------------------------------------------------------------------------- helpers


def runs_of(study, case):
    runs = study.runs_of(case) if case in [known.name for known in study.cases] else []
    if not runs:
        raise Missing(f"the study has no finished run of {case}")
    return runs


def series(study, letter):
    """The cases of one series of the paper, e.g. A-1, A-2, A-3."""
    names = [case.name for case in study.cases if case.name.startswith(f"{letter}-")]
    if not names:
        raise Missing(f"the study has no case of series {letter}")
    return names


def spread(values, form="{:.1f}", unit=""):
    """Mean and range of the values, as text."""
    values = np.asarray(values, dtype=float)
    mean, low, high = (rounded(value, form) for value in (values.mean(), values.min(), values.max()))
    text = f"{mean} {unit}" if unit else mean
    return text if low == high else f"{text} ({low} to {high})"


def rounded(value, form):
    """The value as text, without the sign of a zero."""
    text = form.format(value)
    return form.format(0.0) if float(text) == 0.0 else text


def by_seed(study, cases, figure):
    """figure(run) as an array (seeds, cases), for the seeds with which all of the cases finished."""
    runs = {case: {run.seed: run for run in runs_of(study, case)} for case in cases}
    seeds = [seed for seed in study.seeds if all(seed in runs[case] for case in cases)]
    if not seeds:
        raise Missing(f"no seed with which all of {', '.join(cases)} finished")
    return np.array([[figure(runs[case][seed]) for case in cases] for seed in seeds])


def check_order(study, cases, column):
    """Whether a force of results.csv rises from case to case."""
    values = by_seed(study, cases, lambda run: run.result(column))
    rises = np.all(np.diff(values, axis=1) > 0.0, axis=1)
    mean_rises = bool(np.all(np.diff(values.mean(axis=0)) > 0.0))
    figure = ", ".join(f"{case} {spread(1e-3 * values[:, i])}" for i, case in enumerate(cases))
    return Result(f"{figure} kN; the order holds in {rises.sum()} of {rises.size} seeds", rises.mean(), "1",
                  mean_rises and rises.mean() >= SEED_SHARE)


def ice_force(force):
    return force["ice_normal_n"] + force["ice_friction_n"]


def columns_of(run, file, names):
    table = run.force() if file == "force.csv" else run.plug()
    missing = [name for name in names if name not in table]
    if missing:
        raise Missing(f"{file} of {run.name} has no {', '.join(missing)}")
    return table


def plug_at(run, column, lift_time_s):
    """A column of plug.csv at a time after the start of the lift."""
    table = columns_of(run, "plug.csv", [column])
    time_s = run.lift_start() + lift_time_s
    if time_s > table["time_s"][-1] + END_TOLERANCE_S:
        raise Missing(f"{run.name} ends at {table['time_s'][-1]:g} s, before {time_s:g} s")
    return float(np.interp(time_s, table["time_s"], table[column]))


def mean_force(run, values=None):
    """(time after the start of the lift, 1 s mean of a force); without values, that of the load cell."""
    force = run.force()
    time_s, mean = moving_mean(force["time_s"], force["force_n"] if values is None else values, FORCE_WINDOW_S)
    return time_s - run.lift_start(), mean


def full_lift(run):
    """Raises Missing where the run is shorter than the paper's 40 s."""
    end_s = run.force()["time_s"][-1] - run.lift_start()
    if end_s < 40.0 - END_TOLERANCE_S:
        raise Missing(f"{run.name} lifts for {end_s:.1f} s only, the paper for 40 s")
    return run


def find_peaks(values, drop):
    """Indices of the peaks: before and after each the values fall by at least drop.

    The highest point of a curve that still rises at its end is a peak too.
    """
    peaks = []
    high, low, rising = 0, 0, True
    for i, value in enumerate(values):
        if rising:
            high = i if value > values[high] else high
            if values[high] - value >= drop:
                peaks.append(high)
                low, rising = i, False
        else:
            low = i if value < values[low] else low
            if value - values[low] >= drop:
                high, rising = i, True
    if rising and (not peaks or values[high] > max(values[peak] for peak in peaks)):
        peaks.append(high)
    return peaks


def two_peaks(run):
    """(time_s, force_n) of the two highest peaks of the load cell's 1 s mean, in order of time, and of the low between.

    One point only where there is one peak.
    """
    time_s, force_n = mean_force(full_lift(run))
    peaks = find_peaks(force_n, 0.05 * (force_n.max() - force_n[0]))
    highest = sorted(sorted(peaks, key=lambda i: -force_n[i])[:2])
    points = [(float(time_s[i]), float(force_n[i])) for i in highest]
    if len(highest) == 2:
        low = highest[0] + int(np.argmin(force_n[highest[0]:highest[1]]))
        points.append((float(time_s[low]), float(force_n[low])))
    return points


# -------------------------------------------------------------------------------------------------------------- checks


def check_rim_at_surface(study):
    times_s = []
    for run in runs_of(study, REFERENCE):
        force = run.force()
        rim_m = force["hoist_position_m"] + run.scenario_number("collector.rim_height_m")
        above = np.flatnonzero(rim_m >= 0.0)
        if above.size == 0 or above[0] == 0:
            raise Missing(f"the rim of {run.name} does not pass the waterline")
        times_s.append(force["time_s"][above[0]] - run.lift_start())
    return Result(f"rim at z = 0 after {spread(times_s, unit='s')}", np.mean(times_s), "s",
                  18.0 <= np.mean(times_s) <= 22.0,
                  "Follows from thickness, draft and lift speed alone; it checks the geometry, not the ice.")


def check_fast_increase(study):
    times_s = []
    for run in runs_of(study, REFERENCE):
        ice_n = ice_force(columns_of(run, "force.csv", ["ice_normal_n", "ice_friction_n"]))
        time_s, mean_n = mean_force(full_lift(run), ice_n)
        times_s.append(time_s[np.flatnonzero(mean_n >= 0.5 * mean_n.max())[0]])
    return Result(f"half of the largest ice force after {spread(times_s, unit='s')}", np.mean(times_s), "s",
                  np.mean(times_s) <= 10.0)


def check_two_peaks(study):
    texts, holds = [], []
    for run in runs_of(study, REFERENCE):
        points = two_peaks(run)
        text = ", ".join(f"{1e-3 * force_n:.1f} kN at {time_s:.1f} s" for time_s, force_n in points[:2])
        holds.append(len(points) == 3)
        texts.append(text if holds[-1] else f"only one peak, {text}")
    return Result(f"{'; '.join(texts)}; two peaks in {sum(holds)} of {len(holds)} seeds", np.mean(holds), "1",
                  np.mean(holds) >= SEED_SHARE)


def check_low_above_end(study):
    margins_n, texts = [], []
    for run in runs_of(study, REFERENCE):
        points = two_peaks(run)
        if len(points) == 3:
            margins_n.append(points[2][1] - run.result("residual_force_n"))
            texts.append(f"{1e-3 * points[2][1]:.1f} against {1e-3 * run.result('residual_force_n'):.1f} kN")
    if not margins_n:
        raise Missing(f"{REFERENCE} has one peak only in each seed, so that there is no low point between two")
    above = np.array(margins_n) > 0.0
    return Result(f"low point against residual: {'; '.join(texts)}", np.mean(margins_n), "N",
                  np.mean(margins_n) > 0.0 and above.mean() >= SEED_SHARE,
                  "" if len(texts) == len(runs_of(study, REFERENCE)) else "Seeds with two peaks only.")


def check_peak_time(study, which, expected_s):
    times_s = [points[which][0] for points in map(two_peaks, runs_of(study, REFERENCE)) if len(points) == 3]
    if not times_s:
        raise Missing(f"{REFERENCE} has one peak only in each seed")
    return Result(f"{spread(times_s, unit='s')} after the start of the lift", np.mean(times_s), "s",
                  abs(np.mean(times_s) - expected_s) <= 3.0,
                  "The section says of the field test that blocks rearranged between the peaks. Time is counted from "
                  "40 s of the test, where the simulations begin.")


def check_peak_above_residual(study):
    ratios = [run.result("peak_force_n") / run.result("residual_force_n")
              for case in study.cases for run in study.runs_of(case.name)]
    if not ratios:
        raise Missing("the study has no finished run")
    return Result(f"peak over residual {spread(ratios, '{:.2f}')}, over all runs ({len(ratios)})", np.mean(ratios), "1",
                  min(ratios) > 1.0)


def end_level(run):
    """Over the last 5 s of the lift's 40 s, in % of the mean: (rise of the fitted line, range of the 1 s mean)."""
    full_lift(run)
    force = run.force()
    lift_s = force["time_s"] - run.lift_start()
    last = (lift_s >= 35.0) & (lift_s <= 40.0 + END_TOLERANCE_S)
    time_s, force_n = lift_s[last], force["force_n"][last]
    slope = np.polyfit(time_s - time_s[0], force_n, 1)[0]
    _, mean_n = moving_mean(time_s, force_n, FORCE_WINDOW_S)
    return 100.0 * slope * 5.0 / force_n.mean(), 100.0 * np.ptp(mean_n) / force_n.mean()


def check_constant_level(study, cases=None):
    cases = cases or [case.name for case in study.cases if study.runs_of(case.name)]
    names, levels = [], []
    for case in cases:
        for run in runs_of(study, case):
            names.append(run.name)
            levels.append(end_level(run))
    if not levels:
        raise Missing("the study has no finished run")
    levels = np.array(levels)
    drift = np.abs(levels[:, 0])
    figure = (f"drift over 5 s {spread(levels[:, 0], '{:+.1f}', '%')} of the level, range of the 1 s mean "
              f"{spread(levels[:, 1], unit='%')}")
    good = (drift <= 5.0) & (levels[:, 1] <= 10.0)
    if len(cases) > 1:
        figure += f"; within the bounds in {good.sum()} of {good.size} runs, largest drift: {names[drift.argmax()]}"
    return Result(figure, drift.mean(), "%", good.mean() >= SEED_SHARE and drift.mean() <= 5.0)


COMPONENTS = ["ice_normal_n", "ice_friction_n", "plug_gravity_n", "plug_buoyancy_n", "plug_drag_n", "plug_friction_n"]
COMPONENT_NAMES = {"plug_gravity_n": "gravity", "plug_buoyancy_n": "buoyancy", "plug_drag_n": "drag",
                   "plug_friction_n": "friction and cohesion"}


def components(run, where):
    """1 s means of the ice force and the plug's components, N, at the ice force's peak or over the last 4.5 s."""
    force = columns_of(full_lift(run), "force.csv", COMPONENTS)
    time_s, ice_n = mean_force(run, ice_force(force))
    if where == "peak":
        chosen = np.array([ice_n.argmax()])
    else:
        chosen = np.flatnonzero(time_s >= time_s[-1] - 4.5 + 0.5 * FORCE_WINDOW_S)
    means = {name: mean_force(run, force[name])[1][chosen].mean() for name in COMPONENTS}
    means["ice"] = ice_n[chosen].mean()
    return means


def check_components(study):
    texts, errors = [], []
    for where, words in (("peak", "at the peak"), ("end", "at the end")):
        found = [components(run, where) for run in runs_of(study, REFERENCE)]
        parts = ", ".join(f"{word} {spread([1e-3 * one[name] for one in found])}"
                          for name, word in COMPONENT_NAMES.items())
        texts.append(f"{words}: ice {spread([1e-3 * one['ice'] for one in found])} = {parts} kN")
        for one in found:
            total = one["plug_gravity_n"] - one["plug_buoyancy_n"] + one["plug_drag_n"] + one["plug_friction_n"]
            errors.append(abs(total - one["ice"]) / abs(one["ice"]))
    return Result(f"{'; '.join(texts)}; sum off by at most {100.0 * max(errors):.2g} %", 100.0 * max(errors), "%",
                  max(errors) <= 0.01,
                  "Friction is the rest that gravity, buoyancy and drag leave of the ice force, so that the sum holds "
                  "by definition; this checks the bookkeeping.")


def check_friction_share(study):
    found = [components(run, "peak") for run in runs_of(study, REFERENCE)]
    shares = [100.0 * one["plug_friction_n"] / one["ice"] for one in found]
    return Result(f"friction and cohesion of the surrounding ice: {spread(shares, '{:.0f}', '%')} of the ice force at "
                  "its peak", np.mean(shares), "%", np.mean(shares) > 50.0,
                  "What weight, buoyancy and drag of all raised ice leave of the ice force; negative where the ice "
                  "around carries part of the raised ice.")


def check_dry_weight(study):
    found = [components(run, "end") for run in runs_of(study, REFERENCE)]
    ratios = [one["ice"] / one["plug_gravity_n"] if one["plug_gravity_n"] > 0.0 else float("inf") for one in found]
    return Result(f"ice force over the raised ice's weight {spread(ratios, '{:.2f}')} in the last 4.5 s",
                  np.mean(ratios), "1", abs(np.mean(ratios) - 1.0) <= 0.1,
                  "Raised ice: more than one spacing above its site, in the collector, heaped up on the ice around, "
                  "which carries part of it, or afloat in the hole.")


def check_series_a_below(study):
    """All residuals of series A against that of B-1, which the paper finds close to the measured one."""
    cases = series(study, "A")
    values = by_seed(study, [*cases, REFERENCE], lambda run: run.result("residual_force_n"))
    below = np.all(values[:, :-1] < values[:, -1:], axis=1)
    mean = values.mean(axis=0)
    figure = ", ".join(f"{case} {spread(1e-3 * values[:, i])}" for i, case in enumerate([*cases, REFERENCE]))
    return Result(f"{figure} kN; all below {REFERENCE} in {below.sum()} of {below.size} seeds", below.mean(), "1",
                  bool(np.all(mean[:-1] < mean[-1])) and below.mean() >= SEED_SHARE,
                  f"The measured residual has no number in the text; {REFERENCE}'s, said to be close, stands for it.")


def check_strongest(study, strongest, letter, column):
    cases = series(study, letter)
    runs_of(study, strongest)
    if len(cases) < 2:
        raise Missing(f"the study has only one case of series {letter}")
    values = by_seed(study, cases, lambda run: run.result(column))
    place = cases.index(strongest)
    wins = values.argmax(axis=1) == place
    figure = ", ".join(f"{case} {spread(1e-3 * values[:, i])}" for i, case in enumerate(cases))
    return Result(f"{figure} kN; {strongest} highest in {wins.sum()} of {wins.size} seeds", wins.mean(), "1",
                  int(values.mean(axis=0).argmax()) == place and wins.mean() >= SEED_SHARE)


def check_proportional(study):
    """The exponent n of a power law F ~ c^n, fitted to the ice force's peak of each series."""
    exponents, texts = [], []
    for letter in ("A", "B"):
        cases = [f"{letter}-{number}" for number in (2, 1, 3)]
        force_n = by_seed(study, cases, lambda run: run.result("ice_peak_force_n"))
        cohesion_pa = by_seed(study, cases, lambda run: run.scenario_number("ice.cohesion_pa"))
        fits = [np.polyfit(np.log(c), np.log(f), 1)[0] for c, f in zip(cohesion_pa, force_n)]
        exponents += fits
        ratio = force_n[:, 2].mean() / force_n[:, 0].mean()
        texts.append(f"series {letter}: exponent {spread(fits, '{:.2f}')}, {cohesion_pa[0, 2] / cohesion_pa[0, 0]:.0f} "
                     f"times the cohesion gives {ratio:.2f} times the force")
    return Result("; ".join(texts), np.mean(exponents), "1", abs(np.mean(exponents) - 1.0) <= 0.2,
                  "Peak of the ice force alone. Strict proportionality would make ice without cohesion weightless and "
                  "frictionless; that the force rises with cohesion has its own rows.")


def check_same_amount(study):
    spreads, texts = [], []
    for letter in ("A", "B"):
        cases = [f"{letter}-{number}" for number in (2, 1, 3)]
        mass_kg = by_seed(study, cases, lambda run: plug_at(run, "lifted_mass_kg", 40.0))
        mean = mass_kg.mean(axis=0)
        if mean.mean() <= 0.0:
            raise Missing(f"series {letter} raises no ice")
        spreads.append(100.0 * np.ptp(mean) / mean.mean())
        texts.append(", ".join(f"{case} {spread(1e-3 * mass_kg[:, i], '{:.2f}')}" for i, case in enumerate(cases)))
    return Result(f"raised mass at 40 s: {'; '.join(texts)} t; largest difference {max(spreads):.0f} % of the mean",
                  max(spreads), "%", max(spreads) <= 10.0)


def check_friction_angle(study, column):
    values = by_seed(study, [REFERENCE, "B-4", "B-5"], lambda run: run.result(column))
    changes = 100.0 * (values[:, 1:] / values[:, :1] - 1.0)
    mean = 100.0 * (values.mean(axis=0)[1:] / values.mean(axis=0)[0] - 1.0)
    return Result(f"against B-1: B-4 (40°) {mean[0]:+.1f} % "
                  f"({changes[:, 0].min():+.1f} to {changes[:, 0].max():+.1f}), "
                  f"B-5 (60°) {mean[1]:+.1f} % ({changes[:, 1].min():+.1f} to {changes[:, 1].max():+.1f})",
                  float(np.abs(mean).max()), "%", bool(np.all(np.abs(mean) <= 10.0)),
                  "Ice force alone, since the rig's constant weight would hide changes. B-5's cap as printed in Table "
                  "6 does not fit the other columns (D1 X0 = 1.54 instead of about 0.2): B-5 differs in more than its "
                  "angle.")


def check_friction_angle_start(study):
    cases = [REFERENCE, "B-4", "B-5"]
    by_seed(study, cases, lambda run: 0.0)

    def curve(case):
        curves = [mean_force(run, ice_force(columns_of(run, "force.csv", COMPONENTS[:2])))
                  for run in runs_of(study, case)]
        time_s = np.arange(0.5, 10.0, 0.1)
        if min(one[-1] for one, _ in curves) < time_s[-1]:
            raise Missing(f"{case} is shorter than 10 s")
        return time_s, np.mean([np.interp(time_s, *one) for one in curves], axis=0)

    peak_n = np.mean([run.result("ice_peak_force_n") for run in runs_of(study, REFERENCE)])
    time_s, reference_n = curve(REFERENCE)
    texts, largest = [], []
    for case in cases[1:]:
        difference = np.abs(curve(case)[1] - reference_n)
        largest.append(100.0 * difference.max() / peak_n)
        texts.append(f"{case} {largest[-1]:.1f} % at {time_s[difference.argmax()]:.1f} s")
    return Result(f"largest difference from B-1 in the first 10 s, in % of B-1's peak: {', '.join(texts)}",
                  min(largest), "%", min(largest) >= 5.0,
                  "Means over the seeds of the ice force's 1 s mean; before 10 s, equivalent runs differ by 1 to 2 %.")


def check_bulge(study):
    runs = runs_of(study, REFERENCE)
    heights_m = [plug_at(run, "bulge_height_m", 5.0) for run in runs]
    radii_m = [plug_at(run, "bulge_radius_m", 5.0) for run in runs]
    bound_m = 0.1 * runs[0].scenario_number("field.spacing_m")
    return Result(f"at 5 s the top layer has risen by up to {spread(heights_m, '{:.2f}', 'm')}, to a radius of "
                  f"{spread(radii_m, '{:.2f}', 'm')}", np.mean(heights_m), "m",
                  min(heights_m) > bound_m and min(radii_m) > 0.0)


def check_wide_plug(study):
    runs = runs_of(study, REFERENCE)
    waterline_m = [plug_at(run, "radius_at_waterline_m", 15.0) for run in runs]
    top_m = [plug_at(run, "radius_at_top_m", 15.0) for run in runs]
    mass_kg = [plug_at(run, "lifted_mass_kg", 15.0) for run in runs]
    radius_m = runs[0].scenario_number("collector.radius_m")
    over_kg = (np.pi * radius_m**2 * runs[0].scenario_number("field.thickness_m") *
               runs[0].scenario_number("ice.parent_density_kgpm3") *
               (1.0 - runs[0].scenario_number("ice.void_fraction")))
    widest = max(np.mean(waterline_m), np.mean(top_m))
    return Result(f"at 15 s: radius at the waterline {spread(waterline_m, '{:.2f}', 'm')}, at the top "
                  f"{spread(top_m, '{:.2f}', 'm')}, collector {radius_m:g} m; raised "
                  f"{spread([1e-3 * mass for mass in mass_kg], '{:.2f}', 't')}, which is "
                  f"{np.mean(mass_kg) / over_kg:.2f} times the ice straight above the collector", widest, "m",
                  bool(widest > radius_m), "Radii of discs with the same section, so that a ragged edge counts less.")


def check_cone(study):
    runs = runs_of(study, REFERENCE)
    waterline_m = np.array([plug_at(run, "radius_at_waterline_m", 25.0) for run in runs])
    top_m = np.array([plug_at(run, "radius_at_top_m", 25.0) for run in runs])
    wider = max(waterline_m.mean(), top_m.mean())
    if wider <= 0.0:
        raise Missing(f"{REFERENCE} has no plug at 25 s")
    shape = "narrower" if top_m.mean() < waterline_m.mean() else "wider"
    taper = (waterline_m.mean() - top_m.mean()) / wider
    return Result(f"at 25 s: radius at the top {spread(top_m, '{:.2f}', 'm')}, at the waterline "
                  f"{spread(waterline_m, '{:.2f}', 'm')}: the top is {shape}", 100.0 * taper, "%", abs(taper) >= 0.2,
                  "The text does not say which end of the cone is up. Value: taper towards the top.")


def check_cone_to_cylinder(study):
    ratios = []
    for time_s in (10.0, 20.0):
        runs = runs_of(study, REFERENCE)
        waterline_m = np.mean([plug_at(run, "radius_at_waterline_m", time_s) for run in runs])
        top_m = np.mean([plug_at(run, "radius_at_top_m", time_s) for run in runs])
        if waterline_m <= 0.0:
            raise Missing(f"{REFERENCE} has no plug at the waterline at {time_s:g} s")
        ratios.append(top_m / waterline_m)
    return Result(f"radius at the top over radius at the waterline: {ratios[0]:.2f} at 10 s, {ratios[1]:.2f} at 20 s",
                  ratios[0], "1", ratios[0] > 1.0 and abs(ratios[1] - 1.0) < abs(ratios[0] - 1.0),
                  "Stated for the field test.")


def check_narrows(study):
    runs = runs_of(study, REFERENCE)
    wide_m = [max(plug_at(run, "radius_at_waterline_m", 15.0), plug_at(run, "radius_at_top_m", 15.0)) for run in runs]
    late_m = [max(plug_at(run, "radius_at_waterline_m", 40.0), plug_at(run, "radius_at_top_m", 40.0)) for run in runs]
    if np.mean(wide_m) <= 0.0:
        raise Missing(f"{REFERENCE} has no plug at 15 s")
    change = 100.0 * (np.mean(late_m) / np.mean(wide_m) - 1.0)
    return Result(f"larger of the two radii: {spread(wide_m, '{:.2f}', 'm')} at 15 s, {spread(late_m, '{:.2f}', 'm')} "
                  "at 40 s", change, "%", bool(change <= -10.0), "Value: change of the mean.")


def check_final_shape(study):
    runs = runs_of(study, REFERENCE)
    counts = np.array([[plug_at(run, "raised_particles", time_s) for time_s in (35.0, 40.0)] for run in runs])
    radii_m = np.array([[plug_at(run, "radius_at_top_m", time_s) for time_s in (35.0, 40.0)] for run in runs])
    if counts[:, 0].min() <= 0.0:
        raise Missing(f"{REFERENCE} has no plug at 35 s")
    changes = 100.0 * (counts[:, 1] / counts[:, 0] - 1.0)
    return Result(f"raised particles from 35 to 40 s: {spread(changes, '{:+.1f}', '%')}; radius at the top "
                  f"{spread(radii_m[:, 0], '{:.2f}')} to {spread(radii_m[:, 1], '{:.2f}', 'm')}", changes.mean(), "%",
                  bool(abs(changes.mean()) <= 5.0))


def check_edge_falls(study):
    runs = runs_of(study, REFERENCE)
    counts = np.array([[plug_at(run, "raised_particles", time_s) for time_s in (25.0, 40.0)] for run in runs])
    if counts[:, 0].min() <= 0.0:
        raise Missing(f"{REFERENCE} has no plug at 25 s")
    lost = counts[:, 0] - counts[:, 1]
    share = 100.0 * lost.mean() / counts[:, 0].mean()
    return Result(f"raised particles: {spread(counts[:, 0], '{:.0f}')} at 25 s, {spread(counts[:, 1], '{:.0f}')} at "
                  f"40 s: {share:.0f} % fewer", share, "%", bool(0.0 < share <= 20.0),
                  "Counts ice that falls back below one spacing over its site, from the edge or not.")


def check_fall_begins(study):
    times_s, rim_s = [], []
    for run in runs_of(study, REFERENCE):
        table = columns_of(full_lift(run), "plug.csv", ["raised_particles"])
        count = table["raised_particles"]
        if count.max() <= 0.0:
            raise Missing(f"{run.name} raises no ice")
        # The last of equal maxima: after it, more falls than rises.
        last = count.size - 1 - int(np.argmax(count[::-1]))
        times_s.append(table["time_s"][last] - run.lift_start())
        rim_s.append(-(run.force()["hoist_position_m"][0] + run.scenario_number("collector.rim_height_m")) /
                     run.scenario_number("procedure.lift_speed_mps"))
    difference_s = np.mean(times_s) - np.mean(rim_s)
    return Result(f"most raised particles at {spread(times_s, unit='s')}; the rim leaves the water at "
                  f"{spread(rim_s, unit='s')}", np.mean(times_s), "s", bool(abs(difference_s) <= 5.0),
                  "Stated for the field test.")


def neighbours_in_hole(run, column):
    """A share of the hole at 40 s, %, and the time from which on it stays at one half or more, s, or nan.

    The first small hole may count as filled for a moment, which is not what the paper means.
    """
    table = columns_of(run, "plug.csv", [column])
    at_end = 100.0 * plug_at(run, column, 40.0)
    lift_s = table["time_s"] - run.lift_start()
    lift_s, ratio = lift_s[lift_s <= 40.0], table[column][lift_s <= 40.0]
    below = np.flatnonzero(ratio < 0.5)
    first = below[-1] + 1 if below.size else 0
    return at_end, float(lift_s[first]) if first < lift_s.size else float("nan")


def check_hole(study, column, what):
    found = np.array([neighbours_in_hole(run, column) for run in runs_of(study, REFERENCE)])
    passed = found[~np.isnan(found[:, 1]), 1]
    when = (f"above one half from {spread(passed, unit='s')} on in {passed.size} of {len(found)} seeds" if passed.size
            else "not above one half at the end")
    return Result(f"{spread(found[:, 0], '{:.0f}', '%')} of {what} at 40 s; {when}", found[:, 0].mean(), "%",
                  bool(found[:, 0].mean() >= 50.0))


def check_hole_covered(study):
    return check_hole(study, "hole_cover_ratio", "the hole's columns have ice of neighbours in them")


def check_hole_refilled(study):
    return check_hole(study, "hole_refill_ratio", "the sites that the plug left hold ice of neighbours")


def check_hole_covered_everywhere(study):
    cases = [case.name for case in study.cases if study.runs_of(case.name)]
    if not cases:
        raise Missing("the study has no finished run")
    means = {case: np.mean([neighbours_in_hole(run, "hole_cover_ratio")[0] for run in study.runs_of(case)])
             for case in cases}
    figure = ", ".join(f"{case} {value:.0f}" for case, value in means.items())
    return Result(f"% of the hole's columns with ice of neighbours at 40 s: {figure}", min(means.values()), "%",
                  bool(min(means.values()) >= 50.0))


# ---------------------------------------------------------------------------------------------------------- statements

SEED_RULE = "in the mean over the seeds and in at least two thirds of them"
NO_MEASURED_NUMBER = ("The measured curve is printed as a figure only; the text gives no number of it, and none is "
                      "made up here.")

STATEMENTS = [
    # Section 3: the field test.
    Statement("rim_at_surface", "3", "The collector needs about 20 s from the ice bottom to the water surface.",
              "within 10 %: 18 to 22 s until the rim is at z = 0", check_rim_at_surface),
    Statement("fast_increase", "3", "The force first rises fast, up to the peak.",
              "half of the largest ice force within a quarter of the lift, 10 s", check_fast_increase),
    Statement("two_peaks", "3, 7, Fig. 3", "The force has an initial peak and, later, a second one.",
              "two peaks of the 1 s mean, each set off by 5 % of the rise to the highest, in two thirds of the seeds",
              check_two_peaks),
    Statement("first_peak_time", "7", "The first peak comes at about 55 s of the test, 15 s after the lift began.",
              "within 3 s", lambda study: check_peak_time(study, 0, 55.0 - TEST_START_S)),
    Statement("second_peak_time", "3", "The second peak comes after 58 s of the test, 18 s after the lift began.",
              "within 3 s", lambda study: check_peak_time(study, 1, 58.0 - TEST_START_S)),
    Statement("low_above_end", "3", "The low point between the two peaks lies above the final level.",
              f"{SEED_RULE}", check_low_above_end),
    Statement("final_level_constant", "3, 6", "After the second peak the force declines to a constant level.",
              "over the last 5 s the fitted line changes by at most 5 % of the level and the 1 s mean stays within 10 "
              f"%, {SEED_RULE}", lambda study: check_constant_level(study, [REFERENCE])),
    Statement("dry_weight", "3", "The final level is the dry weight of the ice that hangs in the collector.",
              "ice force within 10 % of the raised ice's weight in the last 4.5 s", check_dry_weight),
    Statement("drainage", "3", "The force falls slightly as water drains and small pieces drop, before it is constant.",
              reason="The model's water leaves the voids at once, so that there is nothing to drain."),
    Statement("components", "3, Fig. 4", "The force is the sum of gravity, buoyancy and friction.",
              "gravity − buoyancy + drag + friction within 1 % of the ice force at its peak and at the end",
              check_components),
    Statement("upward_cone", "3", "The plug first widens upwards, and becomes more cylindrical as it rises.",
              "radius at the top over radius at the waterline: above 1 at 10 s, nearer to 1 at 20 s",
              check_cone_to_cylinder),
    Statement("fall_begins", "3", "Pieces at the plug's edge start to fall as soon as it comes out of the water.",
              "the number of raised particles is largest within 5 s of the rim's leaving the water", check_fall_begins),
    # Section 6: the simulations.
    Statement("order_peak", "6, Fig. 10", "The peak rises as the void fraction falls: A-1 < B-1 < C-1 < D-1.",
              SEED_RULE, lambda study: check_order(study, ["A-1", "B-1", "C-1", "D-1"], "peak_force_n")),
    Statement("order_residual", "6, Fig. 10", "The residual rises as the void fraction falls: A-1 < B-1 < C-1 < D-1.",
              SEED_RULE, lambda study: check_order(study, ["A-1", "B-1", "C-1", "D-1"], "residual_force_n")),
    Statement("friction_angle_peak", "6, Fig. 11", "The friction angle changes the peak little.",
              "peak of the ice force of B-4 and B-5 within 10 % of B-1's",
              lambda study: check_friction_angle(study, "ice_peak_force_n")),
    Statement("friction_angle_residual", "6, Fig. 11", "The friction angle changes the residual little.",
              "residual of the ice force of B-4 and B-5 within 10 % of B-1's",
              lambda study: check_friction_angle(study, "ice_residual_force_n")),
    Statement("friction_angle_start", "6, Fig. 11", "The first part of the curve differs with the friction angle.",
              "largest difference in the first 10 s at least 5 % of B-1's peak, for B-4 and for B-5",
              check_friction_angle_start),
    Statement("shear_dominates", "6, 7", "Shear strength, friction and rearrangement make most of the force.",
              "friction and cohesion above 50 % of the ice force at its peak", check_friction_share),
    Statement("cohesion_peak_a", "6, Fig. 12", "The peak rises with the cohesion at 70 % voids: A-2 < A-1 < A-3.",
              SEED_RULE, lambda study: check_order(study, ["A-2", "A-1", "A-3"], "peak_force_n")),
    Statement("cohesion_residual_a", "6, Fig. 12", "The residual rises with the cohesion: A-2 < A-1 < A-3.",
              SEED_RULE, lambda study: check_order(study, ["A-2", "A-1", "A-3"], "residual_force_n")),
    Statement("cohesion_peak_b", "6, Fig. 13", "The peak rises with the cohesion at 60 % voids: B-2 < B-1 < B-3.",
              SEED_RULE, lambda study: check_order(study, ["B-2", "B-1", "B-3"], "peak_force_n")),
    Statement("cohesion_residual_b", "6, Fig. 13", "The residual rises with the cohesion: B-2 < B-1 < B-3.",
              SEED_RULE, lambda study: check_order(study, ["B-2", "B-1", "B-3"], "residual_force_n")),
    Statement("strongest_b", "6, Fig. 13", "B-3 has the highest force of its series.",
              SEED_RULE, lambda study: check_strongest(study, "B-3", "B", "peak_force_n")),
    Statement("proportional", "6", "The force that lifts the ice is proportional to the cohesion.",
              "exponent n of F ~ c^n within 0.2 of 1", check_proportional),
    Statement("same_amount", "6", "Higher cohesion needs a higher force to lift the same amount of ice.",
              "raised mass at 40 s of A-1 to A-3, and of B-1 to B-3, within 10 % of each other", check_same_amount),
    Statement("series_a_residual", "6, Fig. 12", "All residuals of series A lie below the measured one.",
              f"below {REFERENCE}'s, {SEED_RULE}", check_series_a_below),
    Statement("peak_above_residual", "6, Fig. 14", "Each simulation has a peak above its residual.",
              "in every run", check_peak_above_residual),
    Statement("narrows", "6", "Particles fill the collector's cavity, then the plug narrows.",
              "larger of the two radii at least 10 % smaller at 40 s than at 15 s", check_narrows),
    Statement("level_in_all", "6", "All simulations reach a constant level once the collector is above the ice.",
              "drift and range as for the final level, in two thirds of all runs", check_constant_level),
    Statement("hole_covered", "6, 7", "Neighbouring particles quickly fill the hole: as seen from above.",
              "at least half of the hole's columns with ice of neighbours at 40 s", check_hole_covered),
    Statement("hole_refilled", "6, 7", "The same, by volume.",
              "at least half of the sites that the plug left hold ice of neighbours at 40 s", check_hole_refilled),
    Statement("hole_covered_in_all", "6", "The hole is filled in all simulations.",
              "at least half of the hole's columns at 40 s in the mean of each case", check_hole_covered_everywhere),
    Statement("bulge", "6, Fig. 15a", "After 5 s there is a bulge at the top of the ice.",
              "rise above a tenth of the spacing in each seed", check_bulge),
    Statement("wide_plug", "6, 7, Fig. 15b", "First the plug is wider than the collector.",
              "at 15 s the larger of the two radii exceeds the collector's", check_wide_plug),
    Statement("cone", "6, Fig. 15c", "Then the plug becomes a cone.",
              "at 25 s the radii at the top and at the waterline differ by at least 20 % of the larger", check_cone),
    Statement("edge_falls", "6, Fig. 15c, d", "A few particles at the collector's edge fall off before the end.",
              "fewer raised particles at 40 s than at 25 s, by at most 20 %", check_edge_falls),
    Statement("final_shape", "6, Fig. 15d", "At about 40 s the plug has its final shape.",
              "the number of raised particles changes by at most 5 % from 35 to 40 s", check_final_shape),
    # What only the measured curve, or the field, could tell.
    Statement("a1_peak_close", "6, Fig. 10", "A-1's peak is close to the measured one, its residual lower.",
              reason=NO_MEASURED_NUMBER),
    Statement("b1_residual_close", "6, Fig. 10", "B-1's residual is close to the measured one.",
              reason=NO_MEASURED_NUMBER),
    Statement("closest", "6, 7, Fig. 14", "B-1 and B-2 come closest in peak and residual; B-1 fits best overall.",
              reason=NO_MEASURED_NUMBER),
    Statement("peaks_lower", "6", "All simulated peaks are lower than the measured one, but B-1's is somewhat higher.",
              reason=f"The section says both, and they contradict each other. {NO_MEASURED_NUMBER}"),
    Statement("residual_too_high", "7", "The simulated residual may be too high, as large blocks cannot fall off.",
              reason=f"{NO_MEASURED_NUMBER} Blocks as such are below what a continuum shows."),
    Statement("blocks_fall", "7", "In the field two blocks of about 1 m fell off the edge after the first peak.",
              reason="The model is a continuum of equal particles without large blocks, as the section says."),
    Statement("uneven_plug", "7", "The pole's uneven motion in the horizontal makes the plug lopsided.",
              reason="Crane and pole move straight up here; the text gives no numbers of their sideways motion."),
    Statement("void_fraction_field", "5", "Void fractions of 57 to 77 % were found in similar field tests.",
              reason="Measured in the field and an input here; the simulation cannot tell the void fraction."),
    Statement("wet_friction", "2, 7", "Friction between blocks depends on freeze bonds, block shape and size.",
              reason="The model has cohesion and friction angle of the mass, and no single blocks."),
    Statement("success", "8", "The simulations capture the behaviour of brash ice with moderate success.",
              reason="A judgement, without a number to hold a figure against."),
]
