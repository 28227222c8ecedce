"""Boards that OpenCV draws, seen by cameras as OpenCV projects them: `tricurve calibrate` against the truth and OpenCV.

    python tests/boards.py target/debug/tricurve [FOLDER]

Chessboards and ChArUco boards, partly outside of the picture, with noise, seen by one camera and by a rig of three whose
lenses distort. Prints what each says and fails where `tricurve` is wrong. With a FOLDER the pictures stay there.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

SIZE = (640, 480)
STEP = 0.06
# Samples along each side of a pixel, and pixels a square when a board is drawn.
SAMPLES = 3
DRAWN = 80


def rotation(*degrees):
    return cv2.Rodrigues(np.radians(np.array(degrees, float)))[0]


def camera(focal, centre, lens, turn, place):
    matrix = np.array([[focal[0], 0, centre[0]], [0, focal[1], centre[1]], [0, 0, 1.0]])
    turn = rotation(*turn)
    return dict(matrix=matrix, lens=np.array(lens), turn=turn, shift=-turn @ np.array([place, 0, 0.0]))


def rays(camera):
    """The direction of every sample of every pixel, in the camera's own frame."""
    side = np.arange(SAMPLES) / SAMPLES + 0.5 / SAMPLES - 0.5
    u = (np.arange(SIZE[0])[:, None] + side).ravel()
    v = (np.arange(SIZE[1])[:, None] + side).ravel()
    places = np.stack(np.meshgrid(u, v), -1).reshape(-1, 1, 2)
    done = cv2.undistortPointsIter(
        places, camera["matrix"], camera["lens"], np.eye(3), np.eye(3), (cv2.TERM_CRITERIA_COUNT, 20, 0)
    ) if hasattr(cv2, "undistortPointsIter") else cv2.undistortPoints(places, camera["matrix"], camera["lens"])
    return np.concatenate([done.reshape(-1, 2), np.ones((len(done), 1))], 1)


def seen(camera, directions, drawing, square, turn, middle, noise):
    """The picture of a drawn board whose middle is at `middle` and whose axes are the columns of `turn`."""
    turn, middle = camera["turn"] @ turn, camera["turn"] @ middle + camera["shift"]
    # Of points on the board, in its own frame: ray * far = turn @ (x, y, 0) + middle.
    inverse = np.linalg.inv(np.column_stack([turn[:, 0], turn[:, 1], middle]))
    on = directions @ inverse.T
    on = on[:, :2] / on[:, 2:]
    height, width = drawing.shape
    at = on / square * DRAWN + np.array([width - 1, height - 1]) / 2
    shape = (SIZE[1] * SAMPLES, SIZE[0] * SAMPLES)
    parts = [at[:, axis].reshape(shape).astype(np.float32) for axis in range(2)]
    fine = cv2.remap(drawing, *parts, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=90)
    picture = fine.reshape(SIZE[1], SAMPLES, SIZE[0], SAMPLES).mean((1, 3))
    picture = 20 + picture * 0.8 + noise.normal(0, 1.5, picture.shape)
    return np.clip(np.round(picture), 0, 255).astype(np.uint8)


def places(count, wide):
    """Where a board is held: all over the picture, tilted to all sides."""
    part = lambda i, way: (i * way) % 1.0 * 2 - 1
    for i in range(count):
        tilts = [35 * part(i, 0.4142), 35 * part(i, 0.2361), 15 * part(i, 0.3028)]
        far = 0.62 + 0.14 * part(i, 0.618)
        yield rotation(*tilts), np.array([STEP + wide * part(i, 0.7549), 0.7 * wide * part(i, 0.5698), far])


def plain(columns, rows):
    squares = np.indices((rows + 1, columns + 1)).sum(0) % 2 * 255
    drawing = np.kron(squares, np.ones((DRAWN, DRAWN))).astype(np.uint8)
    return cv2.copyMakeBorder(drawing, DRAWN, DRAWN, DRAWN, DRAWN, cv2.BORDER_CONSTANT, value=255)


def marked(board, columns, rows):
    drawing = board.generateImage((columns * DRAWN, rows * DRAWN), marginSize=0)
    return cv2.copyMakeBorder(drawing, DRAWN, DRAWN, DRAWN, DRAWN, cv2.BORDER_CONSTANT, value=255)


def calibrated(program, folder, *arguments):
    run = [program, "calibrate", str(folder), "--json", "--output", str(folder) + ".yaml", "--force"]
    done = subprocess.run(run + ["--picture", str(folder) + ".svg", *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def opencv(folder, find):
    """What OpenCV makes of one camera's pictures."""
    objects, images = [], []
    for path in sorted(folder.iterdir()):
        found = find(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
        if found is not None:
            objects.append(found[0].astype(np.float32))
            images.append(found[1].astype(np.float32))
    rms, matrix, lens, *_ = cv2.calibrateCamera(objects, images, SIZE, None, None, flags=cv2.CALIB_FIX_K3)
    return rms, matrix, lens.ravel(), len(images)


def find_plain(columns, rows, square):
    grid = np.zeros((columns * rows, 3))
    grid[:, :2] = np.indices((rows, columns))[::-1].reshape(2, -1).T * square

    def find(image):
        ok, corners = cv2.findChessboardCornersSB(image, (columns, rows))
        return (grid, corners) if ok else None

    return find


def find_marked(board):
    detector = cv2.aruco.CharucoDetector(board)

    def find(image):
        corners, ids, _, _ = detector.detectBoard(image)
        if ids is None or len(ids) < 8:
            return None
        return board.getChessboardCorners()[ids.ravel()].reshape(-1, 1, 3), corners

    return find


def check(name, ours, theirs, truth, most):
    focal, centre = ours["focal_px"]["values"], ours["centre_px"]["values"]
    true = truth["matrix"]
    rms, matrix, _, used = theirs
    off = [focal[0] - true[0, 0], focal[1] - true[1, 1], centre[0] - true[0, 2], centre[1] - true[1, 2]]
    their = [matrix[0, 0] - true[0, 0], matrix[1, 1] - true[1, 1], matrix[0, 2] - true[0, 2], matrix[1, 2] - true[1, 2]]
    shown = lambda values: " ".join(f"{value:+.2f}" for value in values)
    print(f"{name}: f and c off by {shown(off)} px, {ours['images_used']} images, rms {ours['rms_px']:.3f} px;"
          f" OpenCV {shown(their)} px, {used} images, rms {rms:.3f} px")
    assert max(map(abs, off)) < most, name
    # Standard deviations say how far off it may be.
    stds = ours["focal_px"]["std"] + ours["centre_px"]["std"]
    assert all(abs(o) < 5 * std for o, std in zip(off, stds)), (name, off, stds)


def main(program, folder):
    noise = np.random.default_rng(1)
    lens = [-0.21, 0.07, 0.0006, -0.0009]
    cameras = {
        "left": camera((612, 613), (322, 236), lens, (2, -1, 2), 0.0),
        "centre": camera((607, 607.5), (316, 243), [-0.19, 0.05, -0.0005, 0.0007], (-1, 2, -1), STEP),
        "right": camera((615, 614), (325, 239), lens, (1, 1, 1.5), 2 * STEP),
    }
    directions = {name: rays(one) for name, one in cameras.items()}

    # A rig and a chessboard: by folders of cameras.
    square = 0.027
    drawing = plain(9, 6)
    for number, (turn, middle) in enumerate(places(26, 0.17)):
        for name, one in cameras.items():
            (folder / "rig" / name).mkdir(parents=True, exist_ok=True)
            picture = seen(one, directions[name], drawing, square, turn, middle, noise)
            cv2.imwrite(str(folder / "rig" / name / f"{number:03}.png"), picture)
    rig = calibrated(program, folder / "rig", "--board", "9x6", "--square", str(square))
    assert [one["name"] for one in rig["cameras"]] == list(cameras)
    for one in rig["cameras"]:
        theirs = opencv(folder / "rig" / one["name"], find_plain(9, 6, square))
        check(f"chessboard, {one['name']}", one, theirs, cameras[one["name"]], 1.0)
    for beside in rig["beside"]:
        first, second = (cameras[name] for name in beside["between"])
        turned = first["turn"] @ second["turn"].T
        angle = np.degrees(np.arccos((turned[2, 2])))
        print(f"{beside['between']}: {beside['apart_m'] * 1e3:.3f} mm apart, turned {beside['turned_degrees']:.3f}° (true {angle:.3f}°), rows p95 {beside['rows_p95_px']:.3f} px")
        assert abs(beside["apart_m"] - STEP) < 0.0002 and abs(beside["turned_degrees"] - angle) < 0.1
        assert beside["rows_p95_px"] < 0.35, beside

    # One camera and a ChArUco board that is often partly outside: images in one folder.
    columns, rows, square, marker = 8, 6, 0.042, 0.031
    name = "DICT_5X5_100"
    board = cv2.aruco.CharucoBoard((columns, rows), square, marker, cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)))
    drawing = marked(board, columns, rows)
    alone = folder / "alone"
    alone.mkdir(exist_ok=True)
    for number, (turn, middle) in enumerate(places(24, 0.26)):
        picture = seen(cameras["left"], directions["left"], drawing, square, turn, middle, noise)
        cv2.imwrite(str(alone / f"frame{number:03}.png"), picture)
    arguments = ["--board", f"{columns}x{rows}", "--square", str(square), "--marker", str(marker), "--dictionary", name]
    (one,) = calibrated(program, alone, *arguments)["cameras"]
    check("ChArUco", one, opencv(alone, find_marked(board)), cameras["left"], 1.0)
    whole = one["images_used"] * (columns - 1) * (rows - 1)
    assert one["corners_used"] < whole, "boards were to be partly outside"


if __name__ == "__main__":
    if len(sys.argv) > 2:
        main(sys.argv[1], Path(sys.argv[2]))
    else:
        with tempfile.TemporaryDirectory() as folder:
            main(sys.argv[1], Path(folder))
