#!/usr/bin/env python3
"""Float normals from Intel MKL: Philox4x32-10 and the inverse of the distribution function; one process a core."""
import ctypes
import sys

import peer

LIBRARIES = ("libmkl_rt.so", "libmkl_rt.so.3", "libmkl_rt.so.2", "libmkl_rt.so.1")
PHILOX4X32X10, GAUSSIAN_ICDF = 16 << 20, 2  # mkl_vsl_defines.h
COUNT = 1 << 22


def load():
    """libmkl_rt from where the loader looks (LD_LIBRARY_PATH, MKL's setvars.sh), or None."""
    for name in LIBRARIES:
        try:
            return ctypes.CDLL(name)
        except OSError:
            pass
    return None


def measure(core):
    mkl = load()
    stream = ctypes.c_void_p()
    out = (ctypes.c_float * COUNT)()
    if mkl.vslNewStream(ctypes.byref(stream), PHILOX4X32X10, 1 + core) != 0:
        raise RuntimeError("vslNewStream failed")

    def normals():
        if mkl.vsRngGaussian(GAUSSIAN_ICDF, stream, COUNT, out, ctypes.c_float(0), ctypes.c_float(1)) != 0:
            raise RuntimeError("vsRngGaussian failed")

    return {"normals": peer.rate(normals, COUNT, int(sys.argv[1]))}


if __name__ == "__main__":
    if load() is None:
        peer.skip("libmkl_rt is not installed")
    else:
        peer.report(peer.on_all_cores(measure))
