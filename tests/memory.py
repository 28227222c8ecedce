#!/usr/bin/env python3
"""Run many scans and watch the memory of every node.

usage: memory.py TRICURVE [--scans 2000] [further arguments of `tricurve run`]

Prints the most that each node held of its own memory (RssAnon), and the run of shared memory, in the second and in the
last quarter of the scans, in MB: how many scans are under way at a moment varies, and with it what is held. Exits with 1
when the most of a node grew by more than a twentieth and a megabyte.
"""
import argparse, os, pathlib, subprocess, sys, tempfile, time


def nodes(run):
    """Process ids of the nodes that a launcher started, by name."""
    found = {}
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


def shared(run):
    files = [entry for entry in os.scandir("/dev/shm") if entry.name.startswith(f"tricurve_{run:x}-")]
    return sum(entry.stat().st_blocks * 512 for entry in files) / 1e6


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tricurve")
    parser.add_argument("--scans", type=int, default=2000)
    arguments, further = parser.parse_known_args()
    samples = []
    with tempfile.TemporaryFile("w+") as lines:
        command = [arguments.tricurve, "run", "--scans", str(arguments.scans), *further]
        run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=lines)
        done = 0
        while run.poll() is None:
            lines.seek(0)
            counts = [line.split("/")[0] for line in lines.read().splitlines() if " scans, " in line]
            done = int(counts[-1]) if counts else 0
            try:
                sample = {name: anonymous(pid) for name, pid in nodes(run.pid).items()}
                sample["shared"] = shared(run.pid)
                samples.append((done, sample))
            except (FileNotFoundError, ProcessLookupError):
                pass
            time.sleep(0.5)
        if run.returncode != 0:
            lines.seek(0)
            sys.exit(f"the run failed: {lines.read()}")
    quarters = [[sample for done, sample in samples if first <= 4 * done / arguments.scans < first + 1] for first in (1, 3)]
    if not all(quarters):
        sys.exit("too few scans to see how memory goes: --scans 2000")
    grown = []
    print(f"{'node':<10} {'quarter 2':>9} {'quarter 4':>9}")
    for name in quarters[0][0]:
        before, after = (max(sample.get(name, 0.0) for sample in quarter) for quarter in quarters)
        print(f"{name:<10} {before:9.1f} {after:9.1f}")
        if name != "shared" and after > 1.05 * before + 1.0:
            grown.append(name)
    if grown:
        sys.exit(f"grew: {', '.join(grown)}")


if __name__ == "__main__":
    main()
