#!/usr/bin/env python3
"""What a NumPy user writes: error samples by eq. (14) in canonical form, then np.histogram. One core; prints million samples a second."""
import time

import numpy as np

S, A, B = 0.35, -0.175, 0.5  # mu .5, tau 1, sigma_m .5, sigma_t .35, rho 0
COUNT = 1 << 22


def samples(generator):
    z = generator.standard_normal((2, COUNT), dtype=np.float32)
    return (np.float32(A) * z[1] + np.float32(B) * z[0]) / (1 + np.float32(S) * z[1])


def median_rate(work, repetitions=5):
    seconds = []
    for _ in range(repetitions):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    return COUNT / sorted(seconds)[len(seconds) // 2] / 1e6


def main():
    generator = np.random.Generator(np.random.Philox(1))
    x = samples(generator)
    print(f"numpy_samples    {median_rate(lambda: samples(generator)):8.1f} M/s a core")
    print(f"numpy_histogram  {median_rate(lambda: np.histogram(x, bins=1024, range=(-2, 4))):8.1f} M/s a core")
    print(f"numpy_fused      {median_rate(lambda: np.histogram(samples(generator), bins=1024, range=(-2, 4))):8.1f} M/s a core")


if __name__ == "__main__":
    main()
