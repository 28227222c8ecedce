#!/usr/bin/env python3
"""Read a recording as a stranger would, decode every message, and compare its points with an exported CSV.

usage: foreign.py FILE.mcap [POINTS.csv]

Knows nothing of tricurve but what the file says of itself: protobuf and JSON schemas, field names, strides. Prints a
line a topic; ends with 1 at the first thing that is not as it should be.
Needs: pip install mcap mcap-protobuf-support numpy
"""
import collections, csv, json, sys

try:
    import numpy as np
    from mcap.decoder import DecoderFactory as Decoders
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory
except ImportError as missing:
    sys.exit(f'{missing.name} is missing: pip install mcap mcap-protobuf-support numpy')


class JsonDecoders(Decoders):
    def decoder_for(self, message_encoding, schema):
        return json.loads if message_encoding == 'json' else None


NUMBERS = {1: 'u1', 2: 'i1', 3: '<u2', 4: '<i2', 5: '<u4', 6: '<i4', 7: '<f4', 8: '<f8'}


def expect(condition, what):
    if not condition:
        sys.exit(f'foreign.py: {what}')


def nanos(stamp):
    return stamp.seconds * 1_000_000_000 + stamp.nanos


def table(fields, stride, data):
    """Packed memory as a numpy array with named columns."""
    expect(stride > 0 and len(data) % stride == 0, f'{len(data)} bytes are no rows of {stride}')
    return np.frombuffer(data, np.dtype({
        'names': [f.name for f in fields],
        'formats': [NUMBERS[f.type] for f in fields],
        'offsets': [f.offset for f in fields],
        'itemsize': stride,
    }))


def packed(section):
    if not section.data:
        return []
    return table(section.fields, section.stride, section.data)


def runs(rows, points, what):
    """Every row's points exist."""
    expect(all(r.first + r.count <= points for r in rows), f'{what} without points')


def main(path, csv_path):
    topics = collections.Counter()
    schemas, images, annotations, points = {}, {}, {}, []
    frames, used_frames = {}, set()
    scan, same_scan = None, {}
    curve_points, indexed = {}, {}
    with open(path, 'rb') as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory(), JsonDecoders()])
        expect(reader.get_summary() is not None, 'the file has no summary')
        names = [m.name for m in reader.iter_metadata()]
        expect('tricurve' in names, f'metadata is {names}')
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topic, time = channel.topic, message.log_time
            if message.sequence != scan:
                scan, same_scan = message.sequence, {}
            topics[topic] += 1
            schemas[topic] = schema.name
            expect(time == message.publish_time, f'{topic}: log_time is not publish_time')
            expect(time > 1_000_000_000_000_000_000, f'{topic}: its time is {time}')
            key = (message.sequence, topic.split('/')[1] if '/' in topic else '')
            if schema.encoding == 'jsonschema':
                expect(json.loads(schema.data)['type'] == 'object', f'{topic}: schema')
                expect(isinstance(decoded, dict), f'{topic}: {decoded}')
                continue
            if hasattr(decoded, 'timestamp') and topic != 'tf':
                expect(nanos(decoded.timestamp) == time, f'{topic}: timestamp is not log_time')
            if hasattr(decoded, 'frame_id'):
                expect(decoded.frame_id, f'{topic}: no frame')
                used_frames.add(decoded.frame_id)
            match schema.name:
                case 'foxglove.RawImage':
                    bytes_a_pixel = {'mono8': 1, '32FC1': 4, 'rgb8': 3}[decoded.encoding]
                    expect(decoded.step == decoded.width * bytes_a_pixel, f'{topic}: step')
                    expect(len(decoded.data) == decoded.step * decoded.height, f'{topic}: data')
                    if decoded.encoding in ('mono8', 'rgb8'):
                        images[key] = nanos(decoded.timestamp)
                case 'foxglove.PointCloud':
                    rows = table(decoded.fields, decoded.point_stride, decoded.data)
                    expect({'x', 'y', 'z'} <= set(rows.dtype.names), f'{topic}: {rows.dtype.names}')
                    if topic == 'points':
                        points.append((message.sequence, rows))
                    else:
                        same_scan[topic] = rows
                case 'foxglove.CameraCalibration':
                    expect((len(decoded.K), len(decoded.R), len(decoded.P)) == (9, 9, 12), f'{topic}: K, R, P')
                    expect(decoded.P[0] > 0 and decoded.P[5] > 0 and decoded.width > 0, f'{topic}: P')
                case 'foxglove.FrameTransforms':
                    for t in decoded.transforms:
                        frames[t.child_frame_id] = t.parent_frame_id
                        q = t.rotation
                        norm = q.x ** 2 + q.y ** 2 + q.z ** 2 + q.w ** 2
                        expect(abs(norm - 1) < 1e-9, f'{topic}: {t.child_frame_id} is not a rotation')
                case 'foxglove.ImageAnnotations':
                    drawn = [*decoded.points, *decoded.circles]
                    expect(all(d.thickness > 0 for d in drawn), f'{topic}: thickness')
                    expect(all(t.font_size > 0 and t.text for t in decoded.texts), f'{topic}: texts')
                    times = {nanos(a.timestamp) for a in (*drawn, *decoded.texts)}
                    if times:
                        annotations.setdefault(key, set()).update(times)
                case 'foxglove.Log':
                    expect(decoded.message, f'{topic}: an empty line')
                case 'tricurve.Curves':
                    # Points are named by their edges, or stand here where some are no edges.
                    of_curves = len(decoded.edges) or len(packed(decoded.points))
                    runs(decoded.curves, of_curves, topic)
                    curve_points[message.sequence, topic.removeprefix('curves/')] = of_curves
                case 'tricurve.Tables':
                    entries = len(decoded.points) or len(packed(decoded.entries))
                    runs(decoded.tables, entries, topic)
                    expect(len(decoded.rows) == decoded.image_height + 1, f'{topic}: rows')
                    # Where no order is said it is that of the curves' points.
                    indexed[message.sequence, topic.removeprefix('tables/')] = (decoded.rows[-1], len(decoded.order))
                case 'tricurve.Matches':
                    runs(decoded.matches, len(packed(decoded.points)), topic)
                    expect(all(r.reason > 0 for r in decoded.rejected), f'{topic}: no reason')
                case 'tricurve.Digests':
                    expect(decoded.algorithm == 'blake3-128', f'{topic}: {decoded.algorithm}')
                    named = [*decoded.messages, *decoded.settings]
                    expect(decoded.messages and all(d.name and len(d.digest) == 16 for d in named), f'{topic}: digests')
                case 'tricurve.Evaluation':
                    shares = [decoded.scores[0].coverage, *(step.bad_one for step in decoded.curve)]
                    expect(all(0 <= share <= 1 for share in shares), f'{topic}: shares {shares}')
                    expect(len(decoded.curve) == 20, f'{topic}: curve')
                case other:
                    expect(False, f'{topic}: unknown schema {other}')
    for key, times in annotations.items():
        expect(times == {images.get(key)}, f'annotations of {key}: {times}, the image {images.get(key)}')
    for key, (rows, order) in indexed.items():
        expect(rows == (order or curve_points[key]), f'tables {key}: {rows} points by row, {order}, {curve_points[key]} of curves')
    for frame in (f for f in used_frames if f.endswith('_optical')):
        at = frame
        while at in frames:
            at = frames[at]
        expect(at == 'world', f'frame {frame} hangs on {at}')
    compared = compare(points, csv_path) if csv_path else 0
    width = max(map(len, topics))
    for topic in sorted(topics):
        print(f'{topic:<{width}}  {schemas[topic]:<26} {topics[topic]:>6}')
    print(f'ok: {sum(topics.values())} messages of {len(topics)} topics; {compared} points equal the CSV')


def compare(points, csv_path):
    """Every point of every scan stands in the CSV, in order, to the last bit; gives their number."""
    with open(csv_path, newline='') as file:
        rows = list(csv.DictReader(file))
    scans = {int(row['scan']) for row in rows}
    wanted = [(scan, point) for scan, cloud in sorted(points, key=lambda p: p[0]) if scan in scans for point in cloud]
    expect(len(wanted) == len(rows), f'{len(wanted)} points recorded, {len(rows)} in the CSV')
    columns = dict(x='u', y='v', disparity='disparity', score='score', depth='z')
    for (scan, point), row in zip(wanted, rows):
        expect(scan == int(row['scan']) and point['curve'] == int(row['curve']), f'scan {scan}: {row}')
        for column, name in columns.items():
            expect(np.float32(row[column]) == point[name], f'scan {scan}, {column}: {row[column]} is not {point[name]}')
    return len(rows)


if __name__ == '__main__':
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2] if len(sys.argv) == 3 else None)
