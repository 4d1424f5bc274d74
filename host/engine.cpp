#define CL_USE_DEPRECATED_OPENCL_1_2_APIS  // clCreateCommandQueue: all that an OpenCL 1.2 device has
#include "clratio/engine.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <cstring>

#include "clratio/device/portable.h"
#include "engine_state.hpp"
#include "launch.hpp"
#include "pocl.hpp"

namespace clratio {
namespace {

constexpr auto no_platform = "No OpenCL platform: install one for the CPU with 'apt install pocl-opencl-icd', or your GPU "
                             "vendor's; drivers are looked for through the .icd files in /etc/OpenCL/vendors (or "
                             "$OCL_ICD_VENDORS)";

DeviceError no_devices() {
    const std::string trouble = trouble_with_pocl_cache();
    std::string why = no_platform;
    if (!trouble.empty()) why += ". If it is PoCL and installed: it does not start, as " + trouble;
    return {"clGetPlatformIDs", -1001, why};
}

struct Found {
    cl_platform_id platform;
    cl_device_id device;
    DeviceInfo info;
};

template <class Get, class Object> std::string text(Get get, Object object, cl_uint what) {
    std::size_t size = 0;
    if (get(object, what, 0, nullptr, &size) != CL_SUCCESS || size == 0) return "";
    std::string s(size, '\0');
    check(get(object, what, size, s.data(), nullptr), "clGetInfo");
    s.resize(std::strlen(s.c_str()));
    return s;
}

template <class T> T number(cl_device_id device, cl_device_info what) {
    T value{};
    const cl_int code = clGetDeviceInfo(device, what, sizeof value, &value, nullptr);
    return code == CL_SUCCESS ? value : T{};
}

DeviceInfo describe(cl_platform_id platform, cl_device_id device) {
    DeviceInfo d;
    d.platform = text(clGetPlatformInfo, platform, CL_PLATFORM_NAME);
    d.name = text(clGetDeviceInfo, device, CL_DEVICE_NAME);
    d.vendor = text(clGetDeviceInfo, device, CL_DEVICE_VENDOR);
    d.version = text(clGetDeviceInfo, device, CL_DEVICE_VERSION);
    d.driver = text(clGetDeviceInfo, device, CL_DRIVER_VERSION);
    d.type = number<cl_device_type>(device, CL_DEVICE_TYPE);
    d.compute_units = number<cl_uint>(device, CL_DEVICE_MAX_COMPUTE_UNITS);
    d.global_memory = number<cl_ulong>(device, CL_DEVICE_GLOBAL_MEM_SIZE);
    d.largest_allocation = number<cl_ulong>(device, CL_DEVICE_MAX_MEM_ALLOC_SIZE);
    d.fp64 = number<cl_device_fp_config>(device, CL_DEVICE_DOUBLE_FP_CONFIG) != 0;
    const auto fp = number<cl_device_fp_config>(device, CL_DEVICE_SINGLE_FP_CONFIG);
    d.correctly_rounded_divide = (fp & CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT) != 0;
    d.fma = (fp & CL_FP_FMA) != 0;
    d.host_memory = number<cl_bool>(device, CL_DEVICE_HOST_UNIFIED_MEMORY) == CL_TRUE;
    const auto native = number<cl_uint>(device, CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT);
    d.native_width = native >= 16 ? 16 : native >= 8 ? 8 : native >= 4 ? 4 : 1;
    return d;
}

std::vector<Found> find_devices() {
    cl_uint platform_count = 0;
    const cl_int code = clGetPlatformIDs(0, nullptr, &platform_count);
    if (code == -1001 || (code == CL_SUCCESS && platform_count == 0)) return {};
    check(code, "clGetPlatformIDs");
    std::vector<cl_platform_id> platforms(platform_count);
    check(clGetPlatformIDs(platform_count, platforms.data(), nullptr), "clGetPlatformIDs");
    std::vector<Found> found;
    for (std::size_t p = 0; p < platforms.size(); ++p) {
        cl_uint count = 0;
        if (clGetDeviceIDs(platforms[p], CL_DEVICE_TYPE_ALL, 0, nullptr, &count) != CL_SUCCESS) continue;
        std::vector<cl_device_id> devices(count);
        check(clGetDeviceIDs(platforms[p], CL_DEVICE_TYPE_ALL, count, devices.data(), nullptr), "clGetDeviceIDs");
        for (std::size_t d = 0; d < devices.size(); ++d) {
            found.push_back({platforms[p], devices[d], describe(platforms[p], devices[d])});
            found.back().info.id = std::to_string(p) + ":" + std::to_string(d);
        }
    }
    return found;
}

std::string lower(std::string s) {
    std::transform(s.begin(), s.end(), s.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return s;
}

bool is(const Found& f, cl_device_type type) { return (f.info.type & type) != 0; }

bool matches(const Found& f, const std::string& wish) {
    if (f.info.id == wish) return true;
    if (wish == "gpu") return is(f, CL_DEVICE_TYPE_GPU);
    if (wish == "cpu") return is(f, CL_DEVICE_TYPE_CPU);
    return lower(f.info.name).find(wish) != std::string::npos;
}

std::string kind(const Found& f) {
    return is(f, CL_DEVICE_TYPE_GPU) ? "gpu" : is(f, CL_DEVICE_TYPE_CPU) ? "cpu" : "accelerator";
}

std::string ids(const std::vector<Found>& found) {
    std::string s;
    for (const auto& f : found) s += (s.empty() ? "" : ", ") + f.info.id + " (" + kind(f) + ", " + f.info.name + ")";
    return s;
}

std::pair<Found, std::string> pick() {
    const auto found = find_devices();
    if (found.empty()) throw no_devices();
    if (const char* wish = std::getenv("CLRATIO_DEVICE"); wish && *wish) {
        const auto f = std::find_if(found.begin(), found.end(), [&](const Found& x) { return matches(x, lower(wish)); });
        if (f == found.end())
            throw InvalidArgument("CLRATIO_DEVICE", "a kind, an id or a part of the name of what is there: " + ids(found),
                                  wish);
        return {*f, std::string("CLRATIO_DEVICE=") + wish};
    }
    const auto first = [&](cl_device_type type) {
        return std::find_if(found.begin(), found.end(), [&](const Found& f) { return is(f, type); });
    };
    if (const auto gpu = first(CL_DEVICE_TYPE_GPU); gpu != found.end()) return {*gpu, "the first GPU"};
    if (const auto cpu = first(CL_DEVICE_TYPE_CPU); cpu != found.end()) return {*cpu, "no GPU: the first CPU"};
    return {found.front(), "neither GPU nor CPU: the first device"};
}

void choose_shape(Engine::State& s) {
    const EngineOptions& o = s.options;
    const bool cpu = (s.info.type & CL_DEVICE_TYPE_CPU) != 0;
    if (o.width != 0 && o.width != 1 && o.width != 2 && o.width != 4 && o.width != 8 && o.width != 16)
        throw InvalidArgument("width", "1, 2, 4, 8 or 16 lanes", std::to_string(o.width));
    s.grouped = o.path == EngineOptions::Path::groups || (o.path == EngineOptions::Path::automatic && !cpu);
    s.width = o.width ? o.width : s.grouped ? 1 : s.info.native_width;
    s.wide = o.width == 0 && !s.grouped && s.width >= 8 && is_pocl(s.info) ? 2 * s.width : s.width;
    const auto most = number<std::size_t>(s.device, CL_DEVICE_MAX_WORK_GROUP_SIZE);
    if (s.grouped && o.work_items > most)
        throw InvalidArgument("work_items", "at most " + std::to_string(most) + " in a group on " + s.info.name,
                              std::to_string(o.work_items));
    const std::uint32_t usual =
        s.grouped ? static_cast<std::uint32_t>(std::min<std::size_t>(most, 64)) : 8 * std::max(1u, s.info.compute_units);
    s.work_items = o.work_items ? o.work_items : usual;
}

void refuse_other_bits(const Engine& engine) {
    const auto& d = engine.info();
    if (engine.state().options.require != Require::same_bits) return;
    if ((d.correctly_rounded_divide && d.fma) || engine.self_test()) return;
    throw InvalidArgument("Require::same_bits",
                          "a device with correctly rounded division and fma, or one that passes the self-test", d.name);
}

}  // namespace

std::vector<DeviceInfo> list_devices() {
    std::vector<DeviceInfo> all;
    for (auto& f : find_devices()) all.push_back(std::move(f.info));
    return all;
}

Pick pick_device() {
    auto [found, reason] = pick();
    return {std::move(found.info), std::move(reason)};
}

Engine::Engine(EngineOptions options) : state_(std::make_shared<State>()) {
    const Found found = pick().first;
    auto& s = *state_;
    s.options = options;
    s.device = found.device;
    s.info = found.info;
    cl_int code = CL_SUCCESS;
    const std::array<cl_context_properties, 3> properties{CL_CONTEXT_PLATFORM,
                                                          reinterpret_cast<cl_context_properties>(found.platform), 0};
    s.context = Context(clCreateContext(properties.data(), 1, &s.device, nullptr, nullptr, &code));
    check(code, "clCreateContext");
    s.queue = Queue(clCreateCommandQueue(s.context.get(), s.device, 0, &code));
    check(code, "clCreateCommandQueue");
    choose_shape(s);
    refuse_other_bits(*this);
    save_at_exit(state_);
}

Engine::Engine(cl_command_queue queue, EngineOptions options) : state_(std::make_shared<State>()) {
    if (!queue) throw InvalidArgument("queue", "an OpenCL command queue", "null");
    auto& s = *state_;
    s.options = options;
    s.queue = Queue::share(queue);
    cl_context context = nullptr;
    check(clGetCommandQueueInfo(queue, CL_QUEUE_CONTEXT, sizeof context, &context, nullptr), "clGetCommandQueueInfo");
    s.context = Context::share(context);
    check(clGetCommandQueueInfo(queue, CL_QUEUE_DEVICE, sizeof s.device, &s.device, nullptr), "clGetCommandQueueInfo");
    s.info = describe(number<cl_platform_id>(s.device, CL_DEVICE_PLATFORM), s.device);
    choose_shape(s);
    refuse_other_bits(*this);
    save_at_exit(state_);
}

const DeviceInfo& Engine::info() const { return state_->info; }
cl_command_queue Engine::queue() const { return state_->queue.get(); }
cl_context Engine::context() const { return state_->context.get(); }
cl_device_id Engine::device() const { return state_->device; }
int Engine::width() const { return state_->width; }
bool Engine::grouped() const { return state_->grouped; }
std::uint32_t Engine::work_items() const { return state_->work_items; }

namespace {

constexpr std::size_t self_test_values = 64;

// Operands over many binades, subnormal results left out: x = +-(1 + k 2^-23) 2^e from a fixed recurrence.
std::array<float, 3 * self_test_values> self_test_operands() {
    std::array<float, 3 * self_test_values> x{};
    std::uint32_t r = 1;
    for (auto& v : x) {
        r = r * 747796405u + 2891336453u;
        v = std::bit_cast<float>((r & 0x807fffffu) | ((112u + (r >> 8) % 31u) << 23));
    }
    return x;
}

}  // namespace

bool Engine::self_test() const {
    using namespace device;
    const auto x = self_test_operands();
    constexpr std::size_t n = self_test_values;
    const auto in = Buffer::from_host(*this, std::as_bytes(std::span(x)));
    std::array<float, 6 * n> out{};
    Buffer result(*this, sizeof out);
    wait(Launch(*this, "engine", "clr_self_test").arg(in).arg(result).arg(static_cast<cl_uint>(n)).run_ranges(n));
    result.read(std::as_writable_bytes(std::span(out)));
    for (std::size_t i = 0; i < n; ++i) {
        const float a = x[i], b = x[n + i], c = x[2 * n + i];
        const std::array<float, 6> want{a + b, a - b, a * b, a / b, clr_sqrt(clr_abs(a)), clr_fma(a, b, c)};
        for (std::size_t k = 0; k < want.size(); ++k)
            if (clr_bits(want[k]) != clr_bits(out[k * n + i])) return false;
    }
    return true;
}

}  // namespace clratio
