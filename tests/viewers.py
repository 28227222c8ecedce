#!/usr/bin/env python3
"""Look at tricurve as a viewer of another make would, over Foxglove's WebSocket, and misbehave as some do.

usage: viewers.py TRICURVE [FOLDER]

Starts graphs and recordings of the built-in scenes with the program TRICURVE, connects, decodes every topic by what is
advertised, turns parameters, calls services, seeks, and then sends what no viewer should. Writes into FOLDER (a
temporary one). Ends with 1 at the first thing that is not as it should be.
Needs: pip install websockets mcap-protobuf-support
"""
import atexit, base64, collections, json, os, re, signal, socket, struct, subprocess, sys, tempfile, threading, time

try:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from websockets.exceptions import WebSocketException
    from websockets.sync.client import connect
except ImportError as missing:
    sys.exit(f'{missing.name} is missing: pip install websockets mcap-protobuf-support')

PROTOCOL = 'foxglove.sdk.v1'


def expect(condition, what):
    if not condition:
        sys.exit(f'viewers.py: {what}')


def opened(address, protocols, **options):
    """A connection, whatever of the library's versions gives it."""
    # Who does not listen for a while hears no answer to a ping, and that is no fault of the server.
    return connect(address, subprotocols=protocols, ping_interval=None, **options).__enter__()


def decoder(channel):
    """What makes a message of the bytes, by nothing but what the server advertises."""
    if channel['encoding'] == 'json':
        json.loads(channel['schema'])
        return json.loads
    files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel['schema']))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel['schemaName']))
    return kind.FromString


def stamped(message):
    """A protobuf message's own time in nanoseconds, if it has one."""
    stamp = getattr(message, 'timestamp', None)
    return stamp.seconds * 10**9 + stamp.nanos if hasattr(stamp, 'seconds') else None


class Viewer:
    """A client of the WebSocket, with what it has heard."""

    def __init__(self, address):
        self.socket = opened(address, [PROTOCOL], max_size=None)
        self.channels, self.services, self.status, self.parameters = {}, {}, [], {}
        self.graph, self.playback, self.answers, self.info = None, None, {}, None
        self.messages = []
        self.times = []
        self.topics = {}

    def hear(self, seconds=0.05):
        """Take in one message, if one comes."""
        try:
            message = self.socket.recv(timeout=seconds)
        except TimeoutError:
            return False
        if isinstance(message, str):
            self.told(json.loads(message))
            return True
        if message[0] == 1:
            subscription, nanos = struct.unpack_from('<IQ', message, 1)
            channel = self.topics[subscription]
            self.messages.append((channel['topic'], nanos, message[13:], channel))
        elif message[0] == 2:
            self.times.append(struct.unpack_from('<Q', message, 1)[0])
        elif message[0] == 3:
            service, call, length = struct.unpack_from('<III', message, 1)
            self.answers[call] = json.loads(message[13 + length:])
        elif message[0] == 5:
            status, nanos, speed, sought = struct.unpack_from('<BQfB', message, 1)
            self.playback = (status, nanos, speed, bool(sought))
        return True

    def told(self, said):
        match said['op']:
            case 'serverInfo':
                self.info = said
            case 'advertise':
                self.channels.update({c['topic']: c for c in said['channels']})
            case 'advertiseServices':
                self.services.update({s['name']: s for s in said['services']})
            case 'parameterValues':
                self.parameters.update({p['name']: p.get('value') for p in said['parameters']})
            case 'status':
                self.status.append(said)
            case 'connectionGraphUpdate':
                self.graph = said
            case 'serviceCallFailure':
                self.answers[said['callId']] = said
            case other:
                expect(other in ('unadvertise', 'removeStatus'), f'an unknown word: {said}')

    def quiet(self):
        """Let what is on its way come, and forget it."""
        while self.hear(0.5):
            pass
        self.messages.clear()

    def until(self, condition, what, seconds=60):
        deadline = time.monotonic() + seconds
        while not condition():
            expect(time.monotonic() < deadline, f'{what}: not within {seconds} s; {self.status[-3:]}')
            self.hear()

    def say(self, **words):
        self.socket.send(json.dumps(words))

    def subscribe(self, topics):
        for topic in topics:
            channel = self.channels[topic]
            channel.setdefault('decode', decoder(channel))
            self.topics[len(self.topics) + 1] = channel
            self.say(op='subscribe', subscriptions=[{'id': len(self.topics), 'channelId': channel['id']}])

    def set(self, request, **values):
        before = len(self.status)
        parameters = [{'name': name.replace('__', '.'), 'value': value} for name, value in values.items()]
        self.say(op='setParameters', parameters=parameters, id=request)
        return before

    def call(self, name, number):
        service = self.services[name]
        body = b'{}'
        self.socket.send(b'\x02' + struct.pack('<III', service['id'], number, 4) + b'json' + body)
        self.until(lambda: number in self.answers, name)
        return self.answers.pop(number)

    def play(self, is_playing, speed=1.0, seek=None, request='r'):
        self.playback = None
        word = request.encode()
        self.socket.send(b'\x03' + struct.pack('<BfBQI', 0 if is_playing else 1, speed, seek is not None, seek or 0,
                                               len(word)) + word)
        self.until(lambda: self.playback is not None, 'an answer to playback control')
        return self.playback

    def decoded(self, topic):
        return [(nanos, c['decode'](data)) for name, nanos, data, c in self.messages if name == topic]

    def close(self):
        self.socket.close()


class Process:
    """tricurve, with what it says."""

    def __init__(self, *words, cwd):
        self.child = subprocess.Popen([TRICURVE, *words], cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                      text=True)
        # Whatever ends this script, nothing of what it started goes on.
        atexit.register(self.child.kill)
        self.said = []
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        for line in self.child.stdout:
            self.said.append(line)

    def address(self):
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            found = re.search(r'ws://\S+', ''.join(self.said))
            if found:
                return found.group()
            expect(self.child.poll() is None, ''.join(self.said))
            time.sleep(0.05)
        sys.exit(f'viewers.py: no address: {self.said}')

    def end(self, code=0):
        if self.child.poll() is None:
            self.child.send_signal(signal.SIGINT)
        got = self.child.wait(timeout=120)
        self.reader.join(timeout=10)
        expect(got == code, f'ended with {got}, not {code}: {"".join(self.said)}')
        return ''.join(self.said)


def greeted(process):
    viewer = Viewer(process.address())
    viewer.until(lambda: viewer.info and viewer.channels, 'a greeting')
    # Before anything is subscribed to: viewers take what comes before the first time for something of 1970.
    viewer.until(lambda: viewer.times, 'the time')
    expect(min(viewer.times) > 10**18, f'the time is {viewer.times}')
    for _ in range(20):
        viewer.hear()
    return viewer


def every_topic_is_there(viewer, what):
    """Subscribe to all, decode all, and hold every message against its scan's time."""
    viewer.subscribe(sorted(viewer.channels))
    seen = collections.Counter()

    def complete():
        while viewer.messages:
            topic, nanos, data, channel = viewer.messages.pop()
            message = channel['decode'](data)
            seen[topic] += 1
            expect(stamped(message) in (None, nanos), f'{topic} is stamped otherwise than sent')
        return set(seen) >= set(viewer.channels)
    viewer.until(complete, f'{what}: every topic; missing {sorted(set(viewer.channels) - set(seen))}', 90)
    print(f'{what}: {len(seen)} topics, {sum(seen.values())} messages decoded')


def scans_of(viewer, topic, count):
    viewer.messages.clear()
    viewer.until(lambda: sum(name == topic for name, *_ in viewer.messages) >= count, f'{count} of {topic}')
    return [message for _, message in viewer.decoded(topic)]


def is_silent(viewer):
    """Whether no points come for a second, once what was on its way is here."""
    for _ in range(2):
        viewer.messages.clear()
        time.sleep(1)
        while viewer.hear():
            pass
    return not [m for m in viewer.messages if m[0] == 'points']


def live(folder):
    # One scene with matches that score less: of the fence nearly all score highest.
    process = Process('run', '--source', 'scene:screwdriver', '--view', '--set', 'bridge.port=0', '--scans', '100000',
                      '--record', 'live.mcap',
                      '--profile', 'thesis', '--set', 'record.without=["edges", "curves", "tables"]', cwd=folder)
    viewer = greeted(process)
    wanted = {'time', 'parameters', 'parametersSubscribe', 'services', 'connectionGraph'}
    expect(wanted <= set(viewer.info['capabilities']), f'capabilities: {viewer.info["capabilities"]}')
    every_topic_is_there(viewer, 'live')

    viewer.say(op='subscribeConnectionGraph')
    viewer.until(lambda: viewer.graph, 'the connection graph')
    published = {t['name']: t['publisherIds'] for t in viewer.graph['publishedTopics']}
    expect(published['points'] == ['match'], f'points come from {published["points"]}')

    viewer.say(op='getParameters', parameterNames=[], id='all')
    viewer.until(lambda: 'match.curves.score' in viewer.parameters, 'parameters')
    score = viewer.parameters['match.curves.score']
    finest = min(c for c in viewer.channels if c.startswith('matches/'))
    scores = lambda: [m.score for scan in scans_of(viewer, finest, 8) for m in scan.matches]
    before = scores()
    expect(min(before) < 0.999, f'no match scores lower than {min(before)}: nothing to be stricter with')
    viewer.set('strict', match__curves__score=0.999)
    viewer.until(lambda: viewer.parameters['match.curves.score'] == 0.999, 'match.curves.score set')
    # Scans under way, in the graph and on their way here, were still matched by the score before.
    for _ in range(8):
        after = scores()
        if after and min(after) >= 0.999:
            break
    expect(after and min(after) >= 0.999, f'long after match.curves.score = 0.999 a match scores {min(after, default=None)}')
    print(f'live: match.curves.score {score} -> 0.999: the lowest of a match {min(before):.3f} -> {min(after):.3f}')

    for values, why in (({'match__curves__score': 7.0}, 'between 0 and 1'), ({'match__curves__score': 'high'}, 'match.curves.score'),
                        ({'filter__channels': [3.0]}, 'cannot be changed'), ({'no__such': 1.0}, 'no node'),
                        ({'match__curves__score': None}, '')):
        count = viewer.set('bad', **values)
        viewer.until(lambda: len(viewer.status) > count, f'a refusal of {values}')
        expect(why in viewer.status[-1]['message'], f'{values}: {viewer.status[-1]}')
    viewer.say(op='getParameters', parameterNames=['match.curves.score'], id='one')
    for _ in range(20):
        viewer.hear()
    expect(viewer.parameters['match.curves.score'] == 0.999, 'a refused value was kept')

    # A whole number as many viewers write it, and as it was offered.
    least = viewer.parameters['track.min_points']
    count = viewer.set('whole', track__min_points=float(least) + 1.0)
    viewer.until(lambda: viewer.parameters['track.min_points'] == least + 1, 'a whole number set')
    viewer.set('back', track__min_points=float(least))
    viewer.until(lambda: viewer.parameters['track.min_points'] == least, 'a whole number set back')
    expect(len(viewer.status) == count, f'a whole number was refused: {viewer.status[count:]}')

    expect(viewer.call('tricurve/pause', 1) == {'text': 'paused'}, 'pause')
    expect(viewer.call('tricurve/pause', 10) == {'text': 'it was paused already'}, 'pause again')
    expect(is_silent(viewer), 'a paused graph sends points')
    refused = viewer.call('tricurve/snapshot', 2)
    expect('paused' in refused.get('message', ''), f'a snapshot of a paused graph: {refused}')

    # A source that takes the place of one that died plays as that one was told to.
    subprocess.run([TRICURVE, 'node', 'restart', 'capture'], cwd=folder, check=True, capture_output=True)
    def is_back():
        listed = subprocess.run([TRICURVE, 'node', 'list', '--json'], cwd=folder, check=True, capture_output=True)
        source = json.loads(listed.stdout)[0]
        return source['restarts'] == 1 and source['state'] == 'running'
    viewer.until(is_back, 'capture is there again')
    expect(is_silent(viewer), 'a paused graph sends points after a restart')
    expect(viewer.call('tricurve/pause', 11) == {'text': 'it was paused already'}, 'pause after a restart')
    expect('text' in viewer.call('tricurve/resume', 3), 'resume')
    scans_of(viewer, 'points', 2)
    snapshot = viewer.call('tricurve/snapshot', 4)
    expect(os.path.getsize(os.path.join(folder, snapshot['text'])) > 10000, f'snapshot: {snapshot}')
    viewer.close()
    said = process.end()
    expect('match.curves.score is 0.999 from scan' in said, said)
    again = subprocess.run([TRICURVE, 'replay', 'live.mcap', '--verify', '--scans', '0..60'], cwd=folder,
                           capture_output=True, text=True)
    expect(again.returncode == 0, again.stdout[-500:] + again.stderr[-500:])
    print('live: services; the recording with its changed parameter verifies')


def played(folder):
    subprocess.run([TRICURVE, 'run', '--scans', '24', '--record', 'play.mcap'], cwd=folder, check=True,
                   capture_output=True)
    checked = subprocess.run([TRICURVE, 'view', 'play.mcap', '--check'], cwd=folder, capture_output=True, text=True)
    expect(checked.returncode == 0, checked.stdout + checked.stderr)
    print('played:', checked.stdout.strip())
    process = Process('view', 'play.mcap', '--port', '0', '--start-paused', cwd=folder)
    viewer = greeted(process)
    expect('playbackControl' in viewer.info['capabilities'], 'no playback control')
    start, end = (viewer.info[key]['sec'] * 10**9 + viewer.info[key]['nsec']
                  for key in ('dataStartTime', 'dataEndTime'))
    viewer.subscribe(['camera/left/image', 'camera/left/annotations', 'points', 'curves/left/0.8', 'statistics'])
    # Paused, the first scan is there at once.
    viewer.until(lambda: len({m[0] for m in viewer.messages}) == 5, 'the first scan while it is paused')
    expect({m[1] for m in viewer.messages} == {start}, 'more than the first scan')
    scans = {}
    for step in (17, 3, 23, 0):
        viewer.quiet()
        nanos = start + (end - start) * step // 23 + 1000
        status, *_ = viewer.play(False, seek=nanos)
        expect(status == 1, f'sought in while paused, its state is {status}')
        viewer.until(lambda: len({m[0] for m in viewer.messages}) == 5, f'scan {step} after a seek')
        expect(len({m[1] for m in viewer.messages}) == 1, f'scan {step} is shown together with others')
        number = viewer.decoded('statistics')[0][1]['scan']
        scans[step] = number
        for topic in ('camera/left/image', 'camera/left/annotations', 'points'):
            sent, message = viewer.decoded(topic)[0]
            expect(stamped(message) == sent, f'{topic} is stamped otherwise than the scan')
    expect(scans == {step: step for step in scans}, f'sought scans: {scans}')
    for nanos, where in ((start - 10**12, start), (end + 10**12, end)):
        _, there, _, sought = viewer.play(False, seek=nanos)
        expect((there, sought) == (where, True), f'sought beyond the recording it is at {there}, not {where}')
    viewer.quiet()
    # Of many seeks at once the last one counts.
    for step in range(200):
        viewer.socket.send(b'\x03' + struct.pack('<BfBQI', 1, 1.0, True, start + (end - start) * (step % 24) // 23 + 1000, 0))
    viewer.quiet()
    viewer.play(False, seek=start + (end - start) * 7 // 23 + 1000)
    viewer.until(lambda: [m for _, m in viewer.decoded('statistics') if m['scan'] == 7], 'the last of many seeks')
    other = greeted(process)
    other.until(lambda: other.playback, 'a word to who comes of how it plays')
    expect(other.playback[0] == 1, f'who comes is told {other.playback}')
    other.close()
    viewer.quiet()
    began = time.monotonic()
    viewer.play(True, speed=0.5, seek=start)
    viewer.until(lambda: viewer.playback and viewer.playback[0] == 3, 'the end')
    slow = time.monotonic() - began
    # What is said of the playing overtakes what is played.
    viewer.until(lambda: viewer.messages[-1][1] == end, 'the last scan')
    while viewer.hear(0.3):
        pass
    numbers = [m['scan'] for _, m in viewer.decoded('statistics')]
    expect(numbers == list(range(24)), f'played: {numbers}')
    began = time.monotonic()
    viewer.play(True, speed=2.0, seek=start)
    viewer.playback = None
    viewer.until(lambda: viewer.playback and viewer.playback[0] == 3, 'the end')
    fast = time.monotonic() - began
    recorded = (end - start) / 1e9
    expect(2 * recorded - 0.2 < slow < 2 * recorded + 3 and recorded / 2 - 0.2 < fast < slow,
           f'{recorded} s took {slow} and {fast} s')
    print(f'played: {recorded:.2f} s at half the rate {slow:.2f} s, at twice {fast:.2f} s; seeks show one scan')
    viewer.quiet()
    viewer.play(False, seek=start)
    every_topic_at_the_end(viewer)
    viewer.close()
    process.end()
    late(folder)
    replay = Process('replay', 'play.mcap', '--view', '--set', 'bridge.port=0', '--rate', '1', '--loop', cwd=folder)
    viewer = greeted(replay)
    expect('playbackControl' in viewer.info['capabilities'], 'no playback control of a replay')
    viewer.subscribe(['statistics', 'camera/centre/image'])
    first = scans_of(viewer, 'statistics', 2)
    viewer.play(False)
    while viewer.hear(3):
        pass
    viewer.quiet()
    viewer.play(False, seek=start + (end - start) // 2)
    viewer.until(lambda: viewer.decoded('statistics'), 'the scan that was sought in the replay')
    nanos, _ = viewer.decoded('statistics')[0]
    expect(abs(nanos - (start + end) / 2) < (end - start) / 20, 'another scan of the replay than was sought')
    viewer.until(lambda: viewer.playback[1] == nanos, 'a word of where it is')
    expect(viewer.playback[0] == 1, f'sought in while it is paused it is {viewer.playback}')
    # Once it is seen where it is nothing else is said.
    viewer.quiet()
    expect(viewer.playback[1] == nanos, f'it is said to be at {viewer.playback[1]}, and is at {nanos}')
    newcomer = greeted(replay)
    newcomer.until(lambda: newcomer.playback, 'a word to who comes of how a replay plays')
    expect(newcomer.playback[:2] == (1, nanos), f'who comes is told {newcomer.playback}')
    newcomer.close()
    viewer.play(True, speed=2.0)
    expect(len(scans_of(viewer, 'statistics', 2)) >= 2, 'it goes on')
    viewer.close()
    replay.end()
    print('replayed: paused, sought in, and played on at another rate')


def late(folder):
    """Who subscribes two seconds after the start sees all, and pages of strangers see nothing."""
    process = Process('view', 'play.mcap', '--port', '0', '--origin', 'https://viewer.example', cwd=folder)
    viewer = greeted(process)
    time.sleep(2)
    viewer.subscribe(['statistics'])
    viewer.until(lambda: viewer.playback and viewer.playback[0] == 3, 'the end')
    while viewer.hear(0.3):
        pass
    numbers = [m['scan'] for _, m in viewer.decoded('statistics')]
    expect(sorted(set(numbers)) == list(range(24)), f'who comes late has seen {numbers}')
    viewer.close()
    for origin, status in (('https://viewer.example', 101), ('http://localhost:8080', 101),
                           ('https://app.foxglove.dev', 101), ('https://evil.example', 403), ('null', 403)):
        try:
            opened(process.address(), [PROTOCOL], max_size=None, additional_headers={'Origin': origin}).close()
            seen = 101
        except WebSocketException as refused:
            seen = refused.response.status_code
        expect(seen == status, f'{origin} got {seen}')
    process.end()
    expect(any('https://evil.example wanted to look' in line for line in process.said),
           f'nothing was said of strangers: {process.said}')
    print('late: all 24 scans; pages of strangers are refused')


def every_topic_at_the_end(viewer):
    """What is said every second stands with the last scan too, and a line of the log with one scan only: so slowly that none is
    left out."""
    viewer.subscribe(sorted(set(viewer.channels) - {c['topic'] for c in viewer.topics.values()}))
    viewer.play(True, speed=0.1, seek=None)
    seen = {}

    def complete():
        for topic, nanos, data, channel in viewer.messages:
            channel['decode'](data)
            seen[topic] = True
        viewer.messages.clear()
        return set(seen) >= set(viewer.channels)
    viewer.until(complete, 'every topic of the recording')
    print(f'played: {len(seen)} topics decoded')


def memory(pid):
    """Megabytes of its own: what the graph shares is the same whoever looks at it."""
    status = open(f'/proc/{pid}/status').read()
    parts = [int(re.search(rf'{part}:\s+(\d+)', status).group(1)) / 1024 for part in ('VmRSS', 'RssShmem')]
    return parts[0] - parts[1]


def bridge_of(process):
    """The process that serves viewers, a child of the launcher."""
    for pid in filter(str.isdigit, os.listdir('/proc')):
        try:
            parent = open(f'/proc/{pid}/stat').read().rsplit(')', 1)[1].split()[1]
            words = open(f'/proc/{pid}/cmdline').read().split('\0')
        except OSError:
            continue
        if int(parent) == process.child.pid and 'bridge' in words:
            return int(pid)
    sys.exit('viewers.py: the run has no bridge')


def misbehaving(folder):
    taken = socket.socket()
    taken.bind(('127.0.0.1', 0))
    taken.listen()
    port = taken.getsockname()[1]
    for words, how in ((['view', 'play.mcap', '--port', str(port)], '--port'),
                       (['run', '--view', '--no-record', '--scans', '2', '--set', f'bridge.port={port}'], 'bridge.port')):
        ended = subprocess.run([TRICURVE, *words], cwd=folder, capture_output=True, text=True)
        expect(ended.returncode == 1 and 'is taken' in ended.stderr and how in ended.stderr, f'{words}: {ended}')
    print('misbehaving: a port that is taken is told, with what to change')

    process = Process('run', '--view', '--set', 'bridge.port=0', '--scans', '100000', '--no-record', '--profile',
                      'thesis', cwd=folder)
    address = process.address()
    host, port = address.removeprefix('ws://').split(':')
    good = greeted(process)
    good.subscribe(['statistics'])
    scans_of(good, 'statistics', 2)
    pid = bridge_of(process)
    before = memory(pid)

    # Other subprotocols, and none.
    for protocols in (['foxglove.websocket.v1'], ['nonsense'], None):
        try:
            opened(address, protocols).close()
            sys.exit(f'viewers.py: the subprotocol {protocols} was taken')
        except WebSocketException as refused:
            print(f'misbehaving: subprotocol {protocols}: {str(refused)[:60]}')
    # No WebSocket at all.
    for words in (b'GET / HTTP/1.1\r\n\r\n', b'\x00' * 100000, b'\x16\x03\x01\x02\x00'):
        with socket.create_connection((host, int(port))) as raw:
            raw.settimeout(5)
            try:
                raw.sendall(words)
                raw.recv(1000)
            except OSError:
                pass
    # Garbage, unknown things, and too much of them.
    bad = Viewer(address)
    bad.until(lambda: bad.info and bad.channels, 'a greeting')
    for words in ('', '{', '[]', '{"op":"dance"}', '{"op":"subscribe"}', '"x"', 'null', '\u0000' * 1000,
                  json.dumps({'op': 'subscribe', 'subscriptions': [{'id': 1, 'channelId': 10**9}]}),
                  json.dumps({'op': 'subscribe', 'subscriptions': [{'id': -1, 'channelId': 'x'}]}),
                  json.dumps({'op': 'unsubscribe', 'subscriptionIds': [4, 5, 6]}),
                  json.dumps({'op': 'setParameters', 'parameters': [{'name': '../../etc/passwd', 'value': '; rm -rf /'}]}),
                  json.dumps({'op': 'fetchAsset', 'uri': 'file:///etc/passwd', 'requestId': 1}),
                  json.dumps({'op': 'advertise', 'channels': [{'id': 1, 'topic': 'x', 'encoding': 'json',
                                                               'schemaName': ''}]})):
        bad.socket.send(words)
    for words in (b'', b'\x00', b'\x01', b'\x02\xff\xff\xff\xff', b'\x03' * 9, b'\xff' * 1000, b'\x02' + b'\x00' * 12):
        bad.socket.send(words)
    bad.subscribe(['points'])
    bad.subscribe(['points'])
    bad.until(lambda: any(m[0] == 'points' for m in bad.messages), 'points in spite of garbage')
    try:
        bad.socket.send(b'\x01' * (80 << 20))
    except (WebSocketException, OSError):
        pass
    try:
        bad.close()
    except (WebSocketException, OSError):
        pass
    flood = Viewer(address)
    flood.until(lambda: flood.info, 'a greeting')
    sent = 0
    try:
        for sent in range(3000):
            flood.set(f'{sent}', match__curves__score=0.4 + 0.1 * (sent % 2))
        flood.close()
    except (WebSocketException, OSError):
        print(f'misbehaving: who floods is sent away after {sent} parameters')
    scans_of(good, 'statistics', 2)
    print(f'misbehaving: garbage, unknown ids, a huge message and 3000 parameters; memory {before:.0f} -> '
          f'{memory(pid):.0f} MB')

    # Many that come and go.
    for _ in range(5):
        crowd = [Viewer(address) for _ in range(10)]
        for one in crowd:
            one.until(lambda: one.channels, 'a greeting')
            one.subscribe(['camera/left/image', 'points'])
        for one in crowd:
            one.socket.socket.shutdown(socket.SHUT_RDWR)
    scans_of(good, 'statistics', 2)
    print(f'misbehaving: 50 viewers that vanish; memory {memory(pid):.0f} MB')

    # One that stands still.
    still = subprocess.Popen([sys.executable, __file__, '--stare', address], stdout=subprocess.PIPE, text=True)
    expect(still.stdout.readline() == 'staring\n', 'a viewer sees nothing')
    still.send_signal(signal.SIGSTOP)
    good.messages.clear()
    began, most = time.monotonic(), 0
    while time.monotonic() - began < STILL:
        good.hear()
        most = max(most, memory(pid))
    count = len(good.decoded('statistics'))
    still.kill()
    still.wait()
    expect(count > STILL, f'{count} scans in {STILL} s beside a viewer that stands still')
    expect(most < 256, f'{most:.0f} MB beside a viewer that stands still')
    good.close()
    said = process.end()
    expect('too slow' in said and 'balanced' in said, said)
    missed = re.search(r'did not get (\d+) of', said)
    expect(missed and int(missed.group(1)) > 0, said)
    print(f'misbehaving: a viewer stopped for {STILL} s: {count} scans for the other one, {missed.group(1)} missed, '
          f'at most {most:.0f} MB')


def stare(address):
    viewer = Viewer(address)
    viewer.until(lambda: viewer.channels, 'a greeting')
    viewer.subscribe(sorted(viewer.channels))
    viewer.until(lambda: viewer.messages, 'something')
    print('staring', flush=True)
    while True:
        viewer.hear()


if __name__ == '__main__':
    if sys.argv[1:2] == ['--stare']:
        stare(sys.argv[2])
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    TRICURVE = os.path.abspath(sys.argv[1])
    STILL = float(os.environ.get('STILL_SECONDS', '15'))
    with tempfile.TemporaryDirectory() as folder:
        folder = sys.argv[2] if len(sys.argv) == 3 else folder
        for part in (live, played, misbehaving):
            part(folder)
    print('viewers.py: all is as it should be')
