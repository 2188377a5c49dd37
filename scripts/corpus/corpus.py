#!/usr/bin/env python3
"""Runs skylit over a folder of models and sums up. Started by scripts/corpus.sh, which has the usage."""

import argparse
import collections
import concurrent.futures
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MODELS = {".gltf", ".glb", ".obj"}
# Exit codes of a program that says what is wrong (docs/reference/exit-codes.md); 70 is a bug, and so is an end by a signal.
REFUSALS = {2: "device", 3: "refused", 5: "out of memory", 64: "usage"}


def models(folder):
    """Models below a folder, in order; files of the same bytes once."""
    seen = set()
    for path in sorted(p for p in folder.rglob("*") if p.suffix.lower() in MODELS and p.is_file()):
        # the same text with other files beside it is another model
        key = hash((path.read_bytes(), "" if path.suffix.lower() == ".glb" else path.parent))
        if key not in seen:
            seen.add(key)
            yield path


def run(command, seconds, mebibytes):
    """Exit code (negative: a signal; None: it took too long), JSON record, last line of stderr, seconds."""

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (mebibytes << 20, mebibytes << 20))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    environment = {k: v for k, v in os.environ.items() if k != "RUST_BACKTRACE"} | {"XDG_CONFIG_HOME": "/nonexistent"}
    start = time.monotonic()
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=seconds, preexec_fn=limit, env=environment
        )
    except subprocess.TimeoutExpired:
        return None, {}, "", time.monotonic() - start
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    try:
        record = json.loads(done.stdout)
    except ValueError:
        record = {}
    return done.returncode, record if isinstance(record, dict) else {}, lines[-1] if lines else "", time.monotonic() - start


def reason(line, path):
    """What a message says without the names and numbers of its file, so that equal reasons are counted together."""
    text = line.removeprefix("skylit: error: ")
    for name in (str(path), path.name):
        text = text.replace(name, "FILE")
    text = re.sub(r"^(FILE|\S+\.(?:gltf|glb|obj|mtl|bin|png|jpe?g|tga|bmp)): ", "", text)
    text = re.sub(r"`[^`]*`|'[^']*'|\"[^\"]*\"", "NAME", text)
    text = re.sub(r"\S*/\S+", "NAME", text)
    return re.sub(r"\d+(\.\d+)?", "N", text)[:160]


def examine(path, arguments, folder):
    """Runs every command over a file and says what came of it."""
    image = folder / f"{os.getpid()}-{abs(hash(str(path)))}.png"
    commands = {
        "info": ["info", str(path), "--no-device", "--json"],
        "render": ["render", str(path), "--size", "64x48", "--spp", "4", "--json", "--no-config", "-o", str(image)],
    }
    commands["render"] += ["--time-limit", str(arguments.seconds / 2)]
    if arguments.stress:
        commands["stress"] = ["stress", str(path), "--quick", "--json"]
    result = {"file": str(path.relative_to(arguments.folder)), "bytes": path.stat().st_size}
    for name, command in commands.items():
        seconds = arguments.seconds * (6 if name == "stress" else 1)
        code, record, line, took = run([arguments.program, *command], seconds, arguments.memory)
        warnings = [str(w) for w in record.get("warnings", [])]
        entry = {"exit_code": code, "seconds": round(took, 3), "message": line, "warnings": warnings}
        if code is None:
            entry["verdict"] = "too long"
        elif code == 0:
            shown = [c for c in ("black", "white") if any(f"all but {c}" in w for w in warnings)]
            entry["verdict"] = f"all {shown[0]}" if shown else "slow" if took > arguments.seconds / 2 else "ok"
            if name == "render" and not image.exists():
                entry["verdict"] = "no image"
        elif name == "stress" and code == 1:
            entry["verdict"] = "check failed"
        else:
            entry["verdict"] = REFUSALS.get(code, "crashed")
            entry["reason"] = reason(line, path)
        result[name] = entry
    image.unlink(missing_ok=True)
    return result


def table(results, arguments):
    """The summary as a table in Markdown."""
    commands = ["info", "render"] + (["stress"] if arguments.stress else [])
    kinds = [k for k in (".gltf", ".glb", ".obj") if any(r["file"].lower().endswith(k) for r in results)]
    verdicts = collections.Counter((c, r[c]["verdict"]) for r in results for c in commands)
    out = [f"{len(results)} files: " + ", ".join(f"{sum(r['file'].lower().endswith(k) for r in results)} {k}" for k in kinds), ""]
    out += ["| | " + " | ".join(commands) + " |", "|---|" + "---|" * len(commands)]
    order = ["ok", "all black", "all white", "slow", "too long", "check failed", "no image", "refused", "out of memory", "device", "usage", "crashed"]
    for verdict in order:
        if any(verdicts[c, verdict] for c in commands):
            out.append(f"| {verdict} | " + " | ".join(str(verdicts[c, verdict]) for c in commands) + " |")
    reasons = collections.defaultdict(list)
    for r in results:
        entry = r["render"]
        if "reason" in entry:
            reasons[entry["verdict"], entry["reason"]].append(r["file"])
    if reasons:
        out += ["", "| files | what `render` says | for instance |", "|---|---|---|"]
        for (verdict, text), files in sorted(reasons.items(), key=lambda item: -len(item[1])):
            out.append(f"| {len(files)} | {verdict}: {text} | `{files[0]}` |")
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--output", type=Path, default=Path("corpus"))
    parser.add_argument("--jobs", type=int, default=1, help="processes side by side")
    parser.add_argument("--seconds", type=float, default=60, help="time limit of a command; half of it is slow")
    parser.add_argument("--memory", type=int, default=8192, help="limit of the address space of a process, MiB")
    parser.add_argument("--stress", action="store_true", help="run `stress --quick`, too")
    arguments = parser.parse_args()
    if not arguments.folder.is_dir():
        sys.exit(f"corpus: error: {arguments.folder}: no such folder")
    arguments.program = str(Path(arguments.program).resolve())
    helped = subprocess.run([arguments.program, "help"], capture_output=True, text=True)
    if helped.returncode != 0:
        sys.exit(f"corpus: error: {arguments.program} does not run: {helped.stderr.strip()}")
    if arguments.stress and not re.search(r"^\s+stress\b", helped.stdout, re.M):
        print("corpus: the program has no command `stress`: left out", file=sys.stderr)
        arguments.stress = False
    arguments.output.mkdir(parents=True, exist_ok=True)
    files, results = list(models(arguments.folder)), []
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for result in pool.map(lambda path: examine(path, arguments, Path(folder)), files):
            results.append(result)
            if len(results) % 50 == 0:
                print(f"corpus: {len(results)} of {len(files)}", file=sys.stderr)
    (arguments.output / "results.json").write_text(json.dumps(results, indent=1, ensure_ascii=True))
    text = table(results, arguments)
    (arguments.output / "table.md").write_text(text)
    print(text, end="")
    crashed = [r["file"] for r in results if any(r[c]["verdict"] in ("crashed", "no image") for c in ("info", "render", "stress") if c in r)]
    for name in crashed:
        print(f"corpus: crashed: {name}", file=sys.stderr)
    sys.exit(1 if crashed else 0)


if __name__ == "__main__":
    main()
