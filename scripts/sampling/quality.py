"""What --quality costs and leaves: samples, error and time beside a fixed number of samples with the same error. docs/notebook/2026-11-29-worth-of-a-quality.md has what it prints.

    python3 scripts/sampling/quality.py target/release/skylit [--size 320x180] [--qualities draft,good] [--runs 3] [--most 1024] NAME='SCENE OPTION...' ...

Errors are RMSE against an image of twice --most samples and another seed, whose own noise is in all of them: of sRGB values in steps of 8 bits, at the exposure of
the picture, and of linear values. Errors of fixed numbers of samples are measured at powers of two up to --most and interpolated between them. Bias is the mean
of the difference. Then a quality and the fixed number of samples with the same displayed error are rendered in turn: rays, which
tiles without geometry have none of, processor seconds, which other work on the machine hardly changes, and whole seconds, medians.
Needs numpy and OpenEXR."""
import argparse
import json
import resource
import shlex
import statistics
import subprocess
import tempfile

import numpy as np
import OpenEXR

SEED, REFERENCE_SEED = 1, 77


def render(program, line, output, *options):
    command = [program, "render", *shlex.split(line), "-o", output, "--json", "--no-config", *map(str, options)]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def processor_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def load(path):
    """Means, and samples per pixel."""
    with OpenEXR.File(path, separate_channels=True) as file:
        planes = {name: np.array(channel.pixels, float) for name, channel in file.channels().items()}
    return np.stack([planes[name] for name in ("Y" if "Y" in planes else "RGB")], -1), planes["samples"]


def exposure(record):
    """Exposure of the picture, in stops, if one was chosen."""
    chosen = [line for line in record["choices"] if line.startswith("exposure of pictures: ")]
    return float(chosen[0].split()[3]) if chosen else 0.0


def shown(linear, stops):
    linear = np.clip(linear * 2.0**stops, 0.0, 1.0)
    return 255.0 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


class Reference:
    def __init__(self, path, stops):
        self.linear, self.stops = load(path)[0], stops
        self.shown = shown(self.linear, stops)

    def errors(self, image):
        """RMSE and bias as displayed, then linear."""
        differences = shown(image, self.stops) - self.shown, image - self.linear
        return [value for d in differences for value in ((d**2).mean() ** 0.5, d.mean())]


def samples_for(error, fixed):
    """The fixed number of samples with this error; beyond the last one it is extrapolated from the last two."""
    numbers, errors = np.log(list(fixed)), np.log(list(fixed.values()))
    if np.log(error) < errors[-1]:
        slope = (numbers[-1] - numbers[-2]) / (errors[-1] - errors[-2])
        return float(np.exp(numbers[-1] + slope * (np.log(error) - errors[-1])))
    return float(np.exp(np.interp(-np.log(error), -errors, numbers)))


def study(program, name, line, arguments, folder):
    size = ["--size", arguments.size]
    path = f"{folder}/image.exr"
    # a saved film has one occlusion ray for each camera ray unless it is told otherwise
    rays = ["--ao-rays", "2"] if "--integrator ao " in line + " " and "--ao-rays" not in line else []
    record = render(program, line, path, "--spp", arguments.most, "--intervals", "--seed", SEED, *size, *rays)
    images = {spp: load(f"{folder}/image.{spp:04}.exr" if spp < arguments.most else path)[0] for spp in powers(arguments.most)}
    render(program, line, f"{folder}/reference.exr", "--spp", 2 * arguments.most, "--seed", REFERENCE_SEED, *size, *rays)
    reference = Reference(f"{folder}/reference.exr", exposure(record))
    fixed = {spp: reference.errors(image) for spp, image in images.items()}
    print(f"{name}: RMSE of fixed samples, as displayed: " + ", ".join(f"{spp} {fixed[spp][0]:.2f} (bias {fixed[spp][1]:+.3f})" for spp in fixed), flush=True)
    for quality in arguments.qualities.split(","):
        record = render(program, line, path, "--quality", quality, "--seed", SEED, *size)
        film = record["film"]
        image, samples = load(path)
        displayed, displayed_bias, linear, linear_bias = reference.errors(image)
        wanted = samples_for(displayed, {spp: errors[0] for spp, errors in fixed.items()})
        wanted_linear = samples_for(linear, {spp: errors[2] for spp, errors in fixed.items()})
        mean = film["samples"]["mean"]
        contestants = {"quality": ["--quality", quality], "fixed": ["--spp", max(round(wanted), 1)]}
        times = {key: [] for key in contestants}
        for _ in range(arguments.runs):
            for key, options in contestants.items():
                before = processor_seconds()
                timed = render(program, line, path, "--seed", SEED, *size, *options)
                rays = sum(count for kind, count in timed["rays"].items() if not kind.startswith("skipped"))
                times[key].append((rays, processor_seconds() - before, timed["seconds"]["total"]))
        traced, processor, whole = ({key: statistics.median(t[k] for t in times[key]) for key in times} for k in range(3))
        print(f"| {name} | {quality} | {255 * film['quality']['error']:.2f} | {displayed:.2f} | {mean:.1f} ({samples.min():.0f} to {samples.max():.0f}) | {wanted:.0f} | "
              f"{wanted / mean:.2f} | {wanted_linear / mean:.2f} | {traced['fixed'] / traced['quality']:.2f} | {processor['fixed'] / processor['quality']:.2f} | {whole['fixed'] / whole['quality']:.2f} | "
              f"{displayed_bias:+.3f} | {100 * linear_bias / reference.linear.mean():+.2f} % | {len(film['quality']['limited_tiles'])} of {film['tiles']['all']} |", flush=True)


def powers(most):
    return [2**k for k in range(2, 32) if 2**k <= most]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("scenes", nargs="+", metavar="NAME=SCENE OPTION...")
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--qualities", default="draft,good")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--most", type=int, default=1024)
    arguments = parser.parse_args()
    print("| scene | quality | announced | RMSE | samples | fixed samples of the same RMSE | ratio | ratio, linear RMSE | rays | processor time | whole time | bias | linear bias | tiles with all samples |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    for scene in arguments.scenes:
        name, line = scene.split("=", 1)
        with tempfile.TemporaryDirectory() as folder:
            study(arguments.program, name, line, arguments, folder)


main()
