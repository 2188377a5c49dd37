#!/usr/bin/env python3
"""Prints figures of the code: lines by room, macros, circles of files, long functions and lines, packages.

Circles are found by tests/architecture.rs, which cargo compiles first: files of src/ that use one another, directly or
through others. Lines are those of files, comments and blank lines included.
"""

import argparse
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
SHADERS = {".glsl", ".vert", ".frag", ".rchit", ".rahit", ".rint", ".rmiss"}


def lines_of(path):
    return path.read_text().splitlines()


def files_of(folder, suffixes):
    return sorted(p for p in (ROOT / folder).rglob("*") if p.suffix in suffixes)


def lines_by_room():
    """Lines of each folder of src/, of the files beside lib.rs together, and of what is not in src/."""
    rooms = {}
    for path in files_of("src", {".rs"}):
        parts = path.relative_to(ROOT).parts
        room = "/".join(parts[:2]) if len(parts) > 2 else "src/*.rs"
        rooms[room] = rooms.get(room, 0) + len(lines_of(path))
    others = {"tests": {".rs"} | SHADERS, "shaders": SHADERS, "benches": {".rs", ".py"}, "examples": {".rs"}}
    rooms["src"] = sum(rooms.values())
    for folder, suffixes in others.items():
        rooms[folder] = sum(len(lines_of(p)) for p in files_of(folder, suffixes))
    return rooms


def functions_of(path):
    """Name, first line and number of lines of each function, by the indentation that rustfmt gives its end."""
    lines = lines_of(path)
    for first, line in enumerate(lines):
        found = re.match(r"( *)(?:pub(?:\([^)]*\))? )?(?:const |async |unsafe |extern \"C\" )*fn (\w+)", line)
        if found is None:
            continue
        end = next((i for i in range(first, len(lines)) if lines[i].startswith(found[1] + "}")), None)
        # one that has no body or is a line long ends where it begins
        if end is None or line.rstrip().endswith((";", "}")):
            end = first
        yield found[2], first + 1, end - first + 1


def circles():
    """Whether tests/architecture.rs allows all circles, and what it prints of them, the largest first."""
    command = ["cargo", "test", "--locked", "--test", "architecture", "circles_of_files", "--", "--nocapture"]
    run = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    found = re.findall(r"^circles? of .*$", run.stdout, re.MULTILINE)
    if not found:
        sys.exit("house.py: tests/architecture.rs did not run")
    return run.returncode == 0, found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="fail where tests/architecture.rs finds a circle too large")
    parser.add_argument("--no-circles", action="store_true", help="print the other figures only, without cargo")
    arguments = parser.parse_args()
    if arguments.check and arguments.no_circles:
        parser.error("--check is about circles: it cannot be given with --no-circles")

    print("lines")
    for room, lines in lines_by_room().items():
        print(f"  {room:20} {lines:7}")
    rust = files_of("src", {".rs"})
    macros = sum(len(re.findall(r"^\s*macro_rules! ", p.read_text(), re.MULTILINE)) for p in rust)
    print(f"macro_rules! in src: {macros}")

    functions = [(n, p.relative_to(ROOT), line, name) for p in rust for name, line, n in functions_of(p)]
    long = sorted((f for f in functions if f[0] > 100), reverse=True)
    print(f"functions of src over 100 lines: {len(long)} of {len(functions)}")
    for n, path, line, name in long:
        print(f"  {n:4} {name} ({path}:{line})")

    everything = [p for folder in ("src", "tests", "benches", "examples") for p in files_of(folder, {".rs"})]
    length, path, line = max((len(t), p, i + 1) for p in everything for i, t in enumerate(lines_of(p)))
    print(f"longest line of Rust: {length} columns ({path.relative_to(ROOT)}:{line})")
    print(f"packages in Cargo.lock: {(ROOT / 'Cargo.lock').read_text().count('[[package]]')}")

    if arguments.no_circles:
        return
    allowed, found = circles()
    print("\n".join(found))
    if arguments.check and not allowed:
        sys.exit("house.py: circles have too many files")


if __name__ == "__main__":
    main()
