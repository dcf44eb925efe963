"""Compares what `brash_ice identify` said about records with the sealed truth, and writes that down as Markdown.

Knows the sealed files of test/blind and report.json; runs nothing. A report is one that identify_data has read.
"""

import math
import textwrap
from dataclasses import dataclass, field

import numpy as np

from identify_data import entry_of

CLAIMS = ("effect", "tie", "unknown")  # verdicts that say something is missing
LARGEST_SET = 3
SURE_DETECTABILITY = 8.0
MINIMUM_DETECTABILITY = 5.0  # that of the magnitudes in minimum_detectable
# Measured curves differ from sealed ones by noise; a larger difference than this many times it is another record.
LARGEST_MISMATCH = 3.0
UNKNOWN_PREFIX = "unknown:"

# What the outcome of a case means; the first two count as found.
FOUND = ("right", "in a set")
OUTCOMES = {
    "right": "the verdict is the expected one; of an effect, exactly the true one or ones are named",
    "in a set": f"a tie of at most {LARGEST_SET} names that holds the truth",
    "in a large set": "a tie that holds the truth among more names",
    "part": "of two true effects one is named",
    "too many": "the truth is named, and another effect as if it were there too",
    "wrong": "an effect, or a tie, without the truth",
    "named": "an effect or a tie where there is none to name",
    "unknown": "called unknown",
    "none": "called none",
    "cannot tell": "called cannot tell",
    "failed": "no report",
}

# Parameters of the truth that have no counterpart in the library, and why.
NOT_COMPARED = {
    "freeze_bonds": "bonds of the truth are in the joints between columns, those of the library in all of the ice",
    "load_cell_drift": "the truth creeps with the logarithm of time, the library drifts steadily",
    "pole_tilt": "the truth moves along an ellipse, the library along a straight line",
    "rate_dependence": "the truth grows with asinh of the speed, the library with a power of the strain rate",
    "refreezing": "the truth adds a strength in Pa, the library multiplies that of the ice",
    "thickness_field": "what counts is the thickness over the collector, not the deviation of the field",
    "collector_hydrodynamics": "it cannot be seen in a lift",
}


@dataclass
class Case:
    """A case of the suite, its sealed truth and its report; report is None where there is none, failure then why."""

    name: str
    expected: str
    sealed_fit: dict
    sealed_holdout: dict = None
    record_count: int = 1  # records that the fit uses
    report: dict = None
    failure: str = ""

    @property
    def truth(self):
        return [effect["name"] for effect in self.sealed_fit["effects"]]

    @property
    def known(self):
        """Whether there is an effect to be named."""
        return self.expected in ("effect", "tie")

    @property
    def verdict(self):
        return self.report["verdict"] if self.report else "failed"

    @property
    def named(self):
        return self.report["effects"] if self.report else []


@dataclass
class Null:
    """A record without an effect."""

    name: str
    kind: str
    verdict: str
    named: list
    failure: str = ""


@dataclass
class Removal:
    """Squared errors against the sealed reading, summed over one record, N²; share is what the effect took away."""

    explainable: float
    before: float
    after: float

    @property
    def reachable(self):
        """What there is to remove: no more than the effect's own, nor than what refitting left."""
        return min(self.explainable, self.before)

    @property
    def share(self):
        return (self.before - self.after) / self.reachable if self.reachable > 0.0 else math.nan


@dataclass
class Coverage:
    """A true parameter and the interval that was found for it."""

    case: str
    parameter: str
    unit: str
    truth: float
    low: float
    high: float

    @property
    def inside(self):
        return self.low <= self.truth <= self.high


def outcome(case):
    """Which of OUTCOMES the case is."""
    verdict, named = case.verdict, set(case.named)
    words = {"failed": "failed", "cannot_tell": "cannot tell", "none": "none", "unknown": "unknown"}
    if not case.known:
        if verdict == case.expected:
            return "right"
        return words.get(verdict, "named")
    if verdict in words:
        return words[verdict]
    truth = set(case.truth)
    if verdict == "tie":
        if not truth <= named:
            return "wrong"
        return "in a set" if len(named) <= LARGEST_SET else "in a large set"
    if named == truth:
        return "right"
    if named < truth:
        return "part"
    return "too many" if named > truth else "wrong"


def parameter_of(entry, name):
    """The parameter of a ranking's entry whose key ends with this name, or None."""
    return next((item for item in entry["parameters"] if item["key"].rpartition(".")[2] == name), None)


def line_fit(x, y):
    """Slope of the line through the origin that fits best."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    return float(x @ y / (x @ x))


def true_amounts(sealed):
    """{effect: (parameter of the library, value)} where truth and library have one number in common.

    Where the laws differ in form, the value is that of the library's law that comes nearest to the truth's.
    """
    amounts, clean = {}, sealed["clean"]
    load_n = np.maximum(np.array(clean["force_without_effects_n"]), 0.0)
    for effect in sealed["effects"]:
        p = effect["parameters"]
        if effect["name"] == "drainage":
            amounts["drainage"] = ("held_ratio", p["held_ratio"])
        elif effect["name"] == "load_cell_bias":
            amounts["load_cell_bias"] = ("bias_n", p["bias_n"])
        elif effect["name"] == "load_cell_lag":
            # The mean delay of two equal lags in series is their sum.
            amounts["load_cell_lag"] = ("lag_s", p["lag_s"])
        elif effect["name"] == "load_cell_scale":
            added = np.array(clean["force_n"]) - np.array(clean["force_without_effects_n"])
            amounts["load_cell_scale"] = ("error_ratio", line_fit(clean["force_without_effects_n"], added))
        elif effect["name"] == "crane_speed":
            amounts["crane_speed"] = ("loss_ratio", p["loss_ratio_at_12kn"])
        elif effect["name"] == "compliance":
            closing = p["closing_m"]
            stretch = 0.5 * closing * (np.sqrt(1.0 + 4.0 * p["softness_mpn"] * load_n / closing) - 1.0)
            amounts["compliance"] = ("compliance_mpn", line_fit(load_n, stretch))
        elif effect["name"] == "porosity_gradient":
            # V_f + (1 - V_f) g cos(pi d) over the relative depth d; the line nearest to cos(pi d) has slope -24 / pi².
            solid = 1.0 - sealed["ice"]["void_fraction"]
            amounts["porosity_gradient"] = ("contrast", -24.0 / math.pi**2 * solid * p["solid_contrast"])
        elif effect["name"] == "block_drop":
            amounts["block_drop"] = ("mass_1_kg", max(drop["mass_kg"] for drop in p["drops"]))
        elif effect["name"] == "vessel_heave":
            amounts["vessel_heave"] = ("amplitude_1_m", max(p["amplitudes_m"]))
    return amounts


def detectability(case):
    """d' of the truth: the largest that the report gives reason for; the weakest effect's if there are two.

    A program that fits too little of an effect finds it hard to detect. Where the truth has a number in common with the
    library, its size over the minimum detectable one counts too, so that such a case is not lost from the count.
    """
    if not case.report or not case.known:
        return math.nan
    amounts, found = true_amounts(case.sealed_fit), []
    for name in case.truth:
        values = []
        entry = entry_of(case.report, [name])
        if entry:
            values.append(entry["detectability"])
        for item in case.report["minimum_detectable"]:
            if item["name"] == name and name in amounts and item["key"].rpartition(".")[2] == amounts[name][0]:
                if item["value"]:
                    values.append(MINIMUM_DETECTABILITY * abs(amounts[name][1] / item["value"]))
        values = [value for value in values if math.isfinite(value)]
        found.append(max(values) if values else math.nan)
    return float(np.min(found)) if found else math.nan


def line_up(sealed, series):
    """(sealed reading, sealed reading without effects) on the report's times, each shifted to the measured curve.

    Time shift and offset are those that fit best, since the report may count time and load from another zero. Raises
    ValueError where even then the two curves are not the same record.
    """
    clean = {key: np.asarray(sealed["clean"][key], dtype=float)
             for key in ("time_s", "force_n", "force_without_effects_n")}
    time_s, measured = series["time_s"], series["measured_n"]
    if not np.isfinite(measured).any():
        raise ValueError("nothing was measured")
    kept = np.isfinite(measured)
    time_s, measured = time_s[kept], measured[kept]

    def mismatch(shift_s):
        at = time_s + shift_s
        inside = (at >= clean["time_s"][0]) & (at <= clean["time_s"][-1])
        if inside.mean() < 0.8:
            return math.inf
        return float(np.std(measured[inside] - np.interp(at[inside], clean["time_s"], clean["force_n"])))

    shift_s, reach_s = 0.0, max(clean["time_s"][-1], time_s[-1]) - min(clean["time_s"][0], time_s[0])
    for step_s in (0.25, 0.02):
        shifts = shift_s + np.arange(-reach_s, reach_s + step_s, step_s)
        shift_s, reach_s = min(shifts, key=lambda shift: (mismatch(shift), abs(shift))), step_s
    noise_n = max(float(np.nanmean(series["noise_sigma_n"])), 1.0)
    if not mismatch(shift_s) <= LARGEST_MISMATCH * noise_n:
        raise ValueError(f"measured and sealed reading differ by {mismatch(shift_s):.0f} N, noise is {noise_n:.0f} N")
    at = np.clip(series["time_s"] + shift_s, clean["time_s"][0], clean["time_s"][-1])
    reading, without = (np.interp(at, clean["time_s"], clean[key]) for key in ("force_n", "force_without_effects_n"))
    offset_n = float(np.nanmean(series["measured_n"] - reading))
    return reading + offset_n, without + offset_n


def removal(sealed, series):
    """The Removal of one record. Without a curve with the effect, nothing was removed."""
    reading, without = line_up(sealed, series)
    refitted = series["refitted_n"]
    after = refitted if series["with_effect_n"] is None else series["with_effect_n"]
    kept = np.isfinite(refitted) & np.isfinite(after)
    return Removal(*(float(np.sum((reading - curve)[kept]**2)) for curve in (without, refitted, after)))


def removals(case):
    """(Removal of the fitted record, of the held-out one); None where there is none to be had."""
    if not case.report:
        return None, None
    found = []
    for sealed, series in ((case.sealed_fit, case.report["series"]), (case.sealed_holdout,
                                                                      case.report["holdout_series"])):
        try:
            found.append(removal(sealed, series) if sealed and series else None)
        except ValueError:
            found.append(None)
    return tuple(found)


def coverage(case):
    """Coverage of each parameter that truth and library have in common, from the entry about the true effects."""
    entry = entry_of(case.report, case.truth) if case.report and case.known else None
    if not entry or not entry["confirmed"]:
        return []
    found = []

    def compare(name, value):
        item = parameter_of(entry, name)
        if item and math.isfinite(item["low"]) and math.isfinite(item["high"]):
            found.append(Coverage(case.name, name, item["unit"], float(value), item["low"], item["high"]))

    amounts = true_amounts(case.sealed_fit)
    for effect in case.sealed_fit["effects"]:
        name, p = effect["name"], effect["parameters"]
        if name == "block_drop":
            for number, mass_kg in fitted_drops(entry, p["drops"]):
                compare(f"mass_{number}_kg", mass_kg)
        elif name == "vessel_heave":
            for number, amplitude_m, period_s in fitted_lines(entry, p["amplitudes_m"], p["periods_s"]):
                compare(f"amplitude_{number}_m", amplitude_m)
                compare(f"period_{number}_s", period_s)
        elif name in amounts:
            compare(*amounts[name])
    return found


def fitted_drops(entry, drops):
    """(number of a fitted fall, true mass) of the largest fitted falls, as many as there are true ones, in their order.

    Where fewer were found, the last of them stands for all that are left: falls within a few seconds are one step.
    """
    falls = []
    for number in (1, 2, 3):
        mass, time = parameter_of(entry, f"mass_{number}_kg"), parameter_of(entry, f"time_{number}_s")
        if mass and math.isfinite(mass["value"]):
            falls.append((mass["value"], time["value"] if time else float(number), number))
    largest = sorted(falls, reverse=True)[:len(drops)]
    numbers = [number for _, _, number in sorted(largest, key=lambda fall: fall[1])]
    masses = [drop["mass_kg"] for drop in sorted(drops, key=lambda drop: drop["time_s"])]
    if numbers:
        masses[len(numbers) - 1:] = [sum(masses[len(numbers) - 1:])]
    return list(zip(numbers, masses))


def fitted_lines(entry, amplitudes_m, periods_s):
    """(number of the fitted line of swell with the nearest period, true amplitude, true period) of each true line."""
    left = {number: parameter_of(entry, f"period_{number}_s") for number in (1, 2, 3)}
    left = {number: item["value"] for number, item in left.items() if item and item["value"] > 0.0}
    found = []
    for amplitude_m, period_s in sorted(zip(amplitudes_m, periods_s), reverse=True):
        if not left:
            break
        number = min(left, key=lambda number: abs(math.log(left[number] / period_s)))
        del left[number]
        found.append((number, amplitude_m, period_s))
    return found


@dataclass
class Aim:
    """A figure beside what was aimed at. hits of total; the share has to be at least, or at most, the limit."""

    text: str
    hits: float
    total: float
    limit: float
    at_most: bool = False
    detail: str = ""
    countable: bool = True  # hits and total are numbers of cases

    @property
    def share(self):
        return self.hits / self.total if self.total > 0 else math.nan

    @property
    def reached(self):
        """None where there is nothing to judge by."""
        if not self.total > 0 or not math.isfinite(self.share):
            return None
        return self.share <= self.limit if self.at_most else self.share >= self.limit


@dataclass
class Evaluation:
    """All that the document says, from cases and nulls."""

    cases: list
    nulls: list
    outcomes: dict = field(default_factory=dict)
    detectabilities: dict = field(default_factory=dict)
    removals: dict = field(default_factory=dict)
    coverages: list = field(default_factory=list)
    aims: list = field(default_factory=list)


def evaluate(cases, nulls):
    """The Evaluation of a suite. Its cases without an effect count among the nulls too."""
    nulls = [Null(case.name, "cases without an effect", case.verdict, case.named, case.failure)
             for case in cases if not case.truth] + list(nulls)
    result = Evaluation(cases, nulls)
    for case in cases:
        result.outcomes[case.name] = outcome(case)
        result.detectabilities[case.name] = detectability(case)
        result.removals[case.name] = removals(case) if case.known else (None, None)
        result.coverages += coverage(case)
    known = [case for case in cases if case.known]
    # A case without a report has no d' and is a miss all the same.
    sure = [case for case in known if case.report is None or result.detectabilities[case.name] >= SURE_DETECTABILITY]

    def found(among):
        return sum(result.outcomes[case.name] in FOUND for case in among)

    for text, among, limit in (("one record", [case for case in sure if case.record_count == 1], 0.85),
                               ("two or more records", [case for case in sure if case.record_count > 1], 0.90)):
        result.aims.append(Aim(f"known effects at d′ ≥ {SURE_DETECTABILITY:g}, {text}: right or in a set of at most "
                               f"{LARGEST_SET}", found(among), len(among), limit))
    singletons = [case for case in known if case.verdict == "effect"]
    result.aims.append(Aim("wrong singletons: verdicts *effect* on known effects that name what is not there",
                           sum(result.outcomes[case.name] in ("wrong", "too many") for case in singletons),
                           len(singletons), 0.10, at_most=True))
    unknown = [case for case in cases if case.expected == "unknown"]
    result.aims.append(Aim("unknown effects called unknown", sum(case.verdict == "unknown" for case in unknown),
                           len(unknown), 0.80))
    judged = [null for null in nulls if null.verdict != "failed"]
    named = sum(null.verdict in ("effect", "tie") for null in judged)
    result.aims.append(Aim("false positives: records without an effect on which something is said to be missing",
                           sum(null.verdict in CLAIMS for null in judged), len(judged), 0.05, at_most=True,
                           detail=f"{named} of them name an effect, the others say unknown"))
    for place, text, limit in ((0, "fitted record", 0.70), (1, "held-out record", 0.50)):
        shares = [result.removals[case.name][place] for case in sure if result.removals[case.name][place]]
        median = float(np.median([one.share for one in shares])) if shares else math.nan
        result.aims.append(Aim(
            f"explainable squared error removed at d′ ≥ {SURE_DETECTABILITY:g}, {text}, summed over cases",
            sum(one.before - one.after for one in shares), sum(one.reachable for one in shares), limit,
            detail=f"{len(shares)} cases, their median {percent(median)}", countable=False))
    result.aims.append(Aim("95 % intervals that hold the true value", sum(one.inside for one in result.coverages),
                           len(result.coverages), 0.85))
    return result


# ------------------------------------------------------------------------------------------------------------ Markdown
def percent(share):
    return f"{100.0 * share:.0f} %".replace("-", "−") if math.isfinite(share) else "–"


def figure(value, decimals=1):
    return f"{value:.{decimals}f}".replace("-", "−") if math.isfinite(value) else "–"


def rows(*lines):
    """Lines of a table, the first its headings."""
    text = [f"| {' | '.join(str(part).replace('|', chr(92) + '|') for part in line)} |" for line in lines]
    return "\n".join([text[0], "|" + "---|" * len(lines[0]), *text[1:]])


def names(effects):
    return ", ".join(f"`{name}`" for name in effects) or "–"


def best_evidence(report, effects):
    """(log Bayes factor, rank) of the entry about these effects, or of the first that holds one of them."""
    for wanted in ([entry_of(report, effects)],
                   [entry for entry in report["ranking"] if set(entry["effects"]) & set(effects)]):
        for entry in wanted:
            if entry:
                return entry["log_bayes_factor"], report["ranking"].index(entry) + 1
    return math.nan, 0


def case_row(result, case):
    fit, holdout = result.removals[case.name]
    found = [one for one in result.coverages if one.case == case.name]
    top = case.report["ranking"][0] if case.report and case.report["ranking"] else None
    return [case.name, names(case.truth), case.expected, case.verdict.replace("_", " "), names(case.named),
            f"**{result.outcomes[case.name]}**" if result.outcomes[case.name] not in FOUND else
            result.outcomes[case.name],
            figure(top["log_bayes_factor"]) if top else "–",
            figure(best_evidence(case.report, case.truth)[0]) if case.report and case.known else "–",
            figure(result.detectabilities[case.name]), percent(top["explained_ratio"]) if top else "–",
            figure(top["holdout_ratio"], 2) if top else "–", figure(top["holdout_log_ratio"]) if top else "–",
            percent(fit.share) if fit else "–",
            percent(holdout.share) if holdout else "–",
            f"{sum(one.inside for one in found)} of {len(found)}" if found else "–"]


def why_missed(result, case):
    """One line on a case that was not found."""
    said = case.verdict.replace("_", " ") + (f" {names(case.named)}" if case.named else "")
    if not case.report:
        return f"no report: {case.failure}"
    text = f"{names(case.truth)}, expected {case.expected}; said {said}"
    if case.known:
        evidence, rank = best_evidence(case.report, case.truth)
        text += f"; the truth is at rank {rank} with a log Bayes factor of {figure(evidence)}" if rank else \
            "; the truth is not in the ranking"
        text += f", d′ {figure(result.detectabilities[case.name])}"
    else:
        significance = case.report["significance"]
        text += (f"; χ² per bin {figure(significance['chi2_per_bin'], 2)}, portmanteau p "
                 f"{significance['portmanteau_p']:.2g}")
    return text


def confusion_matrix(result):
    """Expected verdict against outcome."""
    used = [name for name in OUTCOMES if name in result.outcomes.values()]
    lines = [["expected", *used, "cases"]]
    for expected in ("none", "effect", "tie", "unknown"):
        of_kind = [case for case in result.cases if case.expected == expected]
        if of_kind:
            lines.append([expected, *(sum(result.outcomes[case.name] == name for case in of_kind) for name in used),
                          len(of_kind)])
    return rows(*lines)


def effect_matrix(result):
    """True effects against what was named."""
    said = sorted({name for case in result.cases for name in case.named})
    columns = [*said, "unknown", "none", "cannot tell", "failed"]
    lines = [["truth", *(f"`{name}`" if name in said else name for name in columns)]]
    truths = list(dict.fromkeys(tuple(case.truth) for case in result.cases))
    for truth in truths:
        cells = dict.fromkeys(columns, 0)
        for case in (case for case in result.cases if tuple(case.truth) == truth):
            for name in case.named or [case.verdict.replace("_", " ")]:
                cells[name] = cells.get(name, 0) + 1
        lines.append([" + ".join(truth) or "nothing", *(cells[name] or "" for name in columns)])
    return rows(*lines)


def null_table(result):
    lines = [["records", "number", "none", "unknown", "effect", "tie", "cannot tell", "failed", "named"]]
    for kind in list(dict.fromkeys(null.kind for null in result.nulls)):
        among = [null for null in result.nulls if null.kind == kind]
        wrong = [name for null in among for name in null.named]
        lines.append([kind, len(among), *(sum(null.verdict == verdict for null in among) for verdict in
                                          ("none", "unknown", "effect", "tie", "cannot_tell", "failed")),
                      names(dict.fromkeys(wrong))])
    return rows(*lines)


def aim_rows(result):
    lines = [["aim", "limit", "figure", "", "reached"]]
    for aim in result.aims:
        counted = f"{aim.hits:g} of {aim.total:g}" if aim.countable else ""
        detail = "; ".join(part for part in (counted, aim.detail) if part) if aim.total > 0 else "no case to judge by"
        verdict = {True: "yes", False: "**no**", None: "–"}[aim.reached]
        lines.append([aim.text, ("≤ " if aim.at_most else "≥ ") + percent(aim.limit), percent(aim.share), detail,
                      verdict])
    return rows(*lines)


def failed_nulls(result):
    failed = [null for null in result.nulls if null.verdict == "failed"]
    if not failed:
        return ""
    return f"{len(failed)} have no report and are not in the share: " + "; ".join(
        f"{null.name}: {null.failure}" for null in failed) + "."


def markdown(result, made):
    """The whole document. made: how the suite was made and run, as sentences."""
    missed = [case for case in result.cases if result.outcomes[case.name] not in FOUND]
    kinds = list(dict.fromkeys(effect for case in result.cases for effect in case.truth if effect in NOT_COMPARED))
    programs = sorted({case.report["program"] for case in result.cases if case.report})
    mixed = " **Reports of more than one version are mixed here.**" if len(programs) > 1 else ""
    used = [name for name in OUTCOMES if name in result.outcomes.values()]
    intervals = rows(["case", "parameter", "unit", "true", "95 % interval", "holds"], *(
        [one.case, f"`{one.parameter}`", one.unit, f"{one.truth:.4g}", f"{one.low:.4g} to {one.high:.4g}",
         "yes" if one.inside else "**no**"] for one in result.coverages))
    parts = [
        "# Validation of the identification",
        "Does `brash_ice identify` find what is missing when it is known to us and not to it? The records are made by "
        "another program, in another language, on another discretisation and with other laws "
        "([test/blind](../test/blind/README.md)); what is in them lies sealed, and this comparison opened the seals "
        "after the last report was written. This page is written by `scripts/validate`, misses included.",
        f"{made} Program: {', '.join(programs) or 'none'}.{mixed}",
        "## Aims", "They were set before the suite was run and are not fitted to it.", aim_rows(result),
        "**Explainable squared error.** Sealed are, for each record, the reading without noise, y, and that of the "
        "same lift without its effects, y₀. With r the refitted baseline and e the simulation with the effect, what "
        "the effect removed is Σ(y − r)² − Σ(y − e)², over the bins of the report. There to be removed is Σ(y − y₀)², "
        "but no more than Σ(y − r)², which is what refitting left. Where no effect was accepted, e = r and nothing is "
        "removed. y and y₀ are shifted in time and load to the report's measured curve, which may count both from "
        "another zero.",
        "**d′** is the detectability of the true effect in the report's ranking or, if that is larger, 5 times its "
        "true size over the report's minimum detectable one: a program that fits too little of an effect shall not "
        "make it disappear from the count. With two effects, the weaker one counts. A case without a report counts as "
        "one at d′ ≥ 8 that was missed.",
        "## Cases", rows(
            ["case", "truth", "expected", "verdict", "named", "outcome", "ln B of the first", "ln B of the truth",
             "d′", "explained", "held-out ratio", "held-out ln odds", "removed, fit", "removed, held out",
             "intervals that hold"],
            *(case_row(result, case) for case in result.cases)),
        "\n".join(f"- *{name}*: {OUTCOMES[name]}." for name in used),
        "Explained, held-out ratio and ln odds are the report's, for the first of its ranking.",
        "## Misses",
        "\n".join(f"- `{case.name}` ({result.outcomes[case.name]}): {why_missed(result, case)}." for case in missed)
        or "None.",
        "## Confusion", "Expected verdict against outcome:", confusion_matrix(result),
        "True effects against what was named; a tie counts once for each of its names:", effect_matrix(result),
        "## Records without an effect",
        null_table(result) if result.nulls else "None were run.", failed_nulls(result),
        "## Intervals",
        "The truth's laws differ from the library's, so that only some parameters can be compared: the held water, "
        "bias, delay of the load cell and the speed lost at 12 kN directly; the calibration error and the compliance "
        "as the line through the origin that fits the sealed curves best; the porosity as the straight line nearest to "
        "its cosine; masses of blocks in the order of their falls, the last that was found for all that are left; "
        "swell by nearest period. Intervals are those of the full simulation with exactly the true effects, whatever "
        "the verdict was.",
        intervals if result.coverages else "None could be compared."]
    if kinds:
        parts.append("Left out: " + "; ".join(f"`{name}`, {NOT_COMPARED[name]}" for name in kinds) + ".")
    return "\n\n".join(wrapped(part) for part in parts if part) + "\n"


def wrapped(part):
    """A paragraph in lines of at most 120 characters; tables, lists and headings as they are."""
    if part.startswith(("|", "- ", "#")):
        return part
    return textwrap.fill(part, 120, break_long_words=False, break_on_hyphens=False)
