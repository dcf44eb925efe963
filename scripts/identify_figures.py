"""Draws the figures of an identification's report as SVG."""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from report_page import COLOURS, STYLE, WIDTH_IN, plt, to_svg

DARK, RED, TEAL, _, YELLOW = COLOURS
GREY = "#8a8a8a"
WAY_COLOUR = "#2f7fb8"
NOISE_FILL, TOTAL_FILL, PRIOR_FILL = "#c9d3e0", "#eef1f5", "#d5d5d5"
# Half the width of a 95 % interval of a normal distribution, in standard deviations.
NORMAL_95 = 1.96
# Above this the axis of the evidence goes over to a logarithm, or one strong effect would hide all others.
LINEAR_EVIDENCE = 60.0
MEASURED = {"color": DARK, "linewidth": 2.4, "alpha": 0.85}
BASELINE = {"color": GREY, "linewidth": 1.3, "linestyle": (0, (2, 1.5))}
REFITTED = {"color": RED, "linewidth": 1.5, "linestyle": (0, (6, 2))}
WITH_EFFECT = {"color": TEAL, "linewidth": 1.8}
WAY = {"color": WAY_COLOUR, "linewidth": 1.0, "linestyle": (0, (1, 2))}


def draw_series(series, name, description):
    """Force over time as measured and as simulated, and the way of the hoist on an axis of its own."""
    if not len(series["time_s"]):
        return None
    with plt.rc_context(STYLE):
        picture, axes = plt.subplots(figsize=(WIDTH_IN, 4.8))
        time_s = series["time_s"]
        way = axes.twinx()
        way.plot(time_s, series["way_m"], **WAY)
        way.set_ylabel("way of the hoist (m)", color=WAY_COLOUR)
        way.tick_params(axis="y", colors=WAY_COLOUR)
        way.spines["right"].set_visible(True)
        way.spines["right"].set_color(WAY_COLOUR)
        way.grid(False)
        # The forces lie over the way.
        axes.set_zorder(way.get_zorder() + 1)
        axes.patch.set_visible(False)
        handles = []
        for key, label, style in (("measured_n", "measured", MEASURED), ("baseline_n", "baseline as given", BASELINE),
                                  ("refitted_n", "baseline refitted", REFITTED),
                                  ("with_effect_n", "with the effect", WITH_EFFECT)):
            if series[key] is not None:
                handles += axes.plot(time_s, 1e-3 * series[key], label=label, **style)
        handles.append(Line2D([], [], label="way of the hoist (right axis)", **WAY))
        axes.set_xlabel("time (s)")
        axes.set_ylabel("load cell (kN)")
        axes.set_xlim(time_s[0], time_s[-1])
        legend_below(picture, handles)
        return to_svg(picture, name, description)


def draw_residuals(series, name, after_label):
    """Measured less simulated, before and after, in the bands that noise and model error explain."""
    if not len(series["time_s"]):
        return None
    with plt.rc_context(STYLE):
        panels = [("refitted_n", "baseline refitted", REFITTED["color"])]
        if series["with_effect_n"] is not None:
            panels.append(("with_effect_n", after_label, WITH_EFFECT["color"]))
        picture, grid = plt.subplots(len(panels), 1, figsize=(WIDTH_IN, 0.7 + 2.6 * len(panels)), sharex=True,
                                     sharey=True, squeeze=False)
        time_s = series["time_s"]
        for axes, (key, label, colour) in zip(grid.flat, panels):
            for sigma, fill in (("total_sigma_n", TOTAL_FILL), ("noise_sigma_n", NOISE_FILL)):
                half_kn = 1e-3 * NORMAL_95 * series[sigma]
                axes.fill_between(time_s, -half_kn, half_kn, color=fill, linewidth=0.0)
            if key == "refitted_n":
                axes.plot(time_s, 1e-3 * (series["measured_n"] - series["baseline_n"]), **BASELINE)
            axes.axhline(0.0, color="black", linewidth=0.7)
            axes.plot(time_s, 1e-3 * (series["measured_n"] - series[key]), color=colour, linewidth=1.5)
            axes.set_ylabel("residual (kN)")
            axes.set_title(label, fontsize=10, loc="left")
        grid[-1, 0].set_xlabel("time (s)")
        grid[-1, 0].set_xlim(time_s[0], time_s[-1])
        picture.tight_layout()
        handles = [Line2D([], [], color=RED, linewidth=1.5, label="baseline refitted"),
                   Line2D([], [], label="baseline as given", **BASELINE)]
        if len(panels) > 1:
            handles.append(Line2D([], [], color=TEAL, linewidth=1.5, label="with the effect"))
        handles += [Patch(color=NOISE_FILL, label="95 % of the noise"),
                    Patch(color=TOTAL_FILL, label="95 % of noise and model error")]
        legend_below(picture, handles)
        return to_svg(picture, name, "residual over time")


def draw_autocorrelation(autocorrelation, name):
    """Autocorrelation of the whitened residual; what is left unexplained stands out of the band."""
    if not len(autocorrelation["lag_s"]):
        return None
    with plt.rc_context(STYLE):
        picture, axes = plt.subplots(figsize=(WIDTH_IN, 3.4))
        lag_s, band = autocorrelation["lag_s"], autocorrelation["band"]
        axes.axhspan(-band, band, color=NOISE_FILL, linewidth=0.0)
        axes.axhline(0.0, color="black", linewidth=0.7)
        for key, label, style, marker in (("before", "baseline refitted", REFITTED, "s"),
                                          ("after", "with the effect", WITH_EFFECT, "o")):
            if autocorrelation[key] is not None:
                axes.plot(lag_s, autocorrelation[key], label=label, marker=marker, markersize=3.5, **style)
        axes.set_xlabel("lag (s)")
        axes.set_ylabel("autocorrelation")
        axes.set_xlim(0.0, 1.02 * max(lag_s[-1], 1e-3))
        handles, _ = axes.get_legend_handles_labels()
        legend_below(picture, handles + [Patch(color=NOISE_FILL, label="95 % band of white noise")])
        return to_svg(picture, name, "autocorrelation of the whitened residual")


def draw_evidence(ranking, named, name):
    """Bars of the log Bayes factors, each with the threshold that it has to pass."""
    with plt.rc_context(STYLE):
        rows = [entry for entry in ranking if np.isfinite(entry["log_bayes_factor"])]
        if not rows:
            return None
        picture, axes = plt.subplots(figsize=(WIDTH_IN, 0.9 + 0.34 * len(rows)))
        values = np.array([entry["log_bayes_factor"] for entry in rows])
        for place, (entry, value) in enumerate(zip(rows, values)):
            fill = {"color": TEAL} if entry in named else {"color": GREY}
            if not entry["confirmed"]:
                fill = {"facecolor": "white", "edgecolor": fill["color"], "hatch": "////"}
            axes.barh(place, value, height=0.66, linewidth=1.0, **fill)
            if np.isfinite(entry["threshold"]):
                axes.plot([entry["threshold"]] * 2, [place - 0.42, place + 0.42], color=RED, linewidth=2.4)
            axes.annotate(f"{value:.1f}".replace("-", "−"), (1.03, place), xycoords=("axes fraction", "data"),
                          ha="right", va="center", fontsize=8.5)
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.set_yticks(range(len(rows)))
        axes.set_yticklabels([" + ".join(entry["effects"]) for entry in rows])
        axes.invert_yaxis()
        axes.grid(axis="y", visible=False)
        label = "log Bayes factor (natural logarithm)"
        if np.abs(values).max() > LINEAR_EVIDENCE:
            axes.set_xscale("symlog", linthresh=10.0)
            axes.xaxis.set_major_formatter("{x:g}")
            label += ", linear up to 10, logarithmic beyond"
        axes.set_xlabel(label)
        axes.margins(x=0.08)
        shown = [(any(entry in named for entry in rows), Patch(color=TEAL, label="named")),
                 (any(entry not in named for entry in rows), Patch(color=GREY, label="not named")),
                 (any(not entry["confirmed"] for entry in rows),
                  Patch(facecolor="white", edgecolor=GREY, hatch="////", label="screened only, not simulated in full")),
                 (True, Line2D([], [], color=RED, linewidth=2.4, label="its threshold"))]
        legend_below(picture, [handle for wanted, handle in shown if wanted])
        return to_svg(picture, name, "evidence for each effect")


def interval_rows(report, named):
    """(label, prior low, prior high, low, value, high) of the parameters of the named effects and of the baseline."""
    rows = []
    for entry in named:
        for parameter in entry["parameters"]:
            rows.append((axis_label(parameter), parameter["prior_low"], parameter["prior_high"], parameter["low"],
                         parameter["value"], parameter["high"]))
    for parameter in report["baseline"]:
        prior, fitted = NORMAL_95 * parameter["prior_sigma"], NORMAL_95 * parameter["sigma"]
        rows.append((axis_label(parameter), parameter["prior"] - prior, parameter["prior"] + prior,
                     parameter["fitted"] - fitted, parameter["fitted"], parameter["fitted"] + fitted))
    return [row for row in rows if np.isfinite(row[4])]


def axis_label(parameter):
    unit = parameter["unit"]
    return parameter["key"] + (f" ({unit})" if unit and unit != "1" else "")


def draw_intervals(report, named, name):
    """Each parameter on an axis of its own: what was believed before, and what the record says."""
    rows = interval_rows(report, named)
    if not rows:
        return None
    with plt.rc_context(STYLE):
        lines = -(-len(rows) // 2)
        picture, grid = plt.subplots(lines, 2, figsize=(WIDTH_IN, 0.95 * lines + 0.2), squeeze=False)
        for axes, (label, prior_low, prior_high, low, value, high) in zip(grid.flat, rows):
            if np.isfinite(prior_low) and np.isfinite(prior_high):
                axes.barh(1.0, prior_high - prior_low, left=prior_low, height=0.5, color=PRIOR_FILL)
            if np.isfinite(low) and np.isfinite(high):
                axes.barh(0.0, high - low, left=low, height=0.5, color=TEAL, alpha=0.55)
            axes.plot(value, 0.0, "o", color=DARK, markersize=5.0, zorder=4)
            axes.set_ylim(-0.55, 1.55)
            axes.set_yticks([])
            axes.set_xlabel(label, labelpad=1.0)
            axes.spines["left"].set_visible(False)
            axes.xaxis.set_major_locator(MaxNLocator(7))
            axes.use_sticky_edges = False
            axes.margins(x=0.06)
        for axes in list(grid.flat)[len(rows):]:
            axes.set_visible(False)
        picture.tight_layout(h_pad=0.6)
        legend_below(picture, [Patch(color=PRIOR_FILL, label="believed before (95 %)"),
                               Patch(facecolor=TEAL, alpha=0.55, label="after this record (95 %)"),
                               Line2D([], [], color=DARK, marker="o", linestyle="", label="most probable value")])
        return to_svg(picture, name, "parameters before and after")


def legend_below(picture, handles):
    """Under the whole picture, so that it hides no curve."""
    picture.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.02 / picture.get_size_inches()[1]),
                   ncol=min(5, len(handles)), handlelength=2.8)
