#!/usr/bin/env python3
"""Run many scans and watch the memory of every node.

usage: memory.py TRICURVE [--scans 2000] [further arguments of `tricurve run`]

Prints each node's own memory (RssAnon) and the run's shared memory after a quarter of the scans and at the end, in MB.
Exits with 1 when a node grew by more than a twentieth and a megabyte meanwhile.
"""
import argparse, os, pathlib, subprocess, sys, tempfile, time


def nodes(run):
    """Process ids of the nodes that a launcher started, by name."""
    found = {}
    for pid in pathlib.Path(f"/proc/{run}/task/{run}/children").read_text().split():
        words = pathlib.Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        if len(words) > 2 and words[1] == b"node":
            found[words[2].decode()] = pid
    return found


def anonymous(pid):
    for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("RssAnon:"):
            return int(line.split()[1]) / 1024
    return 0.0


def shared(run):
    files = [entry for entry in os.scandir("/dev/shm") if entry.name.startswith(f"tricurve_{run}-")]
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
    begin = next(sample for done, sample in samples if 4 * done >= arguments.scans)
    end = max((sample for _, sample in samples[-8:]), key=len)
    grown = []
    print(f"{'node':<10} {'quarter':>9} {'end':>9}")
    for name in begin:
        before, after = begin[name], end.get(name, 0.0)
        print(f"{name:<10} {before:9.1f} {after:9.1f}")
        if name != "shared" and after > 1.05 * before + 1.0:
            grown.append(name)
    if grown:
        sys.exit(f"grew: {', '.join(grown)}")


if __name__ == "__main__":
    main()
