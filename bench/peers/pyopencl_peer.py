#!/usr/bin/env python3
"""Float normals from pyopencl's Philox generator on the device whose name is given."""
import sys
import warnings

import peer

warnings.filterwarnings("ignore")
try:
    import pyopencl
    import pyopencl.array
    import pyopencl.clrandom
except ImportError as reason:
    peer.skip(reason)
    sys.exit()

COUNT = 1 << 24


def device(name):
    return next(d for p in pyopencl.get_platforms() for d in p.get_devices() if d.name.strip() == name.strip())


def main():
    context = pyopencl.Context([device(sys.argv[2])])
    queue = pyopencl.CommandQueue(context)
    generator = pyopencl.clrandom.PhiloxGenerator(context)
    out = pyopencl.array.empty(queue, COUNT, "float32")

    def normals():
        generator.fill_normal(out, queue=queue)
        queue.finish()

    peer.report({"normals": peer.rate(normals, COUNT, int(sys.argv[1]))})


if __name__ == "__main__":
    main()
