#!/usr/bin/env python3
"""Joins the JSON files of `epigraph quality --json` with figures.csv to tables in Markdown.

    tests/oidn/table.py FILE.json ... > table.md

The tables have PSNR and FLIP of each row at each budget. A row that was measured with several divisions of a budget has the
best of each figure there, and so has OIDN. The last table sets the best graph beside OIDN with more paths.
"""

import argparse
import csv
import json
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUDGETS = ["0.05", "0.1", "0.25", "0.5", "1", "4"]
NAMES = {"full": "OIDN", "bilinear": "OIDN, bilinear", "joint": "OIDN, joint bilateral"}
# A budget and the one with four times as many paths.
MORE = {"0.25": "1", "1": "4"}


def cells(files, figures):
    """View, row, budget and figures of each cell."""
    for path in files:
        for row in json.loads(path.read_text())["rows"]:
            figure = row["psnr"], row["flip"], row["flicker"], row["near_reference"]
            yield (row["scene"], row["camera"]), row["graph"], row["budget"].split()[0], figure
    with open(figures, newline="") as file:
        for row in csv.DictReader(file):
            figure = float(row["psnr"]), float(row["flip"]), float(row["flicker"]), False
            yield (row["scene"], row["camera"]), NAMES[row["method"]], row["budget"], figure


def better(a, b):
    """The best of each figure."""
    return max(a[0], b[0]), *map(min, a[1:3], b[1:3]), max(a, b)[3]


def best(rows, names, budget):
    """The figures of the row with the highest PSNR."""
    return max((rows[name][budget] for name in names if budget in rows.get(name, {})), default=None)


def text(figure, flicker=False):
    if figure is None:
        return "-"
    psnr, flip, changes, near = figure
    places = [f"{psnr:.1f}" + "*" * near, f"{flip:.3f}".lstrip("0")] + [f"{changes:.4f}".lstrip("0")] * flicker
    return " / ".join(places)


def line(cells):
    return "| " + " | ".join(cells) + " |"


def table(view, rows, flicker):
    budgets = [budget for budget in BUDGETS if any(budget in row for row in rows.values())]
    yield line([", ".join(view), *budgets])
    yield "|" + "---|" * (len(budgets) + 1)
    tops = [best(rows, rows, budget) for budget in budgets]
    for name, row in rows.items():
        shown = [row.get(budget) for budget in budgets]
        texts = [text(figure, flicker) for figure in shown]
        yield line([name, *(f"**{t}**" if figure == top else t for t, figure, top in zip(texts, shown, tops))])
    yield ""


def summary(views):
    yield line(["", "best graph", "`taa`", "`svgf`", "OIDN", "OIDN, 4 times the paths"])
    yield "|" + "---|" * 6
    for view, rows in views.items():
        ours = [name for name in rows if not name.startswith(("peers/", "OIDN"))]
        oidn = [name for name in rows if name.startswith("OIDN")]
        for budget, more in MORE.items():
            top = best(rows, ours, budget)
            name = next(name for name in ours if rows[name].get(budget) == top)
            peers = [best(rows, [f"peers/{peer}"], budget) for peer in ("taa", "svgf")]
            peers += [best(rows, oidn, budget), best(rows, oidn, more)]
            yield line([f"{', '.join(view)}, {budget}", f"`{name}` {text(top)}", *map(text, peers)])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--figures", type=Path, default=HERE / "figures.csv")
    parser.add_argument("--flicker", action="store_true", help="show flicker as well")
    args = parser.parse_args()
    views = {}
    for view, name, budget, figure in cells(args.files, args.figures):
        row = views.setdefault(view, {}).setdefault(name, {})
        row[budget] = better(figure, row.get(budget, figure))
    # Views that only OIDN was measured in have nothing to compare with.
    views = {view: rows for view, rows in views.items() if not all(name.startswith("OIDN") for name in rows)}
    for view, rows in views.items():
        print("\n".join(table(view, rows, args.flicker)))
    print("\n".join(summary(views)))


if __name__ == "__main__":
    main()
