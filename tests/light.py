#!/usr/bin/env python3
"""What noise, blur, compression and banding cost, beside OpenCV's SGBM on the same degraded images.

usage: light.py TRICURVE SCENES [--score SCORE.PY] [--scenes Art,Dolls,…] [--views 1,3,5] [--only NAME]…
                [--set NODE.KEY=VALUE]… [--json]

TRICURVE  the executable
SCENES    a folder of scene folders (scene.json, view*.png, gt_view*.png)
--score   a scoring script, imported for its points' errors; without it they are worked out here, alike
--only    the beginning of a degradation's name, as often as wanted
--set     a setting of the run, as often as wanted: what it is worth under the same degradations

Every view of a scene is degraded by itself, with a fixed seed, and the truth stays. Printed are, a degradation, means
over the scenes, with the left view as reference: coverage of the Canny edges of the reference image as it was before,
and bad-1.0, of tricurve; bad-1.0 of SGBM at tricurve's pixels where SGBM has a disparity; SGBM's own coverage of those
edges and bad-1.0 there. SGBM has blocks of 5, P1 200, P2 800, left-right check 1, uniqueness 10, speckles 100/2, from
the reference view to its neighbour.
Needs: pip install numpy opencv-python-headless
"""
import argparse, csv, importlib.util, json, pathlib, shutil, subprocess, sys, tempfile
import cv2
import numpy as np

SEED = 1990
SCENES = "Art,Baby2,Cloth3,Dolls,Laundry,Midd1"
NEAR = 2  # columns in which a point at an edge may fall on either surface


def noise(sigma):
    return lambda image, random: image + random.normal(0, sigma, image.shape)


def defocus(sigma):
    return lambda image, random: cv2.GaussianBlur(image, (0, 0), sigma)


def motion(pixels):
    """The mean over a way along the row of so many pixels, in eighths."""
    def blurred(image, random):
        steps = 8 * pixels
        kernel = np.zeros(2 * pixels + 3)
        for step in range(steps):
            at = ((step + 0.5) / steps - 0.5) * pixels + pixels + 1
            kernel[int(at)] += (1 - at % 1) / steps
            kernel[int(at) + 1] += (at % 1) / steps
        return cv2.filter2D(image, -1, kernel[None], borderType=cv2.BORDER_REPLICATE)
    return blurred


def jpeg(quality):
    def compressed(image, random):
        whole = np.clip(np.rint(image), 0, 255).astype(np.uint8)
        return cv2.imdecode(cv2.imencode(".jpg", whole, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], 0)
    return compressed


def banded(gain):
    """Taken so dark that only a part of the levels is used, and made bright again."""
    return lambda image, random: np.floor(image / gain) * gain


KINDS = [("as they are", lambda image, random: image)]
KINDS += [(f"noise, σ {sigma} gray levels", noise(sigma)) for sigma in (2, 4, 8)]
KINDS += [(f"defocus, σ {sigma:g} px", defocus(sigma)) for sigma in (0.5, 1, 2)]
KINDS += [(f"motion blur along the row, {pixels} px", motion(pixels)) for pixels in (2, 4)]
KINDS += [("JPEG, quality 60", jpeg(60)), ("64 gray levels instead of 256", banded(4))]


def degrade(scene, folder, degradation):
    """Writes the scene with its views degraded, and its truth as it is."""
    description = json.loads((scene / "scene.json").read_text())
    random = np.random.default_rng(SEED)
    for name in [view["file"] for view in description["views"]]:
        image = cv2.imread(str(scene / name), cv2.IMREAD_GRAYSCALE).astype(np.float32)
        degraded = np.clip(np.rint(degradation(image, random)), 0, 255).astype(np.uint8)
        cv2.imwrite(str(folder / name), degraded)
    for truth in description.get("ground_truth", []):
        shutil.copy(scene / truth["file"], folder)
    shutil.copy(scene / "scene.json", folder)


def matched(arguments, folder):
    """The points that tricurve finds: columns x, y and disparity."""
    recording, points = folder / "scene.mcap", folder / "points.csv"
    run = [arguments.tricurve, "run", "--source", folder, "--views", arguments.views, "--scans", "1", "--force",
           "--record", recording, "--set", "match.reference=left", "--json"]
    for setting in arguments.set:
        run += ["--set", setting]
    ran = subprocess.run(run, capture_output=True, text=True)
    if ran.returncode != 0:
        sys.exit(f"{folder.name}: {ran.stderr}")
    export = [arguments.tricurve, "export", recording, "--scan", "0", "--csv", points]
    subprocess.run(export, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with open(points, newline="") as file:
        rows = list(csv.DictReader(file))
    return [np.array([float(row[key]) for row in rows]) for key in ("x", "y", "disparity")]


def errors(x, y, disparity, truth):
    """Of every point the least distance to the truth within a few columns; infinite where none is known."""
    height, width = truth.shape
    column = np.clip(np.round(x).astype(int), NEAR, width - 1 - NEAR)
    row = np.clip(np.round(y).astype(int), 0, height - 1)
    near = np.stack([truth[row, column + k] for k in range(-NEAR, NEAR + 1)])
    return np.where(near > 0, np.abs(disparity[None] - near), np.inf).min(0)


def bad(error):
    known = error[np.isfinite(error)]
    return float((known > 1).mean()) if len(known) else float("nan")


def semi_global(reference, neighbour, most):
    levels = int(np.ceil((most + 2) / 16) * 16)
    matcher = cv2.StereoSGBM_create(0, levels, 5, 200, 800, 1, 63, 10, 100, 2, cv2.STEREO_SGBM_MODE_SGBM)
    return matcher.compute(reference, neighbour).astype(np.float32) / 16


def figures(arguments, scene, folder):
    views = [int(view) for view in arguments.views.split(",")]
    description = json.loads((scene / "scene.json").read_text())
    file = lambda view: description["views"][view]["file"]
    place = lambda view: description["views"][view]["position_steps"]
    step = place(views[1]) - place(views[0])
    of_truth = next(truth["file"] for truth in description["ground_truth"] if truth["view"] == views[0])
    truth = cv2.imread(str(scene / of_truth), cv2.IMREAD_UNCHANGED).astype(np.float32) / 256 * step
    clean = cv2.imread(str(scene / file(views[0])), cv2.IMREAD_GRAYSCALE)
    edges = (cv2.Canny(clean, 40, 100, L2gradient=True) > 0) & (truth > 0)
    x, y, disparity = matched(arguments, folder)
    error = arguments.errors(x, y, disparity, truth)
    column = np.clip(np.round(x).astype(int), 0, truth.shape[1] - 1)
    row = np.clip(np.round(y).astype(int), 0, truth.shape[0] - 1)
    hit = np.zeros(truth.shape, np.uint8)
    hit[row, column] = 1
    covered = float((cv2.dilate(hit, np.ones((3, 3), np.uint8))[edges] > 0).mean())
    pictures = [cv2.imread(str(folder / file(view)), cv2.IMREAD_GRAYSCALE) for view in views]
    dense = semi_global(pictures[0], pictures[1], truth.max())
    there = dense[row, column]
    at_ours = arguments.errors(x, y, there, truth)[there > 0]
    rows, columns = np.nonzero(edges & (dense > 0))
    own = arguments.errors(columns, rows, dense[rows, columns], truth)
    return covered, bad(error), bad(at_ours), len(rows) / max(edges.sum(), 1), bad(own)


def errors_of(script):
    """The points' errors by a scoring script's own function."""
    spec = importlib.util.spec_from_file_location("score", script)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    def theirs(x, y, disparity, truth):
        error, known = module.truth_error(x, y, disparity, truth)
        return np.where(known, error, np.inf)
    return theirs


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tricurve")
    parser.add_argument("scenes_folder", type=pathlib.Path)
    parser.add_argument("--score")
    parser.add_argument("--scenes", default=SCENES)
    parser.add_argument("--views", default="1,3,5")
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    arguments.errors = errors_of(arguments.score) if arguments.score else errors
    kinds = [kind for kind in KINDS if kind[0].startswith(tuple(arguments.only) or "")]
    if not arguments.json:
        print(f"| {'images':<32} | coverage | bad-1.0 | SGBM there | SGBM: coverage | bad-1.0 |")
        print("| --- | --- | --- | --- | --- | --- |")
    table = {}
    for name, degradation in kinds:
        results = []
        for scene in arguments.scenes.split(","):
            with tempfile.TemporaryDirectory() as folder:
                degrade(arguments.scenes_folder / scene, pathlib.Path(folder), degradation)
                results.append(figures(arguments, arguments.scenes_folder / scene, pathlib.Path(folder)))
        covered, ours, at_ours, sgbm_covered, sgbm = np.nanmean(results, axis=0)
        table[name] = dict(coverage=covered, bad_1=ours, sgbm_there=at_ours, sgbm_coverage=sgbm_covered,
                           sgbm_bad_1=sgbm)
        if not arguments.json:
            print(f"| {name:<32} | {covered:.3f} | {100 * ours:.2f} % | {100 * at_ours:.2f} % | {sgbm_covered:.3f} |"
                  f" {100 * sgbm:.2f} % |", flush=True)
    if arguments.json:
        print(json.dumps(table))


if __name__ == "__main__":
    main()
