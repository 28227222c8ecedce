"""Bags as another program writes them: what `tricurve` makes of them, against the same images in a folder.

    python tests/bags.py target/debug/tricurve [FOLDER]

Three cameras in every encoding and container, with jitter, images that are missing and camera_info; a camera along a rail
with Odometry. Prints what each gives and fails where it is wrong. With a FOLDER the bags stay there.
Needs: pip install rosbags numpy opencv-python-headless
"""

import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPES = get_typestore(Stores.ROS2_JAZZY)
START = 1_700_000_000_000_000_000
MS = 1_000_000
SIDES = ("left", "centre", "right")
WIDTH, HEIGHT = 320, 240
# Wall and cards: top, left, height, width, pixels a step.
CARDS = [(0, -200, HEIGHT, WIDTH + 400, 4.0), (30, 40, 90, 100, 9.0), (110, 150, 100, 110, 12.5)]
FOCAL, STEP = 500.0, 0.05


def texture(noise, height, width):
    out = np.zeros((height, width), np.float32)
    for scale in (2, 4, 8, 16):
        small = noise.standard_normal((height // scale + 3, width // scale + 3)).astype(np.float32)
        out += cv2.resize(small, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)[:height, :width] * scale**0.5
    return (out - out.mean()) / out.std()


def seen(place, seed=1):
    """What a camera sees from so many steps to the right, as gray levels with fractions."""
    noise = np.random.default_rng(seed)
    picture, columns = np.zeros((HEIGHT, WIDTH)), np.arange(WIDTH, dtype=float)
    for top, left, height, width, disparity in CARDS:
        drawn = texture(noise, height, width)
        at = columns + place * disparity - left
        inside = (at >= 0) & (at < width - 1)
        first = np.clip(np.floor(at).astype(int), 0, width - 2)
        part = at - first
        rows = drawn[:, first] * (1 - part) + drawn[:, first + 1] * part
        picture[top : top + height, inside] = rows[:, inside]
    return np.clip(120 + 38 * picture, 0, 255)


def header(nanos, frame):
    stamp = TYPES.types["builtin_interfaces/msg/Time"](sec=nanos // 10**9, nanosec=nanos % 10**9)
    return TYPES.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def encoded(gray, encoding):
    """Levels of 8 bit as an encoding's bytes, and bytes a row."""
    byte = np.rint(gray).astype(np.uint8)
    deep = byte.astype(np.uint16) * 257
    if encoding.startswith("bayer"):
        data = deep if encoding.endswith("16") else byte
    elif encoding in ("mono8", "8UC1"):
        data = byte
    elif encoding in ("mono16", "16UC1"):
        data = deep
    else:
        data = np.repeat(byte[:, :, None], 4 if "a8" in encoding else 3, axis=2)
    # Rows are padded, as cameras align them.
    flat = np.ascontiguousarray(data).reshape(HEIGHT, -1).view(np.uint8)
    padded = np.pad(flat, ((0, 0), (0, 12)))
    return padded.ravel(), padded.shape[1]


def image(nanos, frame, gray, encoding):
    data, step = encoded(gray, encoding)
    return TYPES.types["sensor_msgs/msg/Image"](
        header=header(nanos, frame), height=HEIGHT, width=WIDTH, encoding=encoding, is_bigendian=0, step=step, data=data
    )


def compressed(nanos, frame, gray, ending):
    data = cv2.imencode(ending, np.rint(gray).astype(np.uint8))[1].ravel()
    return TYPES.types["sensor_msgs/msg/CompressedImage"](header=header(nanos, frame), format=ending[1:], data=data)


def camera_info(nanos, frame, view):
    region = TYPES.types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    k = [FOCAL, 0, WIDTH / 2, 0, FOCAL, HEIGHT / 2, 0, 0, 1]
    p = [FOCAL, 0, WIDTH / 2, -FOCAL * STEP * view, 0, FOCAL, HEIGHT / 2, 0, 0, 0, 1, 0]
    return TYPES.types["sensor_msgs/msg/CameraInfo"](
        header=header(nanos, frame), height=HEIGHT, width=WIDTH, distortion_model="plumb_bob", d=np.zeros(5),
        k=np.array(k, float), r=np.eye(3).ravel(), p=np.array(p, float), binning_x=0, binning_y=0, roi=region,
    )


def odometry(nanos, place):
    t = TYPES.types
    pose = t["geometry_msgs/msg/Pose"](
        position=t["geometry_msgs/msg/Point"](x=place * 0.8, y=place * 0.6, z=0.2),
        orientation=t["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    )
    still = t["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    return t["nav_msgs/msg/Odometry"](
        header=header(nanos, "odom"), child_frame_id="base",
        pose=t["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
        twist=t["geometry_msgs/msg/TwistWithCovariance"](
            twist=t["geometry_msgs/msg/Twist"](linear=still, angular=still), covariance=np.zeros(36)
        ),
    )


def write(folder, messages, plugin, mode=None):
    """Writes messages of (topic, when it was recorded, message) as a bag."""
    writer = Writer(folder, version=9, storage_plugin=plugin)
    if mode:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        known = {}
        for topic, nanos, message in sorted(messages, key=lambda one: one[1]):
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(known[topic], nanos, TYPES.serialize_cdr(message, kind))
    return folder


def tricurve(program, folder, *arguments, code=0):
    ran = subprocess.run([program, *arguments], capture_output=True, text=True, cwd=folder)
    assert ran.returncode == code, f"{arguments} ended with {ran.returncode}, not {code}\n{ran.stdout}\n{ran.stderr}"
    return ran.stdout + ran.stderr


def points(program, folder, source, *arguments):
    """Runs a source, checks that its recording replays to the same bytes, and gives its points and what was said."""
    name = "run.mcap"
    said = tricurve(program, folder, "run", "--source", str(source), "--record", name, "--force", *arguments)
    tricurve(program, folder, "replay", name, "--verify")
    tricurve(program, folder, "export", name, "--csv", "points.csv")
    with open(Path(folder) / "points.csv", newline="") as file:
        return list(csv.reader(file)), said


def rig(way, scans=3, name="image_rect", infos=True):
    messages, noise = [], np.random.default_rng(7)
    for scan in range(scans):
        for view, side in enumerate(SIDES):
            nanos = START + scan * 100 * MS + int(noise.uniform(-4, 4) * MS)
            recorded = nanos + int(noise.uniform(1, 30) * MS)
            messages.append((f"/{side}/{name}", recorded, way(nanos, side, view)))
            if infos:
                messages.append((f"/{side}/camera_info", recorded, camera_info(nanos, side, view)))
    return messages


def main(program, folder):
    program, folder = str(Path(program).resolve()), folder.resolve()
    views = [seen(view) for view in range(3)]
    pictures = folder / "pictures"
    for scan in range(3):
        (pictures / f"scan{scan}").mkdir(parents=True, exist_ok=True)
        for side, gray in zip(SIDES, views):
            cv2.imwrite(str(pictures / f"scan{scan}" / f"{side}.png"), np.rint(gray).astype(np.uint8))
    known = ["--set", f"capture.focal={FOCAL}", "--set", f"capture.baseline={STEP}"]
    known += ["--set", f"capture.cx={WIDTH / 2}", "--set", f"capture.cy={HEIGHT / 2}"]
    expected, _ = points(program, folder, pictures, *known)
    assert len(expected) > 3000, f"{len(expected)} points in a folder"
    print(f"folder: {len(expected) - 1} points")

    # Containers, with camera_info instead of settings.
    plain = lambda nanos, side, view: image(nanos, side, views[view], "mono8")
    message, file, storage = CompressionMode.MESSAGE, CompressionMode.FILE, CompressionMode.STORAGE
    for plugin in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
        for mode in [None, message, file, storage] if plugin == StoragePlugin.MCAP else [None, message, file]:
            bag = folder / f"{plugin.name}_{mode.name if mode else 'plain'}".lower()
            write(bag, rig(plain), plugin, mode)
            if mode == file:
                said = tricurve(program, folder, "run", "--source", str(bag), code=1)
                assert "zstd -d" in said, said
                for packed in bag.glob("*.zstd"):
                    unpack(packed)
            found, said = points(program, folder, f"bag:{bag}")
            assert found == expected, f"{bag.name}: {len(found)} rows, {len(expected)} expected\n{said}"
            print(f"{bag.name}: the same {len(found) - 1} points")

    # Encodings.
    for encoding in ("8UC1", "mono16", "16UC1", "rgb8", "bgr8", "rgba8", "bgra8"):
        bag = write(folder / encoding, rig(lambda n, side, v: image(n, side, views[v], encoding)), StoragePlugin.MCAP)
        found, said = points(program, folder, bag)
        assert found == expected, f"{encoding}: {len(found)} rows, {len(expected)} expected\n{said}"
        print(f"{encoding}: the same {len(found) - 1} points")
    png = lambda nanos, side, view: compressed(nanos, side, views[view], ".png")
    found, said = points(program, folder, write(folder / "png", rig(png, name="image_rect/compressed"), StoragePlugin.MCAP))
    assert found == expected, f"png: {len(found)} rows, {len(expected)} expected\n{said}"
    jpeg = lambda nanos, side, view: compressed(nanos, side, views[view], ".jpg")
    found, _ = points(program, folder, write(folder / "jpeg", rig(jpeg, name="image_rect/compressed"), StoragePlugin.MCAP))
    assert abs(len(found) / len(expected) - 1) < 0.1, f"jpeg: {len(found)} rows, {len(expected)} expected"
    print(f"png: the same; jpeg: {len(found) - 1} points")
    for pattern in ("rggb", "bggr", "gbrg", "grbg"):
        for bits in (8, 16):
            encoding = f"bayer_{pattern}{bits}"
            bag = write(folder / encoding, rig(lambda n, side, v: image(n, side, views[v], encoding)), StoragePlugin.MCAP)
            found, said = points(program, folder, bag)
            # Interpolated colours are a little smoother than the levels themselves.
            assert abs(len(found) / len(expected) - 1) < 0.25, f"{encoding}: {len(found)} rows, {len(expected)} expected\n{said}"
            print(f"{encoding}: {len(found) - 1} points")

    # Images that are missing: counted, and the others are what they were.
    messages = rig(plain, scans=20, infos=False)
    gone = [n for n in (4, 17, 18, 19, 40) if messages.pop(n)]
    said = tricurve(program, folder, "run", "--source", str(write(folder / "gaps", messages, StoragePlugin.MCAP)), "--no-record", "--json")
    summary = json.loads(said[said.index("{") : said.rindex("}") + 1])
    account = summary["synchronisation"]
    for camera in account["cameras"]:
        whole = camera["matched"] + camera["late"] + sum(camera["dropped"].values()) + camera["waiting"]
        assert camera["received"] == whole, camera
    received = sum(camera["received"] for camera in account["cameras"])
    assert received == 60 - len(gone) and summary["scans"] == account["scans"] < 20, account
    print(f"gaps: {received} images, {account['scans']} scans")

    # A rail with Odometry of its own rate, and the same frames in a folder with their places.
    frames, step = 16, 0.02
    messages = [("/camera/image_rect", START + n * 100 * MS, image(START + n * 100 * MS, "camera", seen(n * 0.5), "mono8")) for n in range(frames)]
    messages += [("/odom", START + n * 30 * MS, odometry(START + n * 30 * MS, n * 0.3 * step)) for n in range(-3, frames * 4)]
    bag = write(folder / "rail", messages, StoragePlugin.SQLITE3)
    passed = folder / "passed"
    passed.mkdir(exist_ok=True)
    for n in range(frames):
        cv2.imwrite(str(passed / f"{n:03}.png"), np.rint(seen(n * 0.5)).astype(np.uint8))
    (folder / "places.csv").write_text("position_m\n" + "".join(f"{n * step:.9f}\n" for n in range(frames)))
    rail = ["--set", "capture.mode=rail", "--set", f"capture.focal={FOCAL}"]
    rail += ["--set", f"capture.cx={WIDTH / 2}", "--set", f"capture.cy={HEIGHT / 2}"]
    by_file, _ = points(program, folder, passed, *rail, "--set", "capture.positions=places.csv")
    by_odometry, said = points(program, folder, bag, *rail, "--position", "/odom")
    assert "(0.8000, 0.6000, 0.0000)" in said, said
    assert len(by_file) == len(by_odometry) > 10000, f"{len(by_odometry)} rows, {len(by_file)} by a file"
    column = by_file[0].index("depth")
    depths = np.array([[float(rows[n][column]) for rows in (by_file, by_odometry)] for n in range(1, len(by_file))])
    off = np.abs(depths[:, 1] / depths[:, 0] - 1).max()
    assert off < 1e-5, f"depths differ by up to {off}"
    print(f"rail: {len(by_odometry) - 1} points, depths as by a file within {off:.1e}")

    # Half a bag is not taken for a whole one.
    (whole,) = (folder / "mcap_plain").glob("*.mcap")
    whole.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    said = tricurve(program, folder, "run", "--source", str(folder / "mcap_plain"), "--no-record", code=3)
    assert "damaged" in said and "torn" in said, said
    print("torn: read as far as it goes, exit code 3")


def unpack(path):
    try:
        from compression import zstd
    except ImportError:
        # What rosbags packs with where the standard library cannot.
        from backports import zstd
    path.with_suffix("").write_bytes(zstd.decompress(path.read_bytes()))
    path.unlink()


if __name__ == "__main__":
    if len(sys.argv) > 2:
        main(sys.argv[1], Path(sys.argv[2]))
    else:
        with tempfile.TemporaryDirectory() as folder:
            main(sys.argv[1], Path(folder))
