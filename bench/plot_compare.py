#!/usr/bin/env python3
"""Draws what `compare --csv` wrote: time over pixels and over the number of markers, beside the
rivals and, for ours alone, on linear axes with the 99th percentile. Prints the table of
docs/performance.md.

    plot_compare.py times.csv times.svg
"""
import csv
import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

OURS = "HArCo"
PASS = "streaming pass"
# Name in the file -> colour, line, heading in the table (None: not in it).
SYSTEMS = {
    OURS: ("#d62728", "-", "HArCo"),
    "OpenCV ArUco": ("#aec7e8", "--", "ArUco"),
    "OpenCV ArUco, sub-pixel": ("#1f77b4", "--", "ArUco, sub-pixel"),
    "OpenCV ArUco 3": ("#17becf", ":", "ArUco 3"),
    "AprilTag 3, decimate 1": ("#2ca02c", "--", "AprilTag, decimate 1"),
    "AprilTag 3, decimate 2": ("#98df8a", "--", "decimate 2"),
    PASS: ("#7f7f7f", "-", "streaming pass"),
}
CONTENTS = {"one": "one marker", "thirty": "thirty markers", "texture": "texture", "night": "night"}
COLOURS = {"one": "#d62728", "thirty": "#ff7f0e", "texture": "#2ca02c", "night": "#1f77b4"}


def load(source):
    with open(source, newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        row["megapixels"] = int(row["width"]) * int(row["height"]) / 1e6
        for name in ("median_ms", "p99_ms", "recall"):
            row[name] = float(row[name])
        row["markers"] = int(row["markers"])
    return rows


def of(rows, content, system, over):
    """The rows of one line in a picture, in their order along it."""
    chosen = [row for row in rows if row["content"] == content and row["system"] == system]
    return sorted(chosen, key=lambda row: row[over])


def column(rows, name):
    return [row[name] for row in rows]


def draw_rivals(axes, rows, content, over, title):
    for system, (colour, line, _) in SYSTEMS.items():
        points = of(rows, content, system, over)
        if points:
            axes.plot(column(points, over), column(points, "median_ms"), line, color=colour,
                      marker="o", markersize=3, label=system)
    axes.set(yscale="log", title=title, ylabel="median, ms")
    axes.grid(alpha=0.3)


def draw_ours(axes, rows, content, over, colour, label):
    points = of(rows, content, OURS, over)
    if not points:
        return
    medians = column(points, "median_ms")
    beyond = [max(0.0, p99 - median) for p99, median in zip(column(points, "p99_ms"), medians)]
    axes.errorbar(column(points, over), medians, yerr=[[0.0] * len(beyond), beyond], color=colour,
                  marker="o", markersize=3, capsize=2, linewidth=1.2, label=label)
    axes.set_ylabel("median and 99th percentile, ms")
    axes.grid(alpha=0.3)


def over_pixels(axes):
    axes.set(xscale="log", xlabel="megapixels")
    axes.set_xticks([0.36, 0.92, 2.07, 8.29], ["0.36", "0.92", "2.1", "8.3"])
    axes.minorticks_off()


def draw(rows, target):
    figure, axes = plt.subplots(2, 3, figsize=(15, 8.4))
    for axis, content in zip((axes[0][0], axes[0][1], axes[0][2]), ("one", "texture", "night")):
        draw_rivals(axis, rows, content, "megapixels", CONTENTS[content])
        over_pixels(axis)
    handles, labels = axes[0][0].get_legend_handles_labels()
    draw_rivals(axes[1][0], rows, "grid", "markers", "1920 × 1080")
    axes[1][0].set_xlabel("markers in the frame")
    for content, colour in COLOURS.items():
        draw_ours(axes[1][1], rows, content, "megapixels", colour, CONTENTS[content])
    axes[1][1].set(title="HArCo", xlabel="megapixels")
    axes[1][1].legend(frameon=False)
    draw_ours(axes[1][2], rows, "grid", "markers", SYSTEMS[OURS][0], "")
    axes[1][2].set(title="HArCo, 1920 × 1080", xlabel="markers in the frame")
    for axis in axes[1][1:]:
        axis.set_ylim(bottom=0.0)
        axis.set_xlim(left=0.0)
    figure.legend(handles, labels, loc="lower center", ncol=4, frameon=False)
    figure.tight_layout(rect=(0, 0.07, 1, 1))
    # Without a date and with fixed ids, the same numbers give the same file.
    matplotlib.rcParams["svg.hashsalt"] = "compare"
    figure.savefig(target, metadata={"Date": None})


def cell(row):
    times = f"{row['median_ms']:.3g}"
    if row["system"] == PASS:
        return times
    times += f" ({row['p99_ms']:.3g})"
    if row["markers"]:
        times += f", {row['recall']:.0f} %"
    if row["false_positives"] != "0":
        times += f", {row['false_positives']} wrong"
    return times


def print_table(rows):
    present = {row["system"] for row in rows}
    systems = [system for system in SYSTEMS if system in present]
    print("| frames |", " | ".join(SYSTEMS[system][2] for system in systems), "| × the pass |")
    print("|---" * (len(systems) + 2) + "|")
    kinds = dict.fromkeys(
        (row["width"], row["height"], row["content"], row["markers"]) for row in rows)
    for kind in kinds:
        width, height, content, markers = kind
        found = {row["system"]: row for row in rows
                 if (row["width"], row["height"], row["content"], row["markers"]) == kind}
        ratio = found[OURS]["median_ms"] / found[PASS]["median_ms"]
        name = f"{markers} of a grid" if content == "grid" else content
        print(f"| {width} × {height}, {name} |",
              " | ".join(cell(found[system]) for system in systems), f"| {ratio:.0f} |")


def main(source, target):
    rows = load(source)
    draw(rows, target)
    print_table(rows)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2])
