#!/usr/bin/env python3
"""Measures how soon a command of skylit ends after Ctrl-C, and how often it shows progress.

  responsiveness.py interrupt [--every 0.3] [--most 60] -- skylit render scene.glb -o a.png
  responsiveness.py progress -- skylit render scene.glb -o a.png

`interrupt` runs the command again and again, each time interrupted a little later, until it ends by
itself. It prints the slowest ends, and fails for an exit code that is not 130 and for a file that
is left at the place of an output (the word after each -o).

`progress` runs the command once with a terminal as its stderr, and prints when it first wrote to it
and the longest time between two writes.
"""

import argparse
import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

INTERRUPTED = 130


def outputs(command):
    return [Path(after) for word, after in zip(command, command[1:]) if word == "-o"]


def interrupt(command, every, most):
    """Interrupts at multiples of `every` seconds. Returns an exit code."""
    ends, faults, k = [], [], 0
    while k * every <= most:
        k += 1
        for path in outputs(command):
            path.unlink(missing_ok=True)
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        try:
            process.communicate(timeout=k * every)
            break
        except subprocess.TimeoutExpired:
            pass
        start = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate()
        seconds = time.monotonic() - start
        ends.append((seconds, k * every))
        print(f"{k * every:.1f} s: ended {seconds:.2f} s later with code {process.returncode}", flush=True)
        if process.returncode == 0:
            continue  # it was about to end
        left = [str(path) for path in outputs(command) if path.exists()]
        if process.returncode != INTERRUPTED or left or b"interrupted" not in stderr:
            faults.append(f"after {k * every:.1f} s: exit code {process.returncode}, left {left}, {stderr[-200:]!r}")
    slowest = ", ".join(f"{seconds:.2f} s (at {at:.1f} s)" for seconds, at in sorted(ends, reverse=True)[:5])
    print(f"{len(ends)} interrupts; the slowest ends: {slowest}")
    print("\n".join(faults))
    return 1 if faults else 0


def progress(command):
    """Prints when a terminal is written to. Returns an exit code."""
    reader, terminal = pty.openpty()
    start = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=terminal)
    os.close(terminal)
    writes, text = [], b""
    while True:
        try:
            part = os.read(reader, 1 << 16)
        except OSError:
            break
        if not part:
            break
        writes.append(time.monotonic() - start)
        text += part
    code, end = process.wait(), time.monotonic() - start
    gaps = sorted(((b - a, a) for a, b in zip(writes, writes[1:] + [end])), reverse=True)
    first = f"{writes[0]:.2f} s" if writes else "never"
    print(f"first write after {first}, {len(writes)} writes in {end:.1f} s; the longest gaps:")
    print(", ".join(f"{gap:.2f} s (at {at:.1f} s)" for gap, at in gaps[:5]))
    words = {line.split(b"[")[0].strip(b"\r\x1b |/-\\").decode(errors="replace") for line in text.split(b"\x1b[2K")}
    print("\n".join(sorted(words)[:40]))
    return code


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["interrupt", "progress"])
    parser.add_argument("--every", type=float, default=0.3, help="seconds between interrupts")
    parser.add_argument("--most", type=float, default=60, help="the last interrupt, in seconds")
    parser.add_argument("command", nargs="+")
    args = parser.parse_args()
    if args.what == "interrupt":
        return interrupt(args.command, args.every, args.most)
    return progress(args.command)


if __name__ == "__main__":
    sys.exit(main())
