#!/usr/bin/env python3
"""Draws what `consistency --csv` wrote: quantiles of the normalised error squared against those of
the chi-square law with six degrees of freedom, size by size.

    plot_consistency.py consistency.csv consistency.svg
"""
import csv
import math
import sys
from collections import defaultdict

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

METHODS = {"corners": "joint corners", "aligned": "aligned"}
SHARES = [0.01, 0.02, 0.05] + [i / 20 for i in range(2, 19)] + [0.95, 0.98, 0.99]


def chi_square_6(x):
    """Distribution function with six degrees of freedom."""
    half = x / 2.0
    return 1.0 - math.exp(-half) * (1.0 + half + half * half / 2.0)


def quantile_of_law(share):
    low, high = 0.0, 100.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if chi_square_6(middle) < share else (low, middle)
    return low


def draw(axes, rows, title):
    by_bin = defaultdict(list)
    sides = defaultdict(list)
    for row in rows:
        if row["nees"]:
            by_bin[int(row["bin"])].append(float(row["nees"]))
            sides[int(row["bin"])].append(float(row["side_px"]))
    law = [quantile_of_law(share) for share in SHARES]
    colours = plt.cm.viridis([i / max(1, len(by_bin) - 1) for i in range(len(by_bin))])
    for colour, index in zip(colours, sorted(by_bin)):
        nees = sorted(by_bin[index])
        measured = [nees[min(len(nees) - 1, int(share * len(nees)))] for share in SHARES]
        name = f"{min(sides[index]):.0f}–{max(sides[index]):.0f} px"
        axes.plot(law, measured, color=colour, label=name, linewidth=1.2)
    axes.plot([0, 20], [0, 20], color="black", linewidth=0.8)
    axes.set(title=title, xlabel="quantile of $\\chi^2_6$", xlim=(0, 17.5), ylim=(0, 25))
    axes.grid(alpha=0.3)


def main(source, target):
    with open(source, newline="") as file:
        rows = list(csv.DictReader(file))
    figure, axes = plt.subplots(1, 2, figsize=(9, 4.2), sharey=True)
    for axis, (method, title) in zip(axes, METHODS.items()):
        draw(axis, [row for row in rows if row["method"] == method], title)
    axes[0].set_ylabel("normalised error squared")
    axes[0].legend(frameon=False, fontsize="small")
    figure.tight_layout()
    # Without a date and with fixed ids, the same numbers give the same file.
    matplotlib.rcParams["svg.hashsalt"] = "consistency"
    figure.savefig(target, metadata={"Date": None})


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2])
