#!/usr/bin/env python3
"""What a NumPy user writes for WVDS with MIS: many samples of many rays at once, in double, by the
formulas of docs/medium.md; slats shade them. One process a core; samples a second."""
import sys

import peer

try:
    import numpy as np
except ImportError as reason:
    peer.skip(reason)
    sys.exit()

RAYS, SAMPLES = 512, 64
SIGMA = np.array([0.25, 0.35, 0.5])
STRENGTH = np.array([2.375, 2.9925, 3.825])
LIGHT = np.array([0.3, 0.85, 0.45]) / np.linalg.norm([0.3, 0.85, 0.45])
LO, HI = np.array([-2.0, 0.0, -2.0]), np.array([2.0, 2.5, 2.0])
SLATS = [(np.array([-2.1 + 0.6 * i, 2.6, -2.5]), np.array([-1.8 + 0.6 * i, 2.66, 4.5])) for i in range(5)]


def decay_mean(z):
    return np.where(z < 1e-3, 1 - z * (0.5 - z / 6), -np.expm1(-z) / np.where(z == 0, 1, z))


class Rays:
    """Rays that start on the box's near face, their pieces of phi, and the integrals of each channel over them."""

    def __init__(self, generator):
        self.start = np.stack([generator.uniform(-1.5, 1.5, RAYS), generator.uniform(0.2, 2.2, RAYS), np.full(RAYS, -2.0)], 1)
        aim = np.stack([generator.uniform(-0.3, 0.3, RAYS), generator.uniform(-0.2, 0.2, RAYS), np.ones(RAYS)], 1)
        self.direction = aim / np.linalg.norm(aim, axis=1, keepdims=True)
        faces = np.where(self.direction > 0, HI, LO)
        self.length = ((faces - self.start) / self.direction).min(1)
        self.exit, self.slope = (HI - self.start) / LIGHT, -self.direction / LIGHT
        knots = [np.zeros(RAYS), self.length]
        for i in range(3):
            for j in range(i):
                cross = (self.exit[:, j] - self.exit[:, i]) / (self.slope[:, i] - self.slope[:, j])
                knots.append(np.clip(cross, 0, self.length))
        self.knots = np.sort(np.stack(knots, 1), 1)
        self.depth = self.phi(self.knots)
        rise, low = np.diff(self.depth, axis=1), np.minimum(self.depth[:, 1:], self.depth[:, :-1])
        width = np.diff(self.knots, axis=1)
        self.parts = np.stack([width * np.exp(-s * low) * decay_mean(np.abs(s * rise)) for s in SIGMA], 1)
        self.whole = self.parts.sum(2)
        self.tau = STRENGTH * self.whole

    def phi(self, x):
        return x + np.maximum(0, (self.exit[:, None] + self.slope[:, None] * x[:, :, None]).min(2))

    def place(self, u, sigma, c):
        """The x where the integral of exp(-sigma phi) has reached the share u of its whole."""
        sums = np.concatenate([np.zeros((RAYS, 1)), np.cumsum(self.parts[:, c], 1)], 1)
        y = u * sums[:, -1:]
        piece = (y[:, :, None] >= sums[:, None, 1:-1]).sum(2)
        take = lambda of: np.take_along_axis(of, piece, 1)
        within = np.clip((y - take(sums[:, :-1])) / np.maximum(take(self.parts[:, c]), 1e-300), 0, 1)
        z = take(sigma * np.diff(self.depth, axis=1))
        size = np.maximum(np.abs(z), 1e-9)
        v = np.where(z >= 0, within, 1 - within)
        share = np.clip(-np.log1p(v * np.expm1(-size)) / size, 0, 1)
        return take(self.knots[:, :-1]) + take(np.diff(self.knots, axis=1)) * np.where(z >= 0, share, 1 - share)

    def lit(self, x):
        at = self.start[:, None] + self.direction[:, None] * x[:, :, None]
        lit = np.ones(x.shape, bool)
        for lo, hi in SLATS:
            near, far = ((lo - at) / LIGHT).max(2), ((hi - at) / LIGHT).min(2)
            lit &= far < np.maximum(near, 0)
        return lit

    def images(self, generator):
        u = generator.random((RAYS, SAMPLES))
        share = self.tau / self.tau.sum(1, keepdims=True)
        first, second = share[:, :1], share[:, :1] + share[:, 1:2]
        channel = (u >= first).astype(int) + (u >= second)
        begin = np.where(channel == 0, 0, np.where(channel == 1, first, second))
        within = np.clip((u - begin) / np.take_along_axis(share, channel, 1), 0, 1)
        x = np.zeros_like(u)
        for c, sigma in enumerate(SIGMA):
            x = np.where(channel == c, self.place(within, sigma, c), x)
        worth = STRENGTH * np.exp(-(SIGMA - SIGMA[0]) * self.phi(x)[:, :, None])
        t = self.tau.sum(1)[:, None, None] * worth / worth.sum(2, keepdims=True)
        return (t * self.lit(x)[:, :, None]).mean(1), t.mean(1)


def measure(core):
    generator = np.random.default_rng(1 + core)
    rays = Rays(generator)
    return {"wvds_mis": peer.rate(lambda: rays.images(generator), RAYS * SAMPLES, 5 * int(sys.argv[1]))}


if __name__ == "__main__":
    peer.report(peer.on_all_cores(measure))
