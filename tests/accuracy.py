#!/usr/bin/env python3
"""Run tricurve on real scenes with ground truth and score what it exports.

usage: accuracy.py TRICURVE SCENES --score SCORE.PY [--views 1,3,5] [--reference left|centre] [--scenes Art,Dolls]

TRICURVE  the executable
SCENES    a folder of scene folders (scene.json, view*.png, gt_view*.png)
--score   the scoring script, called as: SCORE.PY SCENE POINTS.csv --views V --reference R --json

Prints a line a scene and the mean. Exits with 1 when the mean falls short of what is promised for the triple 1,3,5 with
the left view as reference: coverage of Canny edges at least 0.45 with at most 1.5 % of the points off by over a pixel.
Needs: pip install numpy opencv-python-headless
"""
import argparse, json, pathlib, subprocess, sys, tempfile

MIDDLEBURY = ("Aloe Art Baby1 Baby2 Baby3 Cloth1 Cloth2 Cloth3 Cloth4 Dolls Flowerpots Lampshade1 Lampshade2 Laundry "
              "Midd1 Midd2").split()
LEAST_COVERAGE, MOST_BAD_1 = 0.45, 0.015


def score(arguments, scene, folder):
    recording, points = folder / "scene.mcap", folder / "points.csv"
    views = [int(view) for view in arguments.views.split(",")]
    reference = views[1] if arguments.reference == "centre" else views[0]
    source = pathlib.Path(arguments.scenes_folder) / scene
    run = [arguments.tricurve, "run", "--source", source, "--views", arguments.views, "--scans", "1", "--force",
           "--record", recording, "--set", f"match.reference={arguments.reference}", "--json"]
    subprocess.run(run, check=True, stdout=subprocess.DEVNULL)
    subprocess.run([arguments.tricurve, "export", recording, "--scan", "0", "--csv", points], check=True,
                   stdout=subprocess.DEVNULL)
    scored = subprocess.run([sys.executable, arguments.score, source, points, "--views", arguments.views,
                             "--reference", str(reference), "--json"], check=True, capture_output=True)
    result = json.loads(scored.stdout)
    ours, other = result["ours"], result["sgbm_same_pixels"]
    return (result["coverage"], ours["bad_1"], ours["bad_2"], ours["median"], other["bad_1"], other["bad_2"])


def line(name, figures):
    coverage, bad_1, bad_2, median, sgbm_1, sgbm_2 = figures
    return (f"{name:<12} {coverage:8.3f} {100 * bad_1:8.2f} {100 * bad_2:8.2f} {median:8.3f}"
            f" {100 * sgbm_1:10.2f} {100 * sgbm_2:8.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tricurve")
    parser.add_argument("scenes_folder")
    parser.add_argument("--score", required=True)
    parser.add_argument("--views", default="1,3,5")
    parser.add_argument("--reference", default="left", choices=["left", "centre"])
    parser.add_argument("--scenes", default=",".join(MIDDLEBURY))
    arguments = parser.parse_args()
    print(f"{'scene':<12} coverage  bad-1 %  bad-2 %   median | SGBM bad-1 %  bad-2 %")
    results = []
    for scene in arguments.scenes.split(","):
        with tempfile.TemporaryDirectory() as folder:
            results.append(score(arguments, scene, pathlib.Path(folder)))
        print(line(scene, results[-1]), flush=True)
    mean = [sum(column) / len(results) for column in zip(*results)]
    print(line("mean", mean))
    promised = arguments.views == "1,3,5" and arguments.reference == "left"
    if promised and (mean[0] < LEAST_COVERAGE or mean[1] > MOST_BAD_1):
        sys.exit(f"short of the promise: coverage at least {LEAST_COVERAGE}, bad-1 at most {100 * MOST_BAD_1} %")


if __name__ == "__main__":
    main()
