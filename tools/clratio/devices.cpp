// clratio devices: what is there, which one would be picked, and why.
#include "clratio/engine.hpp"
#include "command.hpp"

namespace tool {
namespace {

struct Options {
    bool json = false, self_test = false;
};

const char* type_of(const clratio::DeviceInfo& d) {
    if (d.type & CL_DEVICE_TYPE_GPU) return "GPU";
    if (d.type & CL_DEVICE_TYPE_CPU) return "CPU";
    if (d.type & CL_DEVICE_TYPE_ACCELERATOR) return "accelerator";
    return "other";
}

Json describe(const clratio::DeviceInfo& d) {
    return {{"id", d.id},
            {"name", d.name},
            {"type", type_of(d)},
            {"platform", d.platform},
            {"vendor", d.vendor},
            {"version", d.version},
            {"driver", d.driver},
            {"compute_units", d.compute_units},
            {"global_memory", d.global_memory},
            {"largest_allocation", d.largest_allocation},
            {"float_lanes", d.native_width},
            {"fp64", d.fp64},
            {"correctly_rounded_divide", d.correctly_rounded_divide},
            {"fma", d.fma},
            {"shares_host_memory", d.host_memory}};
}

void print_device(const clratio::DeviceInfo& d, bool picked) {
    constexpr double gib = 1 << 30;
    const auto yes_no = [](bool b) { return b ? "yes" : "no"; };
    fmt::print("{} {}  {}\n", picked ? "*" : " ", d.id, d.name);
    fmt::print("       {}, {}, driver {}\n", type_of(d), d.platform, d.driver);
    fmt::print("       {} compute units, {} float lanes, memory {:.1f} GiB, largest allocation {:.1f} GiB{}\n",
               d.compute_units, d.native_width, static_cast<double>(d.global_memory) / gib,
               static_cast<double>(d.largest_allocation) / gib, d.host_memory ? ", shared with the host" : "");
    fmt::print("       doubles: {}; correctly rounded division: {}; fma: {}\n", yes_no(d.fp64),
               yes_no(d.correctly_rounded_divide), yes_no(d.fma));
}

/// With a CLRATIO_DEVICE that fits none, the list says what would fit.
clratio::Pick pick_or_list(const Options& options, const std::vector<clratio::DeviceInfo>& all) {
    try {
        return clratio::pick_device();
    } catch (const clratio::InvalidArgument&) {
        if (!options.json)
            for (const auto& d : all) print_device(d, false);
        throw;
    }
}

int devices(const Options& options) {
    const auto all = clratio::list_devices();
    const auto pick = pick_or_list(options, all);
    const bool passed = options.self_test && clratio::Engine{}.self_test();
    if (options.json) {
        Json out{{"devices", Json::array()}, {"picked", pick.device.id}, {"reason", pick.reason}};
        for (const auto& d : all) out["devices"].push_back(describe(d));
        if (options.self_test) out["self_test"] = passed;
        print(out);
    } else {
        for (const auto& d : all) print_device(d, d.id == pick.device.id);
        fmt::print("* would be picked: {}\n", pick.reason);
        if (options.self_test)
            fmt::print("self-test on it: {}\n", passed ? "the same bits as the host" : "OTHER bits than the host");
    }
    return options.self_test && !passed ? failed : ok;
}

}  // namespace

void add_devices(CLI::App& app, Run& run) {
    auto options = std::make_shared<Options>();
    Command command(app, "devices", "List the OpenCL devices, and say which would be picked and why");
    command.flag("--json", options->json, "Print one JSON object");
    command.flag("--self-test", options->self_test,
                 "Also compute 64 values on the picked device and compare the bits with the host's (exit 1 if they differ)");
    command.footer(
        "CLRATIO_DEVICE chooses: \"0:0\" (platform:device), \"cpu\", \"gpu\", or a part of a name. Without it: the first\n"
        "GPU, else the first CPU.");
    command.on_call(run, [options] { return devices(*options); });
}

}  // namespace tool
