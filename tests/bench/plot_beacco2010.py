"""Figures 4.1 and 4.2 of Beacco 2010 from the JSON of `throng-bench beacco2010`.

    python3 tests/bench/plot_beacco2010.py results/beacco2010.json -o results/beacco2010.png
"""

import argparse
import json

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (after the backend is chosen)

WAYS = {
    "mesh, full detail": ("tab:gray", "s"),
    "impostor, 16 + 7 steps": ("tab:orange", "o"),
    "impostor, adaptive steps": ("tab:red", "^"),
    "mesh, N = 1 M, shared": ("tab:blue", "v"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("json")
    parser.add_argument("-o", "--output", required=True)
    arguments = parser.parse_args()
    with open(arguments.json, encoding="utf-8") as file:
        result = json.load(file)
    figure, axes = plt.subplots(2, 2, figsize=(11, 8), sharex=True)
    for row, characters in enumerate((1, 10)):
        for column, wanted in enumerate((0.15, 0.9)):
            axis = axes[row][column]
            rows = [
                r
                for r in result["rows"]
                if r["characters"] == characters and r["wanted_coverage"] == wanted
            ]
            if not rows:
                continue
            for name, (color, marker) in WAYS.items():
                # of one core: on a shared machine only the processor's time holds
                axis.plot(
                    [r["agents"] for r in rows],
                    [1000.0 / r[name]["frame_cpu_ms"]["mean"] for r in rows],
                    color=color,
                    marker=marker,
                    label=name,
                )
            covered = [r["coverage"] for r in rows]
            axis.set_title(
                f"figure 4.{row + 1}: {characters} character{'s' if characters > 1 else ''}, "
                f"{100 * min(covered):.0f} to {100 * max(covered):.0f} % of the view"
            )
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.grid(True, which="both", alpha=0.3)
            axis.set_xlabel("agents")
            axis.set_ylabel("frames per second of one core (1000 / CPU ms)")
    axes[0][0].legend(fontsize="small")
    machine = result["machine"]
    figure.suptitle(
        f"{result['width_px']}x{result['height_px']}, {machine['processor']}, {machine['cores']} "
        f"cores, load {machine['load']:.0f}",
        fontsize="medium",
    )
    figure.tight_layout()
    figure.savefig(arguments.output, dpi=110)


if __name__ == "__main__":
    main()
