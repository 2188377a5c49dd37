"""Writes known_answers.json: what other implementations of image metrics say of the images that known_answers.rs makes.

    pip install numpy scikit-image flip-evaluator && python3 tests/measure/known_answers.py

NumPy has means and percentiles, scikit-image SSIM and PSNR, the authors' flip-evaluator FLIP."""

import json
import pathlib

import flip_evaluator
import numpy
from skimage import metrics

WIDTH, HEIGHT = 60, 48


def noise(count, seed):
    state, out = seed, []
    for _ in range(count):
        state = (state * 1_664_525 + 1_013_904_223) & 0xFFFF_FFFF
        out.append((state >> 8) / (1 << 24))
    return numpy.array(out, dtype=numpy.float32)


def image(channels, seed, peak, shift):
    """Squares of two brightnesses and noise."""
    values = noise(WIDTH * HEIGHT * channels, seed).reshape(HEIGHT, WIDTH, channels)
    y, x = numpy.mgrid[0:HEIGHT, 0:WIDTH]
    square = (((x + shift) // 8 + y // 8) % 2).astype(numpy.float32)
    return (numpy.float32(0.25) * values + numpy.float32(0.5) * square[:, :, None]) * numpy.float32(peak)


def answers(channels, peak):
    a, b = image(channels, 1, peak, 1), image(channels, 2, peak, 0)
    difference = a.astype(numpy.float64) - b
    square = difference**2
    pixels = difference.mean(axis=2).ravel()
    percentiles = numpy.percentile(numpy.abs(difference), [50, 95, 99])
    ab, aa, bb = [(p.astype(numpy.float64) * q).sum() for p, q in ((a, b), (a, a), (b, b))]
    with numpy.errstate(divide="ignore", invalid="ignore"):
        ratio = numpy.minimum(a.astype(numpy.float64) / b, b.astype(numpy.float64) / a)
    rgb = [numpy.repeat(v, 3, axis=2) if channels == 1 else v for v in (a, b)]
    out = {
        "channels": channels,
        "peak": peak,
        "rmse": numpy.sqrt(square.mean()),
        "mae": numpy.abs(difference).mean(),
        "rel_mse": (square / (b.astype(numpy.float64) ** 2 + 0.01)).mean(),
        "psnr": metrics.peak_signal_noise_ratio(b.astype(numpy.float64), a.astype(numpy.float64), data_range=1),
        "ssim": metrics.structural_similarity(
            a.astype(numpy.float64), b.astype(numpy.float64), channel_axis=2, data_range=1, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
        ),
        "bias": difference.mean(),
        "bias_standard_error": pixels.std(ddof=1) / numpy.sqrt(pixels.size),
        "max": numpy.abs(difference).max(),
        "percentiles": list(percentiles),
        "tanimoto": ab / (aa + bb - ab),
        "minimum_ratio": ratio.mean(),
    }
    if peak == 1:
        out["flip"] = flip_evaluator.evaluate(rgb[1], rgb[0], "LDR", inputsRGB=False, applyMagma=False)[1]
    _, mean, parameters = flip_evaluator.evaluate(rgb[1], rgb[0], "HDR", applyMagma=False)
    out["flip_hdr"] = mean
    out["stops"] = [parameters["startExposure"], parameters["stopExposure"]]
    out["exposures"] = parameters["numExposures"]
    return {key: value if isinstance(value, (int, list)) else float(value) for key, value in out.items()}


path = pathlib.Path(__file__).with_name("known_answers.json")
path.write_text(json.dumps([answers(c, p) for c in (1, 3) for p in (1, 20)], indent=1) + "\n")
print(path.read_text())
