#!/usr/bin/env python3
"""What a NumPy user writes: float32 normals, error samples by eq. (14), np.histogram; one process a core."""
import sys

import peer

try:
    import numpy as np
except ImportError as reason:
    peer.skip(reason)
    sys.exit()

COUNT = 1 << 22


def measure(core):
    generator = np.random.Generator(np.random.Philox(1 + core))
    repetitions = int(sys.argv[1])

    def normals():
        return generator.standard_normal(COUNT, dtype=np.float32)

    def samples():
        z1, z2 = normals(), normals()
        return (np.float32(peer.A) * z2 + np.float32(peer.B) * z1) / (1 + np.float32(peer.S) * z2)

    def count(x):
        return np.histogram(x, bins=peer.BINS, range=(peer.LO, peer.HI))

    x = samples()
    return {
        "normals": peer.rate(normals, COUNT, repetitions),
        "samples": peer.rate(samples, COUNT, repetitions),
        "histogram": peer.rate(lambda: count(x), COUNT, repetitions),
        "fused": peer.rate(lambda: count(samples()), COUNT, repetitions),
    }


if __name__ == "__main__":
    peer.report(peer.on_all_cores(measure))
