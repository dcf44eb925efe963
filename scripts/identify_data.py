"""Reads report.json, what `brash_ice identify` found, and checks that it is whole."""

import json
import math
import os

import numpy as np

VERDICTS = ("none", "effect", "tie", "unknown", "cannot_tell")

# What each effect is, for a reader who does not know its name; effects of a user's own keep their names.
EFFECT_TITLES = {
    "drainage": "water that drains out of the lifted ice",
    "freeze_bonds": "freeze bonds that break at the start (break-out)",
    "block_drop": "blocks that fall off the collector",
    "vessel_heave": "heave of the vessel under the crane",
    "crane_speed": "a hoist that slows down under load",
    "pole_tilt": "a pole that moves sideways",
    "load_cell_bias": "a load cell whose zero is off",
    "load_cell_drift": "a load cell whose zero drifts",
    "load_cell_scale": "a load cell whose calibration factor is off",
    "load_cell_lag": "a load cell that lags behind the force",
    "collector_hydrodynamics": "drag of the water on net and arms",
    "porosity_gradient": "a void fraction that changes with depth",
    "thickness_field": "ice that is thicker in some patches than in others",
    "rate_dependence": "ice that is stronger the faster it is sheared",
    "compliance": "a rope or net that stretches under load",
    "refreezing": "blocks that froze together while at rest",
}


class BadInput(Exception):
    """report.json is not what `brash_ice identify` writes; the text names the file, the entry and the rule."""


# A schema is a function (value, where it stands) that raises BadInput or returns the value as it is to be used.
def number(value, where):
    """A number; null, which stands for one that is not finite, becomes nan."""
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise BadInput(f"{where} = {shown(value)}, must be a number or null")
    return float(value)


def text(value, where):
    if not isinstance(value, str):
        raise BadInput(f"{where} = {shown(value)}, must be a text")
    return value


def boolean(value, where):
    if not isinstance(value, bool):
        raise BadInput(f"{where} = {shown(value)}, must be true or false")
    return value


def one_of(*choices):
    def check(value, where):
        if value not in choices:
            raise BadInput(f"{where} = {shown(value)}, must be one of {', '.join(choices)}")
        return value
    return check


def list_of(entry):
    def check(value, where):
        if not isinstance(value, list):
            raise BadInput(f"{where} = {shown(value)}, must be a list")
        return [entry(item, f"{where}[{place}]") for place, item in enumerate(value)]
    return check


def or_null(schema):
    def check(value, where):
        return None if value is None else schema(value, where)
    return check


def array(value, where):
    return np.array(list_of(number)(value, where))


def entries(**schemas):
    """An object with at least these entries."""
    def check(value, where):
        if not isinstance(value, dict):
            raise BadInput(f"{where or 'the file'} must be an object")
        for key in schemas:
            if key not in value:
                raise BadInput(f"{where}{'.' if where else ''}{key} is missing")
        return {key: schema(value[key], f"{where}{'.' if where else ''}{key}") for key, schema in schemas.items()}
    return check


def facts(value, where):
    """An object of numbers and texts whose keys the program chooses."""
    if not isinstance(value, dict):
        raise BadInput(f"{where} must be an object")
    for key, item in value.items():
        if item is not None and not isinstance(item, (int, float, str, bool)):
            raise BadInput(f"{where}.{key} = {shown(item)}, must be a number, a text or null")
    return dict(value)


def equally_long(schema):
    """An object of arrays of one length, which may be 0: a record that cannot tell may hold nothing to compare."""
    def check(value, where):
        arrays = schema(value, where)
        lengths = {key: len(item) for key, item in arrays.items() if isinstance(item, np.ndarray)}
        if len(set(lengths.values())) > 1:
            raise BadInput(f"{where} must hold arrays of one length, has " +
                           ", ".join(f"{key} {length}" for key, length in lengths.items()))
        return arrays
    return check


RECORD = entries(
    path=text, title=text, source=text, position=text, duration_s=number, peak_force_n=number, peak_time_s=number,
    noise_sigma_n=number, assumptions=list_of(text),
    findings=list_of(entries(severity=text, code=text, text=text, remedy=text)))
ERRORS = entries(rmse_n=number, nrmse_ratio=number, peak_error_n=number, peak_time_error_s=number,
                 residual_level_error_n=number, max_abs_n=number, ljung_box_p=number)
SERIES = equally_long(entries(time_s=array, way_m=array, measured_n=array, baseline_n=array, refitted_n=array,
                              with_effect_n=or_null(array), noise_sigma_n=array, total_sigma_n=array))
RANKED = entries(
    effects=list_of(text), name=text, log_bayes_factor=number, threshold=number, explained_ratio=number,
    chi2_per_bin=number, portmanteau_p=number, detectability=number, confirmed=boolean, rmse_n=number,
    error_ratio=number, holdout_rmse_n=number, holdout_ratio=number, holdout_log_ratio=number,
    holdout_way_log_ratio=number, evidence_of_both=number, note=text,
    parameters=list_of(entries(key=text, unit=text, value=number, low=number, high=number, prior_low=number,
                               prior_high=number)),
    baseline_change=list_of(entries(**{"key": text, "unit": text, "from": number, "to": number})))
REPORT = entries(
    program=text, record=RECORD, further_records=list_of(RECORD), holdout_record=or_null(RECORD),
    verdict=one_of(*VERDICTS), effects=list_of(text), summary=list_of(text),
    significance=entries(chi2_per_bin=number, threshold_chi2_per_bin=number, portmanteau_p=number, bins=number,
                         significant=boolean),
    ranking=list_of(RANKED),
    baseline=list_of(entries(key=text, unit=text, prior=number, prior_sigma=number, fitted=number, sigma=number)),
    before=ERRORS, baseline_refitted=ERRORS, after=or_null(ERRORS),
    holdout=or_null(entries(before=ERRORS, baseline_refitted=ERRORS, after=or_null(ERRORS))),
    minimum_detectable=list_of(entries(name=text, key=text, unit=text, value=number, expected_detectability=number)),
    confusable=list_of(entries(names=list_of(text), correlation=number, how_to_tell=text)),
    next_experiment=list_of(entries(text=text, separates=list_of(text))),
    kappa=number, thresholds=facts, noise=entries(white_n=number, slow_n=number), discrepancy=facts,
    runs=entries(needed=number, made=number, wall_s=number),
    series=SERIES, holdout_series=or_null(SERIES),
    autocorrelation=equally_long(entries(lag_s=array, before=array, after=or_null(array), band=number)))


def shown(value):
    """A value of the file, as short as it fits into a message."""
    full = json.dumps(value, ensure_ascii=False)
    return full if len(full) <= 60 else full[:57] + "..."


def read_report(directory):
    """DIR/report.json, checked, with nan where it has null for a number and arrays for the series."""
    path = os.path.join(directory, "report.json")

    def refuse(constant):
        raise BadInput(f"{path}: {constant} is no number of JSON; what is not finite must be null")

    try:
        with open(path, encoding="utf-8") as stream:
            content = json.load(stream, parse_constant=refuse)
    except ValueError as error:
        raise BadInput(f"{path}: {error}") from error
    try:
        report = REPORT(content, "")
        if report["verdict"] in ("effect", "tie") and not report["effects"]:
            raise BadInput(f"effects must not be empty with verdict {report['verdict']}")
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from error
    return report


def effect_title(name):
    """What an effect is, in words that fit into a sentence."""
    return EFFECT_TITLES.get(name, name)


def entry_of(report, effects):
    """The entry of the ranking that is about exactly these effects, or None."""
    return next((entry for entry in report["ranking"] if set(entry["effects"]) == set(effects)), None)


def named_entries(report):
    """The entries of the ranking that the verdict names, best first: one of an effect, several of a tie."""
    if report["verdict"] == "effect":
        entry = entry_of(report, report["effects"])
        return [entry] if entry else []
    if report["verdict"] == "tie":
        return [entry for entry in report["ranking"]
                if entry["effects"] and set(entry["effects"]) <= set(report["effects"])]
    return []
