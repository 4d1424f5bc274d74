#include "launch.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>

#include "engine_state.hpp"
#include "large.hpp"

namespace clratio {

void wait(const Event& event) {
    const cl_event e = event.get();
    if (e) check(clWaitForEvents(1, &e), "clWaitForEvents");
}

namespace {

Memory allocate(const Engine& engine, cl_mem_flags flags, std::size_t bytes, void* host) {
    const auto largest = engine.info().largest_allocation;
    if (largest && bytes > largest)
        throw InvalidArgument("device memory",
                              "at most " + std::to_string(largest) + " bytes in one buffer on " + engine.info().name,
                              std::to_string(bytes));
    cl_int code = CL_SUCCESS;
    Memory memory(clCreateBuffer(engine.context(), flags, std::max<std::size_t>(bytes, 1), host, &code));
    check(code, "clCreateBuffer");
    return memory;
}

void CL_CALLBACK free_host(cl_mem, void* memory) { std::free(memory); }

// Large buffers that the host shares lie in huge pages: fewer faults, and fewer translations where a kernel runs through
// twenty arrays at once. Each starts at another cache set than the one before, or the arrays would take turns in a few sets.
Memory allocate_huge(const Engine& engine, std::size_t bytes) {
    static std::atomic<std::size_t> made{0};
    constexpr std::size_t skew = 4096 + 256, skews = 16;
    const std::size_t whole = (bytes + skews * skew + huge_page - 1) / huge_page * huge_page;
    void* host = std::aligned_alloc(huge_page, whole);
    if (!host) return allocate(engine, CL_MEM_READ_WRITE, bytes, nullptr);
#ifdef MADV_HUGEPAGE
    madvise(host, whole, MADV_HUGEPAGE);
#endif
    try {
        auto* start = static_cast<std::byte*>(host) + made++ % skews * skew;
        Memory memory = allocate(engine, CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR, bytes, start);
        check(clSetMemObjectDestructorCallback(memory.get(), free_host, host), "clSetMemObjectDestructorCallback");
        return memory;
    } catch (...) {
        std::free(host);
        throw;
    }
}

Memory allocate_own(const Engine& engine, std::size_t bytes) {
    return engine.info().host_memory && bytes >= huge_page ? allocate_huge(engine, bytes)
                                                           : allocate(engine, CL_MEM_READ_WRITE, bytes, nullptr);
}

}  // namespace

Buffer::Buffer(const Engine& engine, std::size_t bytes)
    : queue_(engine.state().queue), memory_(allocate_own(engine, bytes)), size_(bytes) {}

Buffer Buffer::zeroed(const Engine& engine, std::size_t bytes) {
    return copy_of(engine, std::vector<std::byte>(bytes), CL_MEM_READ_WRITE);
}

Buffer Buffer::from_host(const Engine& engine, std::span<const std::byte> bytes, cl_mem_flags access) {
    Buffer b;
    const bool in_place = engine.info().host_memory && !bytes.empty();
    const cl_mem_flags use = bytes.empty() ? 0 : in_place ? CL_MEM_USE_HOST_PTR : CL_MEM_COPY_HOST_PTR;
    b.queue_ = engine.state().queue;
    b.memory_ = allocate(engine, access | use, bytes.size(), bytes.empty() ? nullptr : const_cast<std::byte*>(bytes.data()));
    b.size_ = bytes.size();
    return b;
}

Buffer Buffer::copy_of(const Engine& engine, std::span<const std::byte> bytes, cl_mem_flags access) {
    Buffer b;
    b.queue_ = engine.state().queue;
    b.memory_ = allocate(engine, access | (bytes.empty() ? cl_mem_flags{0} : CL_MEM_COPY_HOST_PTR), bytes.size(),
                         bytes.empty() ? nullptr : const_cast<std::byte*>(bytes.data()));
    b.size_ = bytes.size();
    return b;
}

Buffer Buffer::onto_host(const Engine& engine, std::span<std::byte> bytes) {
    if (engine.info().host_memory) return over_host(engine, bytes);
    Buffer b;
    b.queue_ = engine.state().queue;
    b.memory_ = allocate(engine, CL_MEM_READ_WRITE, bytes.size(), nullptr);
    b.size_ = bytes.size();
    b.host_ = bytes;
    return b;
}

Buffer Buffer::over_host(const Engine& engine, std::span<std::byte> bytes) {
    Buffer b = from_host(engine, bytes, CL_MEM_READ_WRITE);
    b.host_ = bytes;
    return b;
}

void Buffer::read(std::span<std::byte> to, std::size_t offset) const {
    if (to.empty()) return;
    check(clEnqueueReadBuffer(queue_.get(), mem(), CL_TRUE, offset, to.size(), to.data(), 0, nullptr, nullptr),
          "clEnqueueReadBuffer");
}

void Buffer::write(std::span<const std::byte> from, std::size_t offset) const {
    if (from.empty()) return;
    check(clEnqueueWriteBuffer(queue_.get(), mem(), CL_TRUE, offset, from.size(), from.data(), 0, nullptr, nullptr),
          "clEnqueueWriteBuffer");
}

void Buffer::publish() const {
    if (host_.empty()) return;
    cl_int code = CL_SUCCESS;
    void* mapped = clEnqueueMapBuffer(queue_.get(), mem(), CL_TRUE, CL_MAP_READ, 0, size_, 0, nullptr, nullptr, &code);
    check(code, "clEnqueueMapBuffer");
    if (mapped != host_.data()) std::copy_n(static_cast<const std::byte*>(mapped), size_, host_.data());
    cl_event unmapped = nullptr;
    check(clEnqueueUnmapMemObject(queue_.get(), mem(), mapped, 0, nullptr, &unmapped), "clEnqueueUnmapMemObject");
    wait(Event(unmapped));
}

namespace {

constexpr std::uint64_t block = 32;  // vectors: ranges are cut between whole blocks of kernels/moments.cl

std::uint64_t most_groups(const Engine::State& s) { return 64ull * std::max(1u, s.info.compute_units); }

/// Bytes of a view in the buffer that its own may be a part of.
struct Place {
    cl_mem root;
    std::uint64_t begin, end;
};

Place place_of(const View& view) {
    cl_mem parent = nullptr;
    std::size_t from = 0;
    check(clGetMemObjectInfo(view.mem, CL_MEM_ASSOCIATED_MEMOBJECT, sizeof parent, &parent, nullptr), "clGetMemObjectInfo");
    if (parent) check(clGetMemObjectInfo(view.mem, CL_MEM_OFFSET, sizeof from, &from, nullptr), "clGetMemObjectInfo");
    return {parent ? parent : view.mem, from + view.offset * sizeof(float), from + view.end() * sizeof(float)};
}

}  // namespace

std::size_t most_work_items(const Engine& engine) {
    const auto& s = engine.state();
    return s.work_items * (s.grouped ? most_groups(s) : 1);
}

device::clr_layout layout(const View& v) { return {v.offset, v.stride, v.channels}; }

void check_view(const char* name, const View& view, std::uint64_t count, std::size_t element_bytes) {
    if (!view.mem) throw InvalidArgument(name, "a device buffer", "null");
    if (view.count != count) throw InvalidArgument(name, std::to_string(count) + " values", std::to_string(view.count));
    if (view.channels == 0) throw InvalidArgument(name, "at least one channel", "0");
    std::size_t bytes = 0;
    check(clGetMemObjectInfo(view.mem, CL_MEM_SIZE, sizeof bytes, &bytes, nullptr), "clGetMemObjectInfo");
    const std::size_t elements = bytes / element_bytes;
    if (!view.fits(elements))
        throw InvalidArgument(name, "a view inside its buffer of " + std::to_string(elements) + " elements",
                              "one of " + std::to_string(view.count) + " values from " + std::to_string(view.offset) +
                                  " on");
}

void check_output(const char* name, const View& view, std::uint64_t count, std::size_t element_bytes) {
    check_view(name, view, count, element_bytes);
    if (view.stride < view.channels)
        throw InvalidArgument(name, "a stride of at least its " + std::to_string(view.channels) + " channels",
                              std::to_string(view.stride));
}

void check_apart(const char* name, const View& output, const char* other_name, const View& other) {
    const Place a = place_of(output), b = place_of(other);
    if (a.root == b.root && a.begin < b.end && b.begin < a.end)
        throw InvalidArgument(name, std::string("a view apart from ") + other_name, "one that overlaps it");
}

void check_overlap(const char* name, const View& output, const char* other_name, const View& other) {
    const Place a = place_of(output), b = place_of(other);
    if (a.root == b.root && a.begin == b.begin && output.stride == other.stride && output.channels == other.channels) return;
    check_apart(name, output, (std::string(other_name) + ", or the very same").c_str(), other);
}

Launch::Launch(const Engine& engine, const std::string& word, const std::string& kernel, const std::string& options,
               Lanes lanes)
    : engine_(engine), width_(lanes == Lanes::wide ? engine.state().wide : engine.width()) {
    cl_int code = CL_SUCCESS;
    kernel_ = Kernel(clCreateKernel(program(engine.state(), word, width_, options).get(), kernel.c_str(), &code));
    check(code, "clCreateKernel");
}

Launch& Launch::raw(const void* value, std::size_t size) {
    check(clSetKernelArg(kernel_.get(), next_, size, value), "clSetKernelArg");
    ++next_;
    return *this;
}

Launch& Launch::arg(cl_mem mem) { return raw(&mem, sizeof mem); }

Launch& Launch::view(const View& v) { return arg(v.mem).arg(layout(v)); }

// A driver may wait for ever for what has failed before (PoCL 3.1 does).
void require_not_failed(cl_event event) {
    cl_int status = CL_COMPLETE;
    check(clGetEventInfo(event, CL_EVENT_COMMAND_EXECUTION_STATUS, sizeof status, &status, nullptr), "clGetEventInfo");
    if (status < 0) throw DeviceError("a command that was to be waited for", status);
}

void wait_quietly(const Event& event) {
    if (const cl_event e = event.get()) clWaitForEvents(1, &e);
}

Launch& Launch::after(std::span<const cl_event> events) {
    for (cl_event e : events) {
        if (!e) continue;
        require_not_failed(e);
        waits_.push_back(e);
    }
    return *this;
}

Event Launch::run_ranges(std::uint64_t count) {
    const auto& s = engine_.state();
    const auto width = static_cast<std::uint64_t>(width_);
    const std::uint64_t vectors = std::max<std::uint64_t>(1, (count + width - 1) / width);
    if (s.grouped) {
        arg(device::clr_range{count, 0});
        const std::uint64_t groups = std::min<std::uint64_t>((vectors + s.work_items - 1) / s.work_items, most_groups(s));
        return enqueue(groups * s.work_items, s.work_items);
    }
    const std::uint64_t blocks = (vectors + block - 1) / block;
    const std::uint64_t items = std::min<std::uint64_t>(s.work_items, blocks);
    arg(device::clr_range{count, (blocks + items - 1) / items * block});
    return enqueue(items, 1);
}

Event Launch::run_groups(std::size_t groups, std::size_t size) { return enqueue(groups * size, size); }

Event Launch::enqueue(std::size_t global, std::size_t local) {
    cl_event done = nullptr;
    const auto n = static_cast<cl_uint>(waits_.size());
    check(clEnqueueNDRangeKernel(engine_.queue(), kernel_.get(), 1, nullptr, &global, &local, n, n ? waits_.data() : nullptr,
                                 &done),
          "clEnqueueNDRangeKernel");
    Event event(done);
    check(clFlush(engine_.queue()), "clFlush");
    return event;
}

}  // namespace clratio
