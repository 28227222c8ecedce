#!/usr/bin/env python3
"""Read a recording as a stranger would, decode every message, and compare its points with an exported CSV.

usage: foreign.py FILE.mcap [POINTS.csv [OTHER.mcap]]

Knows nothing of tricurve but what the file says of itself: protobuf and JSON schemas, field names, comments, strides.
Every curve's point is the edge of its pixel, every point of a match that of its curve, every result one of a match. The
edges of OTHER, a recording of the same scans, are the same to the bit. Prints a line a topic; ends with 1 at the first
thing that is not as it should be.
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


EDGE = np.dtype([('x', '<f4'), ('y', '<f4'), ('magnitude', '<f4'), ('orientation', '<f4'), ('profile', 'u1', 8)])
OFFSETS = np.array([-6, -4, -2.5, -1.25, 1.25, 2.5, 4, 6])


def edges_of(message, image, topic):
    """Edges, from their columns as the schema's comments describe them, or as they are."""
    rows = packed(message.edges)
    if len(rows):
        edges = np.zeros(len(rows), EDGE)
        for name in ('x', 'y', 'magnitude', 'orientation'):
            edges[name] = rows[name]
        edges['profile'] = np.stack([rows[f'profile_{i}'] for i in range(8)], 1)
        return edges
    counts, gaps = np.array(message.counts, int), np.array(message.gaps, int)
    parts = np.frombuffer(message.parts, 'u1').astype(int)
    edges = np.zeros(len(parts), EDGE)
    expect(counts.sum() == len(gaps) == len(parts), f'{topic}: counts')
    row = np.repeat(np.arange(len(counts)), counts)
    passed = np.cumsum((gaps >> 1) + 1)
    before = np.concatenate([[0], passed])[np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(int)]
    column = passed - before[row] - 1 if len(row) else passed
    down = gaps & 1
    expect(np.all(column < message.image_width) and np.all(row < message.image_height), f'{topic}: outside')
    edges['x'], edges['y'] = column + parts * (1 - down) / 256, row + parts * down / 256
    edges['magnitude'] = np.frombuffer(message.magnitudes, '<u2') / 256
    turned = np.frombuffer(message.orientations, '<i2').astype(int)
    turned[turned == -32768] = 32768
    edges['orientation'] = turned.astype('f4') * np.float32(np.pi / 32768)
    if message.profiles or not len(edges):
        edges['profile'] = np.frombuffer(message.profiles, 'u1').reshape(-1, 8)
        return edges
    expect(image is not None, f'{topic}: no profiles, and no image that they follow from')
    height, width = image.shape
    rows = image.astype(int)
    padded = np.pad(rows, ((1, 1), (0, 0)), 'edge')
    steady = (padded[:-2] + 2 * rows + padded[2:] + 2) >> 2
    of = np.minimum(row + (parts * down >= 128), height - 1)
    places = (column * 256 + parts * (1 - down))[:, None] + (OFFSETS * 256).astype(int)
    k, f = places >> 8, places & 255
    at = lambda k: steady[of[:, None], np.clip(k, 0, width - 1)]
    edges['profile'] = (at(k) * (256 - f) + at(k + 1) * f + 128) >> 8
    return edges


def points_of(curves, edges, topic):
    """The edges that curves go through, and how many belong to each."""
    if len(curves.points.data):
        rows = packed(curves.points)
        return np.stack([rows['x'], rows['y']], 1), [c.count for c in curves.curves] or list(curves.counts)
    if len(curves.edges):
        chosen = edges[np.array(curves.edges)]
        return np.stack([chosen['x'], chosen['y']], 1), [c.count for c in curves.curves]
    counts, width = np.array(curves.counts, int), curves.image_width
    steps = np.frombuffer(curves.steps, 'u1').astype(int)
    expect(len(steps) == counts.sum() - len(counts) and len(curves.starts) == len(counts), f'{topic}: steps')
    signed = lambda four: (four ^ 8) - 8
    walked = np.zeros((counts.sum(), 2), int)
    first = np.cumsum(counts) - counts
    rest = np.ones(len(walked), bool)
    rest[first] = False
    walked[rest] = np.stack([signed(steps & 15), signed(steps >> 4)], 1)
    starts = np.cumsum(np.array(curves.starts, int))
    walked = np.cumsum(walked, 0)
    curve = np.repeat(np.arange(len(counts)), counts)
    walked += (np.stack([starts % width, starts // width], 1) - walked[first])[curve] if len(first) else 0
    by_pixel = {(int(e['x']), int(e['y'])): (e['x'], e['y']) for e in edges}
    expect(all((x, y) in by_pixel for x, y in walked.tolist()), f'{topic}: a point that is no edge')
    return np.array([by_pixel[x, y] for x, y in walked.tolist()]).reshape(-1, 2), list(counts)


def runs(rows, points, what):
    """Every row's points exist."""
    expect(all(r.first + r.count <= points for r in rows), f'{what} without points')


def edges_in(path):
    """The edges of every scan and topic of a recording."""
    found, images = {}, {}
    with open(path, 'rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory(), JsonDecoders()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            view = channel.topic.split('/')[1] if '/' in channel.topic else ''
            if channel.topic == f'camera/{view}/image':
                images[message.sequence, view] = pixels_of(decoded)
            elif schema.name == 'tricurve.Edges':
                key = message.sequence, view
                found[message.sequence, channel.topic] = edges_of(decoded, images.get(key), channel.topic)
    return found


def pixels_of(image):
    return np.frombuffer(image.data, 'u1').reshape(image.height, image.step)[:, :image.width]


def main(path, csv_path, other_path):
    topics = collections.Counter()
    schemas, images, annotations, points = {}, {}, {}, []
    frames, used_frames = {}, set()
    scan, same_scan = None, {}
    curve_points, indexed = {}, {}
    pixels, edges, walked, matched = {}, {}, {}, {}
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
                    if topic.startswith('camera/') and topic.endswith('/image'):
                        pixels[key] = pixels_of(decoded)
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
                case 'tricurve.Edges':
                    edges[message.sequence, topic] = edges_of(decoded, pixels.get(key), topic)
                case 'tricurve.Curves':
                    # Points are walks over edges, or stand here where some are no edges.
                    of_curves = edges.get((message.sequence, topic.replace('curves/', 'edges/')), np.zeros(0, EDGE))
                    places, counts = points_of(decoded, of_curves, topic)
                    expect(sum(counts) == len(places), f'{topic} without points')
                    walked[message.sequence, topic] = places
                    curve_points[message.sequence, topic.removeprefix('curves/')] = len(places)
                    of_each = (decoded.parents, decoded.x, decoded.y, decoded.magnitude, decoded.length)
                    expect(decoded.curves or {*map(len, of_each)} == {len(counts)}, f'{topic}: columns')
                case 'tricurve.Tables':
                    entries = len(decoded.points) or len(packed(decoded.entries))
                    runs(decoded.tables, entries, topic)
                    if not decoded.rows_follow:
                        expect(len(decoded.rows) == decoded.image_height + 1, f'{topic}: rows')
                        # Where no order is said it is that of the curves' points.
                        indexed[message.sequence, topic.removeprefix('tables/')] = decoded.rows[-1], len(decoded.order)
                case 'tricurve.Matches':
                    matched[message.sequence, topic.removeprefix('matches/')] = decoded
                    runs(decoded.matches, len(decoded.gaps) or len(packed(decoded.points)), topic)
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
    for frame in used_frames:
        at = frame
        while at in frames:
            at = frames[at]
        expect(at == 'world', f'frame {frame} hangs on {at}')
    results = {scan: {(p['u'], p['v'], p['disparity']) for p in cloud} for scan, cloud in points}
    for scan, of_scan in results.items():
        channels = [(key, m) for key, m in matched.items() if key[0] == scan]
        if channels:
            there = set().union(*(places_of(m, walked, key) for key, m in channels))
            expect(of_scan <= there, f'scan {scan}: {len(of_scan - there)} points of no match')
    compared = compare(points, csv_path) if csv_path else 0
    if other_path:
        others = edges_in(other_path)
        expect(edges and others.keys() == edges.keys(), f'edges of {len(edges)} and of {len(others)} messages')
        for key, of_other in others.items():
            expect(of_other.tobytes() == edges[key].tobytes(), f'{key}: other edges in {other_path}')
    width = max(map(len, topics))
    for topic in sorted(topics):
        print(f'{topic:<{width}}  {schemas[topic]:<26} {topics[topic]:>6}')
    print(f'ok: {sum(topics.values())} messages of {len(topics)} topics; {compared} points equal the CSV')


def places_of(matches, walked, key):
    """Column, row and disparity of every point of a channel's matches."""
    rows = packed(matches.points)
    if len(rows) or not len(matches.gaps):
        return {(p['x'], p['y'], p['disparity']) for p in rows}
    views = {matches.frame_id.removesuffix('_optical')}
    places = walked[key[0], f'curves/{views.pop()}/{key[1]}']
    at = np.cumsum((np.array(matches.gaps, int) >> 1) + 1) - 1
    chosen, disparities = places[at], np.array(matches.disparities, 'f4')
    return {(x, y, d) for (x, y), d in zip(chosen, disparities)}


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
    if len(sys.argv) not in (2, 3, 4):
        sys.exit(__doc__)
    main(*sys.argv[1:], *[None] * (4 - len(sys.argv)))
