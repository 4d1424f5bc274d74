// A device, a queue on it and the programs built for it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#ifndef CL_TARGET_OPENCL_VERSION
#define CL_TARGET_OPENCL_VERSION 300
#endif
#include <CL/cl.h>

#include "clratio/exception.hpp"

namespace clratio {

struct DeviceInfo {
    std::string platform, name, vendor, version, driver;
    std::string id;           ///< "platform:device", both counted from 0, as CLRATIO_DEVICE takes it
    cl_device_type type = 0;  ///< a bit mask
    std::uint32_t compute_units = 0;
    std::uint64_t global_memory = 0, largest_allocation = 0;  ///< bytes
    bool fp64 = false;
    bool correctly_rounded_divide = false, fma = false;  ///< as the device reports them
    bool host_memory = false;                            ///< device and host share memory
    int native_width = 1;                                ///< float lanes
};

/// All devices of all platforms, in the order of the OpenCL loader. Empty where there is no platform.
std::vector<DeviceInfo> list_devices();

/// The device that Engine{} would take, and why ("CLRATIO_DEVICE=gpu", "the first GPU", "no GPU: the first CPU").
/// Throws InvalidArgument where CLRATIO_DEVICE names none, DeviceError where there is no device at all.
struct Pick {
    DeviceInfo device;
    std::string reason;
};
Pick pick_device();

enum class Require {
    nothing,    ///< any device; what it lacks is reported by Engine::info()
    same_bits,  ///< refuse a device that neither reports correctly rounded division and fma nor passes the self-test
};

/// How kernels run. 0 and `automatic` leave the choice to the library.
struct EngineOptions {
    enum class Path { automatic, ranges, groups };
    Require require = Require::nothing;
    int width = 0;                 ///< lanes of a vector: 1, 2, 4, 8, 16
    Path path = Path::automatic;   ///< a range for each work-item (CPU), or work-groups that share (GPU)
    std::uint32_t work_items = 0;  ///< ranges: how many; groups: the work-group size, which the device limits
    bool disk_cache = true;        ///< keep built programs in $XDG_CACHE_HOME/clratio
};

/// A cheap handle: copies share one device. Usable from several threads at once.
/// Nothing is compiled before the first kernel of a word is needed.
class Engine {
public:
    /// Picks a device: CLRATIO_DEVICE ("0:0", "cpu", "gpu", or a part of a name), then a GPU, then a CPU.
    /// Errors: DeviceError without a platform or device (names the package to install), InvalidArgument.
    explicit Engine(EngineOptions options = {});
    /// Wraps the caller's queue, in order or out of order; it is retained. info().id is empty then. Errors: InvalidArgument
    /// for a null queue and for options, DeviceError.
    explicit Engine(cl_command_queue queue, EngineOptions options = {});

    const DeviceInfo& info() const;
    cl_command_queue queue() const;
    cl_context context() const;
    cl_device_id device() const;
    int width() const;                 ///< lanes
    bool grouped() const;              ///< true where work-groups share (GPU path)
    std::uint32_t work_items() const;  ///< as in EngineOptions, with the library's choice made

    /// Whether + - * / sqrt fma of 64 triples of normal floats have the host's bits on the device. Blocking. Errors:
    /// DeviceError, BuildError. Cost: one small launch, the first time a kernel to build or to load from the disk cache.
    bool self_test() const;

    struct State;
    State& state() const { return *state_; }

private:
    std::shared_ptr<State> state_;
};

/// Called between launches of blocking work: done and total in the work's own units. Return false to cancel.
using Progress = std::function<bool(std::uint64_t done, std::uint64_t total)>;

/// The text of all device headers, flattened, ready to stand before a user's own OpenCL C kernel
/// (build it with -DCLR_WIDTH=N -DCLR_GROUPED=0 -DCLR_FP64=0). Needs no device, has no errors. Cost: every call puts the
/// text together anew, about 170 kB. Determinism: the same text for one version of the library.
std::string device_source();

}  // namespace clratio
