#!/usr/bin/env python3
"""Draws what `accuracy --csv` wrote: errors over their bound against the marker's side, and the
normalised error squared against the chi-square law that an honest covariance follows.

    plot_accuracy.py accuracy.csv accuracy.svg
"""
import csv
import math
import sys
from collections import defaultdict

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

# Key in the file -> name, colour, line. A key that stands in no file is simply not drawn.
METHODS = {
    "harco_aligned": ("HArCo, aligned", "#d62728", "-"),
    "harco_corners": ("HArCo, joint corners", "#ff9896", "-"),
    "harco_paper": ("HArCo, the paper's fusion", "#7f7f7f", "-"),
    "aruco": ("ArUco, sub-pixel, IPPE", "#1f77b4", "--"),
    "apriltag": ("AprilTag 3 36h11, IPPE", "#2ca02c", "--"),
    "board_averaged": ("board of 24, averaged", "#c5b0d5", ":"),
    "board_joint": ("board of 24, joint", "#9467bd", ":"),
    "board_edges": ("board of 24, joint, edges", "#5b3a86", ":"),
}
PARTS = {
    "rotation": ("rotation", "rotation_rad", "rotation_bound_rad"),
    "lateral": ("lateral", "lateral_m", "lateral_bound_m"),
    "depth": ("depth", "depth_m", "depth_bound_m"),
}


def chi_square_6(x):
    """Distribution function with six degrees of freedom."""
    half = x / 2.0
    return 1.0 - math.exp(-half) * (1.0 + half + half * half / 2.0)


def root_mean_square(values):
    return math.sqrt(sum(v * v for v in values) / len(values))


def draw_ratios(axes, rows, part):
    title, error, bound = PARTS[part]
    ratios = defaultdict(lambda: defaultdict(list))
    for row in rows:
        if row["found"] == "1" and row["flip"] == "0":
            ratio = float(row[error]) / float(row[bound])
            ratios[row["method"]][float(row["side_px"])].append(ratio)
    for method, (name, colour, line) in METHODS.items():
        sides = sorted(ratios[method])
        if sides:
            values = [root_mean_square(ratios[method][side]) for side in sides]
            axes.plot(sides, values, line, color=colour, marker="o", markersize=3, label=name)
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set(xscale="log", yscale="log", title=title, xlabel="side, px")
    sides = sorted({float(row["side_px"]) for row in rows})
    axes.set_xticks(sides, [f"{side:g}" for side in sides])
    axes.minorticks_off()
    axes.grid(alpha=0.3)


def draw_consistency(axes, rows):
    """Share of frames below a normalised error, against the share that the law demands."""
    for method, (name, colour, _) in METHODS.items():
        nees = sorted(float(r["nees"]) for r in rows if r["method"] == method and r["nees"])
        if nees:
            shares = [(i + 0.5) / len(nees) for i in range(len(nees))]
            axes.plot([chi_square_6(value) for value in nees], shares, color=colour, label=name)
    axes.plot([0, 1], [0, 1], color="black", linewidth=0.8)
    axes.set(title="covariance", xlabel="share demanded by $\\chi^2_6$", xlim=(0, 1), ylim=(0, 1))
    axes.set_ylabel("share of frames")
    axes.grid(alpha=0.3)


def main(source, target):
    with open(source, newline="") as file:
        rows = list(csv.DictReader(file))
    figure, axes = plt.subplots(1, 4, figsize=(15, 4.4))
    for axis, part in zip(axes, PARTS):
        draw_ratios(axis, rows, part)
    axes[0].set_ylabel("RMSE / Cramér–Rao bound")
    draw_consistency(axes[3], rows)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncol=4, frameon=False)
    figure.tight_layout(rect=(0, 0.13, 1, 1))
    # Without a date and with fixed ids, the same numbers give the same file.
    matplotlib.rcParams["svg.hashsalt"] = "accuracy"
    figure.savefig(target, metadata={"Date": None})


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2])
