#!/usr/bin/env python3
"""Run many scans and watch what a run holds on to, and whether it slows down.

usage: soak.py TRICURVE [--scans 2000] [further arguments of `tricurve run`]

Prints, of the second and of the last quarter of the scans: scans a second, and of every node its own memory (RssAnon, the
median of the samples, since how much is under way at a moment varies) and its file handles, and what was touched of the
run's shared memory, which is set aside before the start. Exits with 1 when the own memory of all together grew by over a
fiftieth, a node holds more files, the run slowed down by over a twentieth, or scans are missing in the ledger.

An hour's work in a quarter of one: soak.py TRICURVE --scans 20000 --profile thesis --delivery live --set capture.rate=25
--record soak.mcap --max-size 2000 --set 'record.without=["edges"]' takes at most 20 GB.
"""
import argparse, os, pathlib, statistics, subprocess, sys, tempfile, time


def nodes(run):
    """Process ids of the nodes that a launcher started, by name."""
    found = {"launcher": run}
    for pid in pathlib.Path(f"/proc/{run}/task/{run}/children").read_text().split():
        words = pathlib.Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        if len(words) > 2 and words[1] == b"_node":
            found[words[2].decode()] = pid
    return found


def anonymous(pid):
    for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("RssAnon:"):
            return int(line.split()[1]) / 1024
    return 0.0


def handles(pid):
    return len(os.listdir(f"/proc/{pid}/fd"))


def shared(run):
    files = [entry for entry in os.scandir("/dev/shm") if entry.name.startswith(f"tricurve_{run:x}-")]
    return sum(entry.stat().st_blocks * 512 for entry in files) / 1e6


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tricurve")
    parser.add_argument("--scans", type=int, default=2000)
    arguments, further = parser.parse_known_args()
    samples = []
    # Read by a handle of its own: one that is inherited shares its place in the file with whoever writes.
    with tempfile.NamedTemporaryFile("w") as written, open(written.name) as lines, tempfile.TemporaryFile("w+") as result:
        command = [arguments.tricurve, "run", "--scans", str(arguments.scans), *further]
        run = subprocess.Popen(command, stdout=result, stderr=written)
        said = ""
        while run.poll() is None:
            time.sleep(0.5)
            said = (said + lines.read())[-4000:]
            counts = [line.split("/")[0] for line in said.splitlines() if " scans, " in line and "/" in line]
            if not counts:
                continue
            try:
                pids = nodes(run.pid)
                held = {name: (anonymous(pid), handles(pid)) for name, pid in pids.items()}
                samples.append((time.monotonic(), int(counts[-1]), held, shared(run.pid)))
            except (FileNotFoundError, ProcessLookupError):
                pass
        if run.returncode != 0:
            sys.exit(f"the run failed: {said}")
        result.seek(0)
        table = result.read()
    quarters = [[s for s in samples if first <= 4 * s[1] / arguments.scans < first + 1] for first in (1, 3)]
    if any(len(quarter) < 4 for quarter in quarters):
        sys.exit("too few scans to see how memory goes: --scans 2000")
    speeds = [(q[-1][1] - q[0][1]) / (q[-1][0] - q[0][0]) for q in quarters]
    wrong = []
    print(f"{'':<12} {'quarter 2':>9} {'quarter 4':>9}")
    print(f"{'scans/s':<12} {speeds[0]:9.1f} {speeds[1]:9.1f}")
    if speeds[1] < 0.95 * speeds[0]:
        wrong.append("it slowed down")
    total = [0.0, 0.0]
    # The last sample may be of a run that is ending.
    for name in quarters[0][0][2]:
        there = [[s[2][name] for s in quarter if name in s[2]] for quarter in quarters]
        memory = [statistics.median(sample[0] for sample in quarter) if quarter else 0.0 for quarter in there]
        files = [max((sample[1] for sample in quarter), default=0) for quarter in there]
        total = [sum(pair) for pair in zip(total, memory)]
        print(f"{name:<12} {memory[0]:9.1f} {memory[1]:9.1f} MB {files[0]:6} {files[1]:6} files")
        if files[1] > files[0]:
            wrong.append(f"{name} holds more files")
    print(f"{'all':<12} {total[0]:9.1f} {total[1]:9.1f} MB")
    # Set aside before the start; a page counts once it has been touched.
    bus = [statistics.median(s[3] for s in quarter) for quarter in quarters]
    print(f"{'shared':<12} {bus[0]:9.1f} {bus[1]:9.1f} MB")
    if total[1] > 1.02 * total[0]:
        wrong.append("memory grew")
    ledger = next((line for line in table.splitlines() if line.startswith("ledger:")), "no ledger")
    print(ledger)
    if not ledger.endswith("; balanced"):
        wrong.append("the ledger is not balanced")
    if wrong:
        sys.exit(", ".join(wrong))


if __name__ == "__main__":
    main()
