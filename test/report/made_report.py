"""A made-up but consistent report.json, as `brash_ice identify` writes it: the errors are those of its curves."""

import json
import os

import numpy as np

RANKING = [  # effects, log Bayes factor, threshold, explained, d', full simulation, held-out RMSE over the baseline's
    (["drainage"], 87.4, 7.1, 0.91, 14.2, True),
    (["block_drop"], 41.0, 8.9, 0.55, 9.6, True),
    (["load_cell_drift"], 36.2, 6.0, 0.48, 9.0, True),
    (["porosity_gradient"], 22.8, 6.4, 0.30, 7.0, True),
    (["load_cell_bias"], 5.2, 6.0, 0.12, 4.0, False),
    (["rate_dependence"], 1.1, 6.0, 0.03, 2.2, False),
    (["vessel_heave"], -3.4, 7.7, 0.0, 0.6, False),
]
TIES = {"tie": ["load_cell_scale", "load_cell_bias"]}


def curves(speed_mps=0.052, effect_n=900.0, left_n=120.0, seed=1, count=180, after=True):
    """A series as of a lift: the effect is a smooth hump of which the model with the effect leaves left_n."""
    rng = np.random.default_rng(seed)
    time_s = np.round(np.arange(count) * 0.25, 6)
    hump = np.exp(-((time_s - 26.0) / 8.0)**2)
    plain = 12000.0 * (1.0 - np.exp(-time_s / 8.0)) - 2500.0 / (1.0 + np.exp(-(time_s - 28.0) / 2.0))
    clean = plain + effect_n * hump
    noise = 80.0 * rng.standard_normal(count)
    return {"clean": clean, "plain": plain, "series": {
        "time_s": time_s, "way_m": np.minimum(speed_mps * time_s, 2.08), "measured_n": clean + noise,
        "baseline_n": plain * 0.96, "refitted_n": plain + 0.25 * effect_n * hump,
        "with_effect_n": clean - left_n * hump if after else None,
        "noise_sigma_n": np.full(count, 85.0), "total_sigma_n": 85.0 + 200.0 * hump}}


def errors(series, key):
    """What report.json says about one curve of a series."""
    measured, simulated = series["measured_n"], series[key]
    if simulated is None:
        return None
    residual = simulated - measured
    last = series["time_s"] >= series["time_s"][-1] - 4.5
    rmse = float(np.sqrt(np.mean(residual**2)))
    return {"rmse_n": rmse, "nrmse_ratio": rmse / float(measured.max()),
            "peak_error_n": float(simulated.max() - measured.max()),
            "peak_time_error_s": float(series["time_s"][simulated.argmax()] - series["time_s"][measured.argmax()]),
            "residual_level_error_n": float(residual[last].mean()), "max_abs_n": float(np.abs(residual).max()),
            "ljung_box_p": 0.21 if key == "with_effect_n" else 1e-9}


def all_errors(series):
    return {"before": errors(series, "baseline_n"), "baseline_refitted": errors(series, "refitted_n"),
            "after": errors(series, "with_effect_n")}


def record(role, source="synthetic"):
    return {"path": f"records/case_1234_{role}.csv", "title": f"Pull-up test 1234, {role} record", "source": source,
            "position": "measured", "duration_s": 53.0, "peak_force_n": 12500.0, "peak_time_s": 24.0,
            "noise_sigma_n": 84.0, "findings": [
                {"severity": "limit", "code": "clock_offset", "text": "clocks of force and position: 0.03 ± 0.05 s",
                 "remedy": "Record both on one computer."}],
            "assumptions": ["rig: thickness of the rim as in the default rig"]}


def ranked(effects, evidence, threshold, explained, detectability, confirmed, rmse_n, holdout_n):
    return {"effects": effects, "name": " and ".join(effects), "log_bayes_factor": evidence, "threshold": threshold,
            "explained_ratio": explained, "chi2_per_bin": 1.05, "portmanteau_p": 0.3, "detectability": detectability,
            "confirmed": confirmed, "rmse_n": rmse_n, "error_ratio": 0.5, "holdout_rmse_n": holdout_n,
            "holdout_ratio": 0.4, "holdout_log_ratio": 12.0, "holdout_way_log_ratio": None,
            "evidence_of_both": evidence + 12.0,
            "parameters": [{"key": f"effects.{name}.amount_1", "unit": "1", "value": 0.27, "low": 0.21, "high": 0.33,
                            "prior_low": 0.0, "prior_high": 0.6} for name in effects],
            "baseline_change": [{"key": "ice.void_fraction", "unit": "1", "from": 0.58, "to": 0.601}], "note": ""}


def made_report(verdict="effect", effects=None, source="synthetic", holdout=True, **more):
    """The report as a dict ready for json.dumps. Further arguments replace its entries."""
    effects = effects if effects is not None else {"effect": ["drainage"], **TIES}.get(verdict, [])
    after = verdict == "effect"
    fit, unseen = curves(after=after)["series"], curves(0.045, 900.0, 300.0, seed=2, after=after)["series"]
    ranking = RANKING if verdict != "tie" else [
        ([name], 30.0 - place, 6.0, 0.9, 9.0 - place, True) for place, name in enumerate(effects)] + RANKING[5:]
    if verdict in ("none", "unknown", "cannot_tell"):
        ranking = [(names, -2.0 - place, threshold, 0.05, 1.0, place < 2)
                   for place, (names, _, threshold, _, _, _) in enumerate(RANKING)]
    elif verdict == "effect" and effects != ["drainage"]:
        ranking = [(effects, 90.0, 8.0, 0.95, 12.0, True)] + RANKING
    report = {
        "program": "brash_ice_rig 1.2.3", "record": record("fit", source), "further_records": [],
        "holdout_record": record("holdout", source) if holdout else None, "verdict": verdict, "effects": effects,
        "summary": ["Of 16 effects that were tried, this is what the record says."],
        "significance": {"chi2_per_bin": 3.2, "threshold_chi2_per_bin": 1.27, "portmanteau_p": 1e-12, "bins": 180,
                         "significant": verdict in ("effect", "tie", "unknown")},
        "ranking": [ranked(*entry, 150.0 + 100.0 * place, 200.0 + 100.0 * place)
                    for place, entry in enumerate(ranking)],
        "baseline": [{"key": "ice.void_fraction", "unit": "1", "prior": 0.6, "prior_sigma": 0.03, "fitted": 0.58,
                      "sigma": 0.011},
                     {"key": "ice.cohesion_pa", "unit": "Pa", "prior": 200.0, "prior_sigma": 50.0, "fitted": 231.0,
                      "sigma": 38.0},
                     {"key": "field.thickness_m", "unit": "m", "prior": 1.2, "prior_sigma": 0.02, "fitted": 1.21,
                      "sigma": 0.018}],
        **all_errors(fit), "holdout": all_errors(unseen) if holdout else None,
        "minimum_detectable": [{"name": name, "key": f"effects.{name}.amount_1", "unit": unit, "value": value,
                                "expected_detectability": 7.5}
                               for name, unit, value in (("drainage", "1", 0.1), ("load_cell_bias", "N", 136.0),
                                                         ("compliance", "m/N", 3.57e-6))],
        "confusable": [{"names": ["load_cell_scale", "load_cell_bias"], "correlation": 0.97,
                        "how_to_tell": "Known weights on the hook, or a lift without ice."}],
        "next_experiment": [{"text": "Hold the collector for 60 s after the lift: water drains smoothly and then "
                                     "stops, blocks fall in steps.", "separates": ["drainage", "block_drop"]}],
        "kappa": 1.2, "thresholds": {"log_bayes_factor": 6.0, "holdout_log_ratio": -1.0, "error_ratio": 2.0,
                                     "null_records": 60, "file": "config/identify/thresholds.yaml"},
        "noise": {"white_n": 71.0, "slow_n": 46.0}, "discrepancy": {
            "from_references": True, "amplitude_n": 210.0, "length_m": 0.21},
        "runs": {"needed": 75, "made": 31, "wall_s": 412.0}, "series": fit,
        "holdout_series": unseen if holdout else None,
        "autocorrelation": {"lag_s": np.arange(0.25, 6.1, 0.25), "before": 0.7 * np.exp(-np.arange(24) / 5.0),
                            "after": 0.05 * np.cos(np.arange(24)) if after else None, "band": 0.146},
    }
    return plain({**report, **more})


def plain(value):
    """numpy's arrays as lists, for json."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def write_made_report(directory, report):
    os.makedirs(directory, exist_ok=True)
    with open(os.path.join(directory, "report.json"), "w", encoding="utf-8") as stream:
        json.dump(report, stream)
