"""Draws the figures of a study's report: line plots as SVG, pictures of particles as PNG."""

import math

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from report_page import COLOURS, LINE_STYLES, STYLE, WIDTH_IN, plt, to_png, to_svg
from study_data import Missing

WATER_COLOUR = "#2f7fb8"
WATER_FILL = "#e8f2f9"
# Samples are drawn as means over this: 100 a second would make the page heavy and show no more.
DRAWN_INTERVAL_S = 0.1
# The refilled share of a hole of fewer sites says little, and is not drawn.
MIN_HOLE_SITES = 10
PLUG_PANELS = [
    ("raised_particles", "raised particles", 1.0),
    ("bulge_height_m", "largest rise of the top layer (m)", 1.0),
    ("radius_at_waterline_m", "radius at the waterline (m)", 1.0),
    ("radius_at_top_m", "radius at the plug's top (m)", 1.0),
    ("lifted_mass_kg", "raised mass (t)", 1e-3),
    ("hole_cover_ratio", "hole covered by neighbours (%)", 100.0),
]


class Drawing:
    """What a figure gives to the page: its markup, a default title, and what the caption has to explain."""

    def __init__(self, markup, title, caption):
        self.markup = markup
        self.title = title
        self.caption = caption


def draw(study, figure, number):
    """The Drawing of one entry of study.yaml's figures. Raises Missing where the runs do not hold what it shows."""
    with plt.rc_context(STYLE):
        return DRAWERS[figure["kind"]](study, figure, f"figure-{number}")


def case_style(study, name):
    """Colour and line style of a case: the same in all figures, and another colour than its neighbours in each."""
    colours, styles = {}, {}
    groups = [set(figure["cases"]) for figure in study.figures if len(figure.get("cases", [])) > 1]
    for case in (case.name for case in study.cases):
        # A small figure can have each case in a colour of its own; in a large one line styles have to help.
        beside = set().union(*(group for group in groups if case in group and len(group) <= len(COLOURS)))
        taken = [colours[other] for other in colours if other in beside]
        used = list(colours.values())
        colour = min(range(len(COLOURS)), key=lambda index: (taken.count(index), used.count(index), index))
        colours[case], styles[case] = colour, used.count(colour) % len(LINE_STYLES)
    return {"color": COLOURS[colours[name]], "linestyle": LINE_STYLES[styles[name]]}


def case_label(study, name):
    title = study.case(name).title
    return f"{name}: {title}" if title else name


def mean_curve(curves):
    """Mean of curves [(time_s, values)] over the time that all of them cover, on the first one's times."""
    end_s = min(time_s[-1] for time_s, _ in curves)
    time_s = curves[0][0][curves[0][0] <= end_s + 1e-9]
    return time_s, np.mean([np.interp(time_s, other_s, values) for other_s, values in curves], axis=0)


def drawn_samples(time_s, values):
    """Means over DRAWN_INTERVAL_S."""
    period_s = (time_s[-1] - time_s[0]) / max(time_s.size - 1, 1)
    group = max(1, int(round(DRAWN_INTERVAL_S / period_s))) if period_s > 0.0 else 1
    whole = time_s.size // group * group
    return (time_s[:whole].reshape(-1, group).mean(axis=1), values[:whole].reshape(-1, group).mean(axis=1))


def hardening_curve(initial_pa, linear_per_pa, quadratic_per_pa2, max_compaction, end_ratio=0.9, count=200):
    """Eq. 12 of the paper: (X in Pa, plastic volume strain) from X0 to the X at which end_ratio of W is used up."""
    depth = -math.log(1.0 - end_ratio)
    root = math.sqrt(linear_per_pa**2 + 4.0 * quadratic_per_pa2 * depth)
    beyond_pa = np.linspace(0.0, 2.0 * depth / (linear_per_pa + root), count)
    strain = max_compaction * -np.expm1(-linear_per_pa * beyond_pa - quadratic_per_pa2 * beyond_pa**2)
    return initial_pa + beyond_pa, strain


def draw_hardening(study, figure, name):
    curves = []
    for case in figure["cases"]:
        run = next((run for run in study.runs if run.case == case and run.scenario()), None)
        if run is None:
            raise Missing(f"no run of {case} left a scenario.yaml")
        keys = ["cap_initial_intercept_pa", "cap_hardening_linear_per_pa", "cap_hardening_quadratic_per_pa2",
                "cap_max_compaction"]
        values = [run.scenario_number(f"ice.{key}") for key in keys]
        curves.append((case, values, hardening_curve(*values)))
    picture, (left, right) = plt.subplots(1, 2, figsize=(WIDTH_IN, 4.4))
    for case, values, (x_pa, strain) in curves:
        style = case_style(study, case)
        left.plot(strain, 1e-3 * x_pa, linewidth=1.8, **style)
        # Up to X0 / 3 nothing compacts.
        right.plot(1e-3 / 3.0 * np.append(0.0, x_pa), np.append(0.0, strain), linewidth=1.8, **style)
    left.set_xlabel("plastic volume strain e (compaction positive)")
    left.set_ylabel("J1-intercept X of the cap (kPa)")
    right.set_xlabel("pressure p = X / 3 (kPa)")
    right.set_ylabel("plastic volume strain e")
    for axes in (left, right):
        axes.set_xlim(left=0.0)
        axes.set_ylim(bottom=0.0)
    legend_below(picture, study, figure["cases"])
    same = ""
    parameters = [tuple(values) for _, values, _ in curves]
    if len(set(parameters)) < len(parameters):
        same = " Cases with the same cap lie on each other."
    return Drawing(
        to_svg(picture, name, "hardening curve"), "Hardening of the cap",
        "Eq. 12 of the paper with the keys ice.cap_* of the cases: left the J1-intercept X of the cap, right the "
        "plastic volume strain against the pressure on the hydrostatic axis, as in Fig. 9 of the paper, both up to "
        f"90 % of the largest compaction W.{same} The paper compares with a curve of Heinonen (2004); its text gives "
        "no numbers of that curve, so none is drawn.")


def draw_force(study, figure, name):
    picture, axes = plt.subplots(figsize=(WIDTH_IN, 5.2))
    shown, several, end_s = [], False, 0.0
    for case in figure["cases"]:
        runs = study.runs_of(case)
        if not runs:
            continue
        shown.append(case)
        style = case_style(study, case)
        curves = [(run.force()["time_s"], 1e-3 * run.force()["force_n"]) for run in runs]
        end_s = max(end_s, *(time_s[-1] for time_s, _ in curves))
        if len(curves) > 1:
            several = True
            for curve in curves:
                axes.plot(*drawn_samples(*curve), color=style["color"], linewidth=0.6, alpha=0.45)
        axes.plot(*drawn_samples(*mean_curve(curves)), linewidth=2.0, zorder=3, **style)
    if not shown:
        plt.close(picture)
        raise Missing("none of its cases has a run that did not fail")
    axes.set_xlabel("time after settling (s)")
    axes.set_ylabel("load cell, positive down (kN)")
    axes.set_xlim(0.0, end_s)
    if min(line.get_ydata().min() for line in axes.lines) > -0.1:
        axes.set_ylim(bottom=0.0)
    legend_below(picture, study, shown)
    seeds = " Thin: one run of one seed each; thick: their mean." if several else ""
    return Drawing(to_svg(picture, name, "force against time"), "Force against time",
                   "Reading of the load cell, weight of collector and pole included, drawn as means over "
                   f"{DRAWN_INTERVAL_S:g} s.{seeds}{left_out(figure['cases'], shown)}")


def draw_bars(study, figure, name):
    shown = [case for case in figure["cases"] if study.runs_of(case)]
    if not shown:
        raise Missing("none of its cases has a run that did not fail")
    picture, axes = plt.subplots(figsize=(min(3.0 + 0.95 * len(shown), WIDTH_IN), 4.6))
    several = False
    for place, case in enumerate(shown):
        colour = case_style(study, case)["color"]
        for side, column in ((-0.2, "peak_force_n"), (0.2, "residual_force_n")):
            values = np.array([1e-3 * run.result(column) for run in study.runs_of(case)])
            fill = {"color": colour} if side < 0.0 else {"facecolor": "white", "edgecolor": colour, "hatch": "////"}
            axes.bar(place + side, values.mean(), width=0.36, linewidth=1.2, **fill)
            if values.size > 1:
                several = True
                axes.vlines(place + side, values.min(), values.max(), color="black", linewidth=1.2, zorder=4)
                axes.plot(np.full(values.size, place + side), values, "o", markersize=4.0, zorder=5,
                          markerfacecolor="white", markeredgecolor="black", markeredgewidth=0.8)
            if len(shown) <= 12:
                axes.annotate(f"{values.mean():.1f}", (place + side, values.max()), xytext=(0, 5), ha="center",
                              textcoords="offset points", fontsize=8)
    axes.set_xticks(range(len(shown)))
    crowded = len(shown) > 12 or max(len(case) for case in shown) > 10
    axes.set_xticklabels(shown, rotation=60 if crowded else 0, ha="right" if crowded else "center")
    axes.grid(axis="x", visible=False)
    axes.set_ylabel("load cell (kN)")
    axes.margins(y=0.1)
    axes.legend(handles=[Patch(facecolor="#555555", label="peak"),
                         Patch(facecolor="white", edgecolor="#555555", hatch="////", label="residual")],
                loc="lower left", bbox_to_anchor=(0.0, 1.0), ncol=2)
    seeds = " Bars: mean over the seeds; circles: each seed; line: their range." if several else ""
    return Drawing(to_svg(picture, name, "peak and residual force"), "Peak and residual force",
                   "Peak: largest 1 s mean of the load cell's reading. Residual: mean of the last 4.5 s. "
                   f"Weight of collector and pole included.{seeds}{left_out(figure['cases'], shown)}")


def draw_snapshots(study, figure, name):
    runs = study.runs_of(figure["case"])
    if not runs:
        raise Missing(f"no run of {figure['case']} that did not fail")
    run = runs[0]
    frames = [run.frame(time_s) for time_s in figure["times_s"]]
    spacing = run.scenario_number("field.spacing_m")
    radius = run.scenario_number("collector.radius_m")
    damaged = max(frame.damage.max() for frame in frames) > 0.0
    sections = []
    for frame in frames:
        kept = section(frame.position_m, spacing)
        values = (frame.damage if damaged else frame.plastic_strain)[kept]
        sections.append((frame.position_m[kept], values))
    # A plastic strain has no upper bound; a few torn-off particles would take the whole scale.
    top = 1.0 if damaged else max(1e-3, *(np.percentile(values, 98.0) for _, values in sections))
    half_width = min(0.5 * run.scenario_number("field.length_x_m"), 2.6 * radius) + 0.5 * spacing
    shown_z = np.concatenate([position[np.abs(position[:, 0]) < half_width, 2] for position, _ in sections])
    hubs = [collector_lines(run, frame.time_s)[0] for frame in frames]
    low = min(shown_z.min(), *(line[:, 1].min() for line in hubs)) - spacing
    high = max(shown_z.max(), *(line[:, 1].max() for line in hubs)) + spacing

    columns = min(2, len(frames))
    rows = -(-len(frames) // columns)
    width = 4.6 * columns
    height = rows * (4.6 * (high - low) / (2.0 * half_width) + 0.55)
    picture, grid = plt.subplots(rows, columns, figsize=(width + 0.9, height), squeeze=False, sharex=True, sharey=True,
                                 layout="constrained", dpi=130)
    particles = None
    for axes, frame, (position, values) in zip(grid.flat, frames, sections):
        axes.axhspan(low, 0.0, color=WATER_FILL, linewidth=0, zorder=0)
        size = np.full(len(position), spacing)
        particles = EllipseCollection(size, size, np.zeros(len(position)), units="xy", offsets=position[:, [0, 2]],
                                      transOffset=axes.transData, array=values, cmap="cividis", clim=(0.0, top),
                                      edgecolor="#333333", linewidth=0.3, zorder=2)
        axes.add_collection(particles)
        axes.axhline(0.0, color=WATER_COLOUR, linewidth=1.3, zorder=3)
        net, pole = collector_lines(run, frame.time_s)
        axes.plot(net[:, 0], net[:, 1], color="#d1495b", linewidth=2.6, solid_joinstyle="round", zorder=5)
        axes.plot(pole[:, 0], pole[:, 1], color="#d1495b", linewidth=1.4, zorder=4)
        axes.set_title(f"{frame.time_s:.4g} s", fontsize=10)
        axes.set_aspect("equal")
        axes.set_xlim(-half_width, half_width)
        axes.set_ylim(low, high)
        axes.grid(False)
    for axes in list(grid.flat)[len(frames):]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel("x (m)")
    for axes in grid[:, 0]:
        axes.set_ylabel("height over the waterline z (m)")
    quantity = "damage" if damaged else "plastic strain (deviatoric, accumulated)"
    picture.colorbar(particles, ax=list(grid.flat), label=quantity, shrink=0.8, pad=0.01,
                     extend="neither" if damaged else "max")
    off = [f"{time:g} s ({frame.time_s:.4g} s)" for time, frame in zip(figure["times_s"], frames)
           if abs(frame.time_s - time) > 0.25]
    nearest = f" No snapshot lies within 0.25 s of {', '.join(off)}: the nearest, in brackets, is shown." if off else ""
    return Drawing(
        to_png(picture, f"sections through the ice of {figure['case']}"), f"Section through the ice, {figure['case']}",
        f"{run.name}: particles within one spacing ({spacing:g} m) of the vertical plane y = 0, as discs of the "
        f"spacing's size, coloured by {quantity}; blue: still waterline; red: collector and pole.{nearest}")


def section(position_m, spacing_m):
    """Indices of the particles within one spacing of the plane y = 0, the nearest to the viewer (lowest y) last."""
    order = np.argsort(-position_m[:, 1], kind="stable")
    return order[np.abs(position_m[order, 1]) < spacing_m]


def collector_lines(run, time_s):
    """Net and pole in the plane y = 0, as (n, 2) arrays of x and z in m: arms lie at azimuths 0 and 180 degrees."""
    force = run.force()
    radius, rim = run.scenario_number("collector.radius_m"), run.scenario_number("collector.rim_height_m")
    folded = math.radians(run.scenario_number("collector.folded_arm_angle_deg"))
    unfolded = math.atan2(rim, radius)
    hub_m = float(np.interp(time_s, force["time_s"], force["hoist_position_m"]))
    ratio = float(np.interp(time_s, force["time_s"], force["fold_ratio"]))
    angle = folded + ratio * (unfolded - folded)
    reach_m, rise_m = math.hypot(radius, rim) * math.cos(angle), math.hypot(radius, rim) * math.sin(angle)
    net = np.array([[-reach_m, hub_m + rise_m], [0.0, hub_m], [reach_m, hub_m + rise_m]])
    length_m = run.scenario_number("collector.pole_length_m")
    return net, np.array([[0.0, hub_m], [0.0, hub_m + length_m]])


def draw_plug(study, figure, name):
    shown = [case for case in figure["cases"] if study.runs_of(case)]
    if not shown:
        raise Missing("none of its cases has a run that did not fail")
    panels = [panel for panel in PLUG_PANELS
              if all(panel[0] in run.plug() for case in shown for run in study.runs_of(case))]
    if not panels:
        raise Missing("plug.csv has none of its columns")
    rows = -(-len(panels) // 2)
    picture, grid = plt.subplots(rows, 2, figsize=(WIDTH_IN, 2.7 * rows + 0.5), squeeze=False, sharex=True)
    several = False
    for axes, (column, label, scale) in zip(grid.flat, panels):
        for case in shown:
            style = case_style(study, case)
            curves = [(run.plug()["time_s"], scale * plug_values(run.plug(), column)) for run in study.runs_of(case)]
            if len(curves) > 1:
                several = True
                for curve in curves:
                    axes.plot(*curve, color=style["color"], linewidth=0.6, alpha=0.45)
            axes.plot(*mean_curve(curves), linewidth=1.8, **style)
        if column.startswith("radius"):
            for radius in sorted({run.scenario_number("collector.radius_m")
                                  for case in shown for run in study.runs_of(case)}):
                axes.axhline(radius, color="#666666", linewidth=0.8)
                axes.annotate("collector", (1.0, radius), xycoords=("axes fraction", "data"), ha="right", va="bottom",
                              fontsize=8, color="#444444")
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
        axes.set_xlim(0.0, max(line.get_xdata()[-1] for line in axes.lines))
    for axes in list(grid.flat)[len(panels):]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel("time after settling (s)")
    picture.tight_layout()
    legend_below(picture, study, shown)
    seeds = " Thin: one seed each; thick: their mean." if several else ""
    return Drawing(
        to_svg(picture, name, "plug and hole against time"), "Plug and hole against time",
        "Raised: more than one spacing above the original site. Radii are those of a disc with the same section: at "
        "the waterline, and in the layer below the highest raised particle. A hole site counts as refilled when a "
        f"particle that is not raised has moved into it; drawn from {MIN_HOLE_SITES} hole sites on."
        f"{seeds}{left_out(figure['cases'], shown)}")


def plug_values(plug, column):
    """A column of plug.csv, nan where it is not to be drawn."""
    if column == "hole_cover_ratio" and "hole_sites" in plug:
        return np.where(plug["hole_sites"] < MIN_HOLE_SITES, np.nan, plug[column])
    return plug[column]


def legend_below(picture, study, cases):
    """One legend for the whole picture, under it, so that it hides no curve."""
    handles = [Line2D([], [], linewidth=2.0, **case_style(study, case)) for case in cases]
    labels = [case_label(study, case) for case in cases]
    columns = max(1, min(len(labels), int(110 / (max(map(len, labels)) + 10))))
    picture.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.5, -0.02 / picture.get_size_inches()[1]),
                   ncol=columns, handlelength=3.2)


def left_out(asked, shown):
    missing = [case for case in asked if case not in shown]
    text = f" Without {', '.join(missing)}: no run that did not fail." if missing else ""
    if len(shown) > len(COLOURS) * len(LINE_STYLES):
        text += " The cases are so many that colours and line styles repeat."
    return text


DRAWERS = {
    "hardening": draw_hardening,
    "force": draw_force,
    "bars": draw_bars,
    "snapshots": draw_snapshots,
    "plug": draw_plug,
}
