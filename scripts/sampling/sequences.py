"""Sample sequences of the literature beside the sampler of the renderer, on integrands of a renderer: error of a pixel
and after two filters, and integer operations. docs/notebook/2026-11-30-sample-sequences-compared.md has what it prints.

    python3 scripts/sampling/sequences.py                # some minutes of one core; --quick takes one
    python3 scripts/sampling/sequences.py --each --only zsobol,sz --integrands ao-sphere,room --spp 1,4,16 --seeds 8
    python3 scripts/sampling/sequences.py --check        # only tests which strata each sequence keeps
    python3 scripts/sampling/sequences.py --cost         # only counts operations

Pair 0 is the position in a pixel, pair 1 a direction or a point of a lamp, pairs 2 and 3 a point of a lamp and a
direction from a BSDF. Needs numpy."""
import argparse
import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import z_order  # noqa: E402

U = np.uint32
SIZE = 64  # pixels along each side, a power of two
MORTON_BITS = 12
COUNT = {"operations": 0}
np.seterr(over="ignore")


class Counted(np.ndarray):
    """An array that counts the operations on it: one for each call of a NumPy function."""

    def __array_ufunc__(self, function, method, *inputs, **options):
        COUNT["operations"] += 1
        plain = [np.asarray(x) if isinstance(x, np.ndarray) else x for x in inputs]
        return np.asarray(getattr(function, method)(*plain, **options)).view(Counted)


class KeepsCounted:
    """What z_order needs of NumPy, without losing the class of an array."""
    asarray, errstate = staticmethod(np.asanyarray), np.errstate


def rev(x):
    """Reverses bits; one operation, as bitfieldReverse is."""
    COUNT["operations"] += 1
    plain = np.asarray(x, U)
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F)):
        plain = ((plain >> U(shift)) & U(mask)) | ((plain & U(mask)) << U(shift))
    plain = plain.byteswap()
    return plain.view(Counted) if isinstance(x, Counted) else plain


z_order.np, z_order.rev = KeepsCounted, rev
hash32, combine, owen, sobol, morton = z_order.h, z_order.hc, z_order.owen, z_order.sobol, z_order.morton


def key_of(seed, px, py):
    return combine(combine(U(seed), px), py)


def log2(n):
    """The logarithm of a number that is rounded up to a power of two."""
    return (int(n) - 1).bit_length()


def scrambled(points, key):
    return owen(points[0], combine(key, U(0))), owen(points[1], combine(key, U(1)))


# Sequences give the bits of pair d of sample n of spp of a pixel. The hash of seed and pixel may be
# given, so that its cost is not counted.


def ours(seed, px, py, spp, n, d, pixel=None):
    """Owen-scrambled Sobol pairs (Burley 2020): src/sampling/sobol.rs."""
    key = combine(key_of(seed, px, py) if pixel is None else pixel, U(d))
    return scrambled(sobol(owen(n, key)), key)


def independent(seed, px, py, spp, n, d, pixel=None):
    key = combine(key_of(seed, px, py) if pixel is None else pixel, U(d))
    first = combine(key, n)
    return first, hash32(first ^ U(0x68BC21EB))


def permuted(x, bits, key):
    """A permutation of numbers of so many bits, by a hash: xor, odd multiples and shifts."""
    if bits == 0:
        return x
    mask = U((1 << bits) - 1)
    for step in (0, 11):
        x = ((x ^ (key >> U(step))) * ((key >> U(step + 5)) | U(1))) & mask
        x = x ^ (x >> U((bits + 1) // 2))
    return (x + (key >> U(7))) & mask


def from_parts(parts, jitter):
    """Bits from the top: (value, bits)..., then those of the jitter."""
    used, out = 0, U(0)
    for value, bits in parts:
        used += bits
        if bits:
            out = out | (value << U(32 - used))
    return out | (jitter >> U(used)) if used else jitter


def stratified(seed, px, py, spp, n, d, pixel=None):
    """pbrt-v4's Stratified: a jittered grid, its cells in another order for each pair."""
    key = combine(key_of(seed, px, py) if pixel is None else pixel, U(d))
    wide, high = (log2(spp) + 1) // 2, log2(spp) // 2
    cell = permuted(n, wide + high, key)
    jitter = combine(key, n)
    return (from_parts([(cell & U((1 << wide) - 1), wide)], jitter),
            from_parts([(cell >> U(wide), high)], hash32(jitter ^ U(0x68BC21EB))))


def multijitter(seed, px, py, spp, n, d, pixel=None):
    """Correlated multi-jittered samples (Kensler 2013), as Mitsuba's multijitter."""
    key = combine(key_of(seed, px, py) if pixel is None else pixel, U(d))
    wide, high = (log2(spp) + 1) // 2, log2(spp) // 2
    cell = permuted(n, wide + high, key)
    column, row = cell & U((1 << wide) - 1), cell >> U(wide)
    jitter = combine(key, n)
    x = from_parts([(column, wide), (permuted(row, high, hash32(key ^ U(1))), high)], jitter)
    y = from_parts([(row, high), (permuted(column, wide, hash32(key ^ U(2))), wide)], hash32(jitter ^ U(0x68BC21EB)))
    return x, y


def base_digits(index, base, permutations):
    """The radical inverse with permuted digits, as bits."""
    out, scale, left = 0.0, 1.0, np.asarray(index, np.int64)
    for permutation in permutations:
        scale /= base
        out = out + permutation[left % base] * scale
        left = left // base
        COUNT["operations"] += 6
    return np.minimum(out * 2.0**32, 2.0**32 - 1).astype(U)


HALTON = {}


def halton(seed, px, py, spp, n, d, pixel=None):
    """pbrt-v4's Halton: one sequence for the image, digits permuted at random in all pairs but the first."""
    if "offset" not in HALTON:
        index = np.arange(SIZE * 81, dtype=np.int64)
        plain2, plain3 = [np.arange(2)] * 6, [np.arange(3)] * 4
        column = (base_digits(index, 2, plain2).astype(float) / 2**32 * SIZE + 1e-6).astype(int)
        row = (base_digits(index, 3, plain3).astype(float) / 2**32 * 81 + 1e-6).astype(int)
        HALTON["offset"] = np.zeros((81, SIZE), np.int64)
        HALTON["offset"][row, column] = index
    index = HALTON["offset"][np.asarray(py), np.asarray(px)] + SIZE * 81 * np.asarray(n, np.int64)
    if d == 0:
        x = base_digits(index // SIZE, 2, [np.arange(2)] * 22)
        return x, base_digits(index // 81, 3, [np.arange(3)] * 14)
    out = []
    for base in ((5, 7), (11, 13), (17, 19))[d - 1]:
        digits = int(np.ceil(np.log(2**23) / np.log(base)))
        random = np.random.default_rng((seed, base))
        out.append(base_digits(index, base, [random.permutation(base) for _ in range(digits)]))
    return tuple(out)


DIRECTIONS = []  # of the third and fourth dimension of Joe and Kuo 2008


def direction_numbers():
    for degree, a, first in ((2, 1, [1, 3]), (3, 1, [1, 3, 1])):
        m = list(first)
        while len(m) < 32:
            k = len(m)
            new = m[k - degree] ^ (m[k - degree] << degree)
            for j in range(1, degree):
                if (a >> (degree - 1 - j)) & 1:
                    new ^= m[k - j] << j
            m.append(new)
        DIRECTIONS.append([U((m[k] << (31 - k)) & 0xFFFFFFFF) for k in range(32)])


direction_numbers()


def sobol_4d(seed, px, py, spp, n, d, pixel=None):
    """Groups of four dimensions of Sobol's sequence, Owen-scrambled (Burley 2020, in groups of two pairs)."""
    group = combine(key_of(seed, px, py) if pixel is None else pixel, U(d >> 1))
    index = owen(n, group)
    if d & 1 == 0:
        return scrambled(sobol(index), combine(group, U(7)))
    x, y = index & U(0), index & U(0)
    for k in range(32):
        bit = (index >> U(k)) & U(1)
        x, y = x ^ (bit * DIRECTIONS[0][k]), y ^ (bit * DIRECTIONS[1][k])
    return scrambled((x, y), combine(group, U(8)))


def by_omega(t):
    """The matrix P(w) of Pascal over GF(4) times the digits of an index: dimension pairs (0, 1) and P(w) (0, 1) of a
    two-dimensional Sobol sequence together are a (0,4)-sequence in base 4."""
    return z_order.mulpow(pascal_base4(z_order.mulpow(t, 1)), -1)


def pascal_base4(v):
    """Sums of digits k whose binary digits contain those of j, without moving the two bits of a digit apart."""
    for shift, mask in ((2, 0xCCCCCCCC), (4, 0xF0F0F0F0), (8, 0xFF00FF00), (16, 0xFFFF0000)):
        v = v ^ ((v & U(mask)) >> U(shift))
    return v


def sz(seed, px, py, spp, n, d, pixel=None):
    """Groups of four dimensions that are a (0,4)-sequence in base 4, whose pairs are (0,2)-sequences in base 2: the
    property of SZ sequences (Ahmed, Pharr, Ostromoukhov, Huang 2025), by a construction of our own."""
    group = combine(key_of(seed, px, py) if pixel is None else pixel, U(d >> 1))
    index = owen(n, group)
    return scrambled(sobol(by_omega(index) if d & 1 else index), combine(group, U(7 + (d & 1))))


PERMUTATIONS = [(a, b, c, 6 - a - b - c) for a in range(4) for b in range(4) for c in range(4) if len({a, b, c}) == 3]
PACKED = np.array([sum(to << (2 * digit) for digit, to in enumerate(p)) for p in PERMUTATIONS], U)


def z_index(px, py, spp, n, key):
    """ZSobol's index: digits in base 4 of Morton index and sample, each permuted by a hash of those above."""
    k = log2(spp)
    odd = k & 1
    code = (morton(px, py) << U(k)) | n
    index = code & U(0)
    for shift in range(MORTON_BITS + k - 2, odd - 1, -2):
        higher = code >> U(shift + 2)
        permutation = (hash32(higher ^ key) >> U(24)) % U(24)
        packed = PACKED[np.asarray(permutation)]
        COUNT["operations"] += 1
        packed = packed.view(Counted) if isinstance(code, Counted) else packed
        index = index | (((packed >> (((code >> U(shift)) & U(3)) << U(1))) & U(3)) << U(shift))
    if odd:
        index = index | ((code ^ hash32((code >> U(1)) ^ key)) & U(1))
    return index


def zsobol(seed, px, py, spp, n, d, pixel=None):
    """pbrt-v4's ZSobol (Ahmed and Wonka 2020)."""
    key = combine(U(seed), U(d))
    return scrambled(sobol(z_index(px, py, spp, n, key)), key)


def zsobol_256(seed, px, py, spp, n, d, pixel=None):
    """ZSobol that was told 256 samples, of which the first are taken."""
    return zsobol(seed, px, py, 256, n, d)


def owen_base4(x, key):
    """Nested scramble of digits in base 4 by a hash (Vegdahl 2022)."""
    x = z_order.rev4(x)
    x = x ^ (x * U(0x3D20ADEA))
    x = x ^ ((x >> U(1)) & (x << U(1)) & U(0x55555555))
    x = x + key
    x = x * ((key >> U(16)) | U(1))
    x = x ^ ((x >> U(1)) & (x << U(1)) & U(0x55555555))
    x = x ^ (x * U(0x05526C56))
    return z_order.rev4(x ^ (x * U(0x53A22864)))


def z_hash_index(px, py, spp, n, key):
    """The same by two hashes: base 4 for the Morton index, base 2 for samples of a pixel."""
    code = owen_base4(morton(px, py) << U(32 - MORTON_BITS), key) >> U(32 - MORTON_BITS)
    k = log2(spp)
    if k == 0:
        return code
    return (code << U(k)) | (owen(n << U(32 - k), combine(key, code)) >> U(32 - k))


def z_hash(seed, px, py, spp, n, d, pixel=None):
    """ZSobol by a hash for all digits (Vegdahl 2022) in place of a hash for each."""
    key = combine(U(seed), U(d))
    return scrambled(sobol(z_hash_index(px, py, spp, n, key)), key)


def z_base2_index(px, py, spp, n, key):
    """Morton index and sample, scrambled together in base 2."""
    bits = MORTON_BITS + log2(spp)
    code = (morton(px, py) << U(log2(spp))) | n
    return owen(code << U(32 - bits), combine(key, U(2))) >> U(32 - bits)


def z_base2(seed, px, py, spp, n, d, pixel=None):
    """As the first frame of the renderer's sequence `blue`."""
    key = combine(U(seed), U(d))
    return scrambled(sobol(z_base2_index(px, py, spp, n, key)), key)


def z_base2_256(seed, px, py, spp, n, d, pixel=None):
    """The same that was told 256 samples, of which the first are taken."""
    return z_base2(seed, px, py, 256, n, d)


def z_sz(seed, px, py, spp, n, d, pixel=None):
    """The index of z-hash for the groups of sz."""
    key = combine(U(seed), U(d >> 1))
    index = z_hash_index(px, py, spp, n, key)
    return scrambled(sobol(by_omega(index) if d & 1 else index), combine(key, U(7 + (d & 1))))


def z_base2_sz(seed, px, py, spp, n, d, pixel=None):
    """The index of z-base2 for the groups of sz."""
    key = combine(U(seed), U(d >> 1))
    index = z_base2_index(px, py, spp, n, key)
    return scrambled(sobol(by_omega(index) if d & 1 else index), combine(key, U(7 + (d & 1))))


def z_extended(seed, px, py, spp, n, d, pixel=None):
    """Z-order that can be extended to any number of samples, in base 4: scripts/sampling/z_order.py."""
    return z_order.new(seed, px + U(0) * n, py + U(0) * n, n + U(0) * px, d)


def pmj02(random, count, candidates=24):
    """A progressive sequence stratified in all elementary intervals (Christensen, Kensler, Kilpatrick 2018): each new
    point takes the candidate that is farthest from the others."""
    points, cells = [tuple(random.random(2))], [(0, 0)]
    while len(points) < count:
        n = len(points)
        k, fine = log2(2 * n), 2 * n
        start = list(points)
        for _ in range(200):
            points = list(start)
            taken = [np.zeros(fine, bool) for _ in range(k + 1)]

            def slots(x, y):
                return [((x >> (k - a)) << (k - a)) | (y >> a) for a in range(k + 1)]

            for x, y in points:
                for a, slot in enumerate(slots(int(x * fine), int(y * fine))):
                    taken[a][slot] = True
            half = 1 << (log2(n) // 2 + 1)  # sub-quadrants along a side
            width = fine // half
            chosen, failed = [], False
            for i in range(n):
                x, y = (int(start[i][0] * half), int(start[i][1] * half))
                if log2(n) % 2 == 0:
                    goals = [(x ^ 1, y ^ 1)]
                elif i < n // 2:
                    goals = [(x ^ 1, y), (x, y ^ 1)]
                    random.shuffle(goals)
                else:
                    other = chosen[i - n // 2]
                    goals = [(other[0] ^ 1, other[1] ^ 1)]
                for goal in goals:
                    xs, ys = np.meshgrid(goal[0] * width + np.arange(width), goal[1] * width + np.arange(width))
                    free = np.ones(xs.shape, bool)
                    for a, slot in enumerate(slots(xs, ys)):
                        free &= ~taken[a][slot]
                    if free.any():
                        break
                else:
                    failed = True
                    break
                xs, ys = xs[free], ys[free]
                pick = random.integers(0, len(xs), candidates)
                at = (np.stack([xs[pick], ys[pick]], 1) + random.random((candidates, 2))) / fine
                apart = abs(at[:, None] - np.array(points)[None])
                apart = np.minimum(apart, 1 - apart)
                best = np.argmax((apart**2).sum(-1).min(1))
                chosen.append(goal)
                points.append(tuple(at[best]))
                for a, slot in enumerate(slots(int(xs[pick[best]]), int(ys[pick[best]]))):
                    taken[a][slot] = True
            if not failed:
                break
        else:
            raise RuntimeError("no point is left in all strata")
    return np.array(points)


def blue_mask(random, sigma=1.5):
    """A mask of blue noise by void and cluster (Ulichney 1993), as fractions."""
    axis = np.minimum(np.arange(SIZE), SIZE - np.arange(SIZE))
    kernel = np.exp(-(axis[:, None] ** 2 + axis[None] ** 2) / (2 * sigma**2))
    twice = np.tile(kernel, (2, 2))
    count, initial = SIZE * SIZE, SIZE * SIZE // 10

    def around(i):
        y, x = divmod(int(i), SIZE)
        return twice[SIZE - y:2 * SIZE - y, SIZE - x:2 * SIZE - x]

    on = np.zeros(count, bool)
    on[random.permutation(count)[:initial]] = True
    energy = sum(around(i) for i in np.flatnonzero(on))
    for _ in range(4 * initial):
        cluster = np.argmax(np.where(on, energy.ravel(), -1))
        on[cluster], energy = False, energy - around(cluster)
        void = np.argmin(np.where(on, 1e9, energy.ravel()))
        on[void], energy = True, energy + around(void)
        if void == cluster:
            break
    rank = np.zeros(count, int)
    left, filled = on.copy(), energy.copy()
    for r in range(initial - 1, -1, -1):
        cluster = np.argmax(np.where(left, filled.ravel(), -1))
        left[cluster], rank[cluster], filled = False, r, filled - around(cluster)
    for r in range(initial, count):
        void = np.argmin(np.where(on, 1e9, energy.ravel()))
        on[void], rank[void], energy = True, r, energy + around(void)
    return (rank + 0.5).reshape(SIZE, SIZE) / count


PMJ = {}


def pmj02bn(seed, px, py, spp, n, d, pixel=None):
    """As pbrt-v4's PMJ02BN: a set for each pair, shifted in each pixel by masks of blue noise."""
    if (seed, d) not in PMJ:
        random = np.random.default_rng((seed, d, 5))
        PMJ[seed, d] = ((pmj02(random, 256) * 2**32).astype(U),
                        [(blue_mask(random) * 2**32).astype(U) for _ in range(2)])
    points, masks = PMJ[seed, d]
    y, x, n = (np.asarray(v) for v in (py, px, n))
    return tuple(points[n, c] + masks[c][y, x] for c in range(2))


SEQUENCES = {
    "ours": ours, "independent": independent, "stratified": stratified, "multijitter": multijitter, "halton": halton,
    "pmj02bn": pmj02bn, "sobol-4d": sobol_4d, "sz": sz, "zsobol": zsobol, "zsobol-256": zsobol_256, "z-hash": z_hash,
    "z-base2": z_base2, "z-base2-256": z_base2_256, "z-sz": z_sz, "z-base2-sz": z_base2_sz,
    "z-extended": z_extended}
TABLES = {"halton": "about 1,300 (permutations of digits)", "pmj02bn": "2,600,000 and 1,600,000 (pbrt-v4's)",
          "sobol-4d": "256", "zsobol": "24", "zsobol-256": "24"}


# Integrands give the radiance of samples, from positions of pixels and pairs of numbers in [0, 1).


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def along(o, d, t):
    return tuple(o[i] + d[i] * t for i in range(3))


def unit(v):
    length = np.sqrt(dot(v, v))
    return tuple(x / length for x in v)


def to_frame(v, n):
    """A vector of the frame of a normal, in the world (Duff et al. 2017)."""
    sign = np.where(n[2] >= 0, np.float32(1), np.float32(-1))
    a = -1 / (sign + n[2])
    b = n[0] * n[1] * a
    tangent = (1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0])
    other = (b, sign + n[1] * n[1] * a, -n[1])
    return tuple(v[0] * tangent[i] + v[1] * other[i] + v[2] * n[i] for i in range(3))


def disk(u, v):
    """The concentric map of Shirley and Chiu (1997)."""
    a, b = 2 * u - 1, 2 * v - 1
    wide = abs(a) > abs(b)
    r = np.where(wide, a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        quarter = np.float32(np.pi / 4)
        angle = np.where(wide, quarter * (b / a), 2 * quarter - quarter * (a / b))
    angle = np.where(r == 0, np.float32(0), angle)
    return r * np.cos(angle), r * np.sin(angle)


def cosine_direction(pair, normal):
    x, y = disk(*pair)
    return to_frame((x, y, np.sqrt(np.maximum(0, 1 - x * x - y * y))), normal)


def hit_sphere(o, d, sphere):
    """The first distance beyond 1e-4 at which a ray meets a sphere, or infinity."""
    centre, radius = sphere
    toward = tuple(np.float32(centre[i]) - o[i] for i in range(3))
    b = dot(toward, d)
    disc = b * b - dot(toward, toward) + np.float32(radius * radius)
    root = np.sqrt(np.maximum(disc, 0))
    t = np.where(b - root > 1e-4, b - root, b + root)
    return np.where((disc > 0) & (t > 1e-4), t, np.float32(np.inf))


def hit_plane(o, d, axis):
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -o[axis] / d[axis]
    return np.where(t > 1e-4, t, np.float32(np.inf))


class Scene:
    """Spheres and the coordinate planes of some axes, from a camera."""

    def __init__(self, spheres, planes, eye, target, tangent):
        self.spheres, self.planes, self.eye, self.tangent = spheres, planes, np.array(eye), tangent
        forward = np.array(target) - self.eye
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, (0, 0, 1))
        right /= np.linalg.norm(right)
        self.axes = (right, np.cross(right, forward), forward)

    def camera(self, px, py, film):
        """Points that camera rays meet, their normals, directions of the rays, and where there is a surface."""
        x = ((px + film[0]) * (2 / SIZE) - 1) * self.tangent
        y = (1 - (py + film[1]) * (2 / SIZE)) * self.tangent
        d = unit(tuple((x * self.axes[0][i] + y * self.axes[1][i] + self.axes[2][i]).astype(np.float32)
                       for i in range(3)))
        o = tuple(np.float32(e) for e in self.eye)
        nearest = np.full(d[0].shape, np.inf, np.float32)
        normal = tuple(np.zeros(d[0].shape, np.float32) for _ in range(3))
        for axis in self.planes:
            t = hit_plane(o, d, axis)
            closer = t < nearest
            nearest = np.where(closer, t, nearest)
            normal = tuple(np.where(closer, np.float32(i == axis), normal[i]) for i in range(3))
        for sphere in self.spheres:
            t = hit_sphere(o, d, sphere)
            closer = t < nearest
            nearest = np.where(closer, t, nearest)
            at = along(o, d, np.where(closer, t, np.float32(0)))
            normal = tuple(np.where(closer, (at[i] - np.float32(sphere[0][i])) / np.float32(sphere[1]), normal[i])
                           for i in range(3))
        hit = np.isfinite(nearest)
        point = along(o, d, np.where(hit, nearest, np.float32(0)))
        normal = tuple(np.where(hit, normal[i], np.float32(i == 2)) for i in range(3))
        return tuple(point[i] + normal[i] * np.float32(1e-3) for i in range(3)), normal, d, hit

    def blocked(self, o, d, limit):
        out = np.zeros(d[0].shape, bool)
        for axis in self.planes:
            out |= hit_plane(o, d, axis) < limit
        for sphere in self.spheres:
            out |= hit_sphere(o, d, sphere) < limit
        return out

    def occlusion(self, px, py, pairs, limit):
        point, normal, _, hit = self.camera(px, py, pairs(0))
        free = ~self.blocked(point, cosine_direction(pairs(1), normal), np.float32(limit))
        return np.where(hit, free, 1).astype(np.float32)


ONE = Scene([((0, 0, 0.52), 0.5)], [2], (0.3, -3, 1.6), (0, 0, 0.4), 0.35)
ROOM = Scene([], [0, 1, 2], (2.1, 1.7, 1.5), (0, 0, 0.2), 0.5)
GRID = Scene([((x * 0.7, y * 0.7, 0.3), 0.3) for x in (-1, 0, 1) for y in (-1, 0, 1)], [2], (0.4, -3, 2), (0, 0, 0.2),
             0.4)
LAMP, LAMP_HEIGHT, LAMP_SIDE, POWER = (0.5, -0.5), 1.9, 0.9, 4.0


def lamp_sample(point, pair):
    toward = (LAMP[0] + LAMP_SIDE * (pair[0] - np.float32(0.5)) - point[0],
              LAMP[1] + LAMP_SIDE * (pair[1] - np.float32(0.5)) - point[1], np.float32(LAMP_HEIGHT) - point[2])
    distance = np.sqrt(dot(toward, toward))
    d = tuple(x / distance for x in toward)
    density = np.where(d[2] > 1e-3, distance**2 / (np.maximum(d[2], 1e-3) * LAMP_SIDE**2), np.float32(np.inf))
    return d, distance, density


def shadow(px, py, pairs):
    point, normal, _, hit = ONE.camera(px, py, pairs(0))
    d, distance, density = lamp_sample(point, pairs(1))
    seen = hit & (dot(d, normal) > 0) & ~ONE.blocked(point, d, distance)
    return np.where(seen, POWER / np.pi * dot(d, normal) / density, 0)


def direct(px, py, pairs, shine=40):
    """A lamp on a glossy surface by light and BSDF samples with the balance heuristic; the first number of a BSDF
    sample chooses the lobe."""
    point, normal, view, hit = ONE.camera(px, py, pairs(0))
    cosine = dot(view, normal)
    mirror = unit(tuple(view[i] - 2 * cosine * normal[i] for i in range(3)))

    def surface(d):
        """Reflected share of radiance, with the cosine, and density of BSDF samples."""
        up = np.maximum(dot(d, normal), 0)
        lobe = np.maximum(dot(d, mirror), 0) ** shine
        density = 0.5 * up / np.pi + 0.5 * lobe * (shine + 1) / (2 * np.pi)
        return (0.5 / np.pi + 0.5 * lobe * (shine + 2) / (2 * np.pi)) * up, density

    d, distance, light = lamp_sample(point, pairs(2))
    value, density = surface(d)
    seen = hit & (value > 0) & ~ONE.blocked(point, d, distance)
    out = np.where(seen, value / (light + density), 0)

    u, v = pairs(3)
    diffuse = u < 0.5
    u = np.where(diffuse, 2 * u, 2 * u - 1)
    height = np.maximum(u, 1e-7) ** np.float32(1 / (shine + 1))
    around = np.sqrt(np.maximum(0, 1 - height**2))
    angle = np.float32(2 * np.pi) * v
    glossy = to_frame((around * np.cos(angle), around * np.sin(angle), height), mirror)
    even = cosine_direction((u, v), normal)
    d = tuple(np.where(diffuse, even[i], glossy[i]) for i in range(3))
    value, density = surface(d)
    t = (np.float32(LAMP_HEIGHT) - point[2]) / np.maximum(d[2], 1e-3)
    x, y = point[0] + d[0] * t - LAMP[0], point[1] + d[1] * t - LAMP[1]
    meets = hit & (d[2] > 1e-3) & (abs(x) < LAMP_SIDE / 2) & (abs(y) < LAMP_SIDE / 2) & (value > 0)
    light = t**2 / (np.maximum(d[2], 1e-3) * LAMP_SIDE**2)
    return POWER * (out + np.where(meets & ~ONE.blocked(point, d, t), value / (light + density), 0))


def smooth(px, py, pairs):
    u, v = pairs(1)
    return np.exp(-4 * ((u - px / np.float32(SIZE)) ** 2 + (v - py / np.float32(SIZE)) ** 2))


def step(px, py, pairs):
    u, v = pairs(1)
    return (0.7 * u + v > 0.3 + px / np.float32(SIZE)).astype(np.float32)


INTEGRANDS = {
    "ao-sphere": lambda *a: ONE.occlusion(*a, np.inf), "ao-room": lambda *a: ROOM.occlusion(*a, 1.0),
    "ao-grid": lambda *a: GRID.occlusion(*a, 1.0), "shadow": shadow, "direct": direct, "smooth": smooth, "step": step}


def pixels():
    y, x = np.divmod(np.arange(SIZE * SIZE, dtype=U), U(SIZE))
    return x[None], y[None]


def pairs_of(sequence, seed, spp, first, count):
    """A function from a pair's number to fractions, remembered."""
    px, py = pixels()
    n = np.arange(first, first + count, dtype=U)[:, None]
    pixel = key_of(seed, px, py)
    known = {}

    def pair(d):
        if d not in known:
            bits = sequence(seed, px, py, spp, n, d, pixel)
            known[d] = tuple((np.broadcast_to(b, (count, SIZE * SIZE)) >> U(8)).astype(np.float32)
                             * np.float32(2**-24) for b in bits)
        return known[d]

    return pair


def render(sequence, seed, spp, names, chunk=32):
    px, py = (x.astype(np.float32) for x in pixels())
    sums = {name: np.zeros(SIZE * SIZE) for name in names}
    for first in range(0, spp, chunk):
        pair = pairs_of(sequence, seed, spp, first, min(chunk, spp - first))
        for name in names:
            sums[name] += INTEGRANDS[name](px, py, pair).sum(0, dtype=float)
    return {name: (s / spp).reshape(SIZE, SIZE) for name, s in sums.items()}


def filtered(error, weights):
    half = len(weights) // 2
    inner = SIZE - 2 * half
    rows = sum(w * error[i:i + inner] for i, w in enumerate(weights))
    return sum(w * rows[:, i:i + inner] for i, w in enumerate(weights))


FILTERS = {"a pixel": [1], "3x3 Gaussian": [0.25, 0.5, 0.25], "7x7 box": [1 / 7] * 7}


def is_net(coordinates, base_bits):
    """Whether 2^m points have one in each elementary interval whose sides are powers of 2^-base_bits."""
    m = log2(len(coordinates[0])) // base_bits

    def test(left, used, dims):
        if not dims:
            return left > 0 or len(np.unique(used)) == len(used)
        return all(test(left - q, (used << np.uint64(q * base_bits)) |
                        (dims[0].astype(np.uint64) >> np.uint64(32 - q * base_bits)), dims[1:])
                   for q in (range(left + 1) if len(dims) > 1 else [left]))

    return test(m, np.zeros(len(coordinates[0]), np.uint64), coordinates)


def check():
    """Prints which strata each sequence keeps in pixels."""
    print("| | pairs of a pixel, base 2 | two pairs of a pixel, base 4 | blocks of 4x4 pixels, base 4 |")
    print("|---|---|---|---|")
    x, y = (v.ravel() for v in np.meshgrid(np.arange(4, dtype=U) + U(8), np.arange(4, dtype=U) + U(20)))
    for name, sequence in SEQUENCES.items():
        px, py = np.array([[9]], U), np.array([[22]], U)
        results = [[], [], []]
        for spp in (2, 4, 8, 16, 64, 256):
            n = np.arange(spp, dtype=U)[:, None]
            both = [np.broadcast_to(b, (spp, 1)).ravel() for d in (2, 3) for b in sequence(3, px, py, spp, n, d)]
            results[0].append(is_net(both[:2], 1) and is_net(both[2:], 1))
            if log2(spp) % 2 == 0:
                results[1].append(is_net(both, 2))
                block = sequence(3, x[None], y[None], spp, n, 2)
                results[2].append(is_net([np.broadcast_to(b, (spp, 16)).ravel() for b in block], 2))
        print(f"| {name} | " + " | ".join("yes" if all(r) else "no" for r in results) + " |")


def cost():
    """Prints operations for a pair at 16 samples a pixel, once the hash of the pixel is known."""
    print("| | operations for a pair | bytes of tables |")
    print("|---|---|---|")
    for name, sequence in SEQUENCES.items():
        px, py, n, pixel = (np.array([v], U).view(Counted) for v in (9, 22, 5, 1234567))
        counts = []
        for d in range(4):
            sequence(1, px, py, 16, n, d)  # builds tables
            COUNT["operations"] = 0
            sequence(1, px, py, 16, n, d, pixel)
            counts.append(COUNT["operations"])
        count = "two reads and additions" if name == "pmj02bn" else f"{np.mean(counts):.0f}"
        print(f"| {name} | {count} | {TABLES.get(name, 'none')} |")


def references(names, spp, cache):
    """Images of many samples, by our sequence with another seed. Occlusion, a step, takes four times as many."""
    out = {}
    for name in names:
        count = 4 * spp if name.startswith("ao-") else spp
        path = cache / f"{name}-{count}.npy" if cache else None
        if path and path.exists():
            out[name] = np.load(path)
            continue
        out[name] = render(ours, 987654, count, [name])[name]
        if path:
            np.save(path, out[name])
    return out


def squared_errors(arguments):
    """Mean squared errors by sequence, samples, seed, integrand and filter; those in the folder are not made anew."""
    names, known = arguments.integrands, references(arguments.integrands, arguments.reference, arguments.cache)
    kept = arguments.cache / f"errors-{arguments.reference}.json" if arguments.cache else None
    squares = json.loads(kept.read_text()) if kept and kept.exists() else {}
    for spp in arguments.spp:
        for seed in range(arguments.seeds):
            for sequence in arguments.only:
                missing = [name for name in names if f"{sequence} {spp} {seed} {name} a pixel" not in squares]
                if not missing:
                    continue
                images = render(SEQUENCES[sequence], seed + 1, spp, missing)
                for name in missing:
                    error = images[name] - known[name]
                    for kernel, weights in FILTERS.items():
                        squares[f"{sequence} {spp} {seed} {name} {kernel}"] = np.mean(filtered(error, weights) ** 2)
                if kept:
                    kept.write_text(json.dumps(squares))
    return squares


def measure(arguments):
    names, spps, seeds = arguments.integrands, arguments.spp, arguments.seeds
    known = squared_errors(arguments)

    def square(sequence, spp, seed, name, kernel):
        return known[f"{sequence} {spp} {seed} {name} {kernel}"]

    for kernel in FILTERS:
        print(f"\nRMSE of {kernel} relative to ours: the geometric mean over integrands, the standard error of that "
              "over seeds, and the least and most of the integrands\n")
        print("| | " + " | ".join(f"{spp} spp" for spp in spps) + " |\n|---|" + "---|" * len(spps))
        for sequence in arguments.only[1:]:
            cells = []
            for spp in spps:
                ratio = np.sqrt([[square(sequence, spp, s, name, kernel) / square("ours", spp, s, name, kernel)
                                  for s in range(seeds)] for name in names])
                mean = np.exp(np.log(ratio).mean())
                spread = np.exp(np.log(ratio).mean(0)).std(ddof=1) / np.sqrt(seeds) if seeds > 1 else 0
                each = np.exp(np.log(ratio).mean(1))
                cells.append(f"{mean:.2f}±{spread:.2f} ({each.min():.2f}-{each.max():.2f})")
            print(f"| {sequence} | " + " | ".join(cells) + " |")
        if arguments.each:
            print(f"\nRMSE of {kernel} by integrand; of ours itself, of the others relative to it\n")
            print("| | | " + " | ".join(f"{spp} spp" for spp in spps) + " |\n|---|---|" + "---|" * len(spps))
            for name in names:
                for sequence in arguments.only:
                    total = [np.mean([square(sequence, spp, s, name, kernel) for s in range(seeds)]) for spp in spps]
                    base = [np.mean([square("ours", spp, s, name, kernel) for s in range(seeds)]) for spp in spps]
                    cells = ([f"{np.sqrt(t):.5f}" for t in total] if sequence == "ours" else
                             [f"{np.sqrt(t / b):.2f}" for t, b in zip(total, base)])
                    print(f"| {name} | {sequence} | " + " | ".join(cells) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default=",".join(SEQUENCES), help="sequences, with commas")
    parser.add_argument("--integrands", default=",".join(INTEGRANDS), help="integrands, with commas")
    parser.add_argument("--spp", default="1,2,4,8,16,64,256", help="samples a pixel, up to 256")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--reference", type=int, default=4096, help="samples a pixel of references")
    parser.add_argument("--cache", type=Path, help="a folder that keeps references and errors between runs")
    parser.add_argument("--each", action="store_true", help="also prints every integrand")
    parser.add_argument("--quick", action="store_true", help="up to 16 samples, three seeds, references of 512")
    parser.add_argument("--check", action="store_true", help="only prints which strata each sequence keeps")
    parser.add_argument("--cost", action="store_true", help="only counts operations")
    arguments = parser.parse_args()
    arguments.only = ["ours"] + [name for name in arguments.only.split(",") if name != "ours"]
    arguments.integrands = arguments.integrands.split(",")
    for name, known, what in [(n, SEQUENCES, "sequence") for n in arguments.only] + [
            (n, INTEGRANDS, "integrand") for n in arguments.integrands]:
        if name not in known:
            parser.error(f"there is no {what} '{name}'; there are {', '.join(known)}")
    arguments.spp = [int(n) for n in arguments.spp.split(",")]
    if any(n < 1 or n > 256 for n in arguments.spp):
        parser.error("--spp takes numbers from 1 to 256")
    if arguments.quick:
        arguments.spp = [n for n in arguments.spp if n <= 16]
        arguments.seeds, arguments.reference = 3, 512
    if arguments.cache:
        arguments.cache.mkdir(parents=True, exist_ok=True)
    if not arguments.check and not arguments.cost:
        measure(arguments)
    if not arguments.cost:
        check()
    if not arguments.check:
        cost()


if __name__ == "__main__":
    main()
