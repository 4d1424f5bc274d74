// Device memory and kernel launches; nothing else knows OpenCL's launch rules. Private to the library.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "clratio/device/layout.h"
#include "clratio/engine.hpp"
#include "clratio/view.hpp"
#include "opencl.hpp"

namespace clratio {

/// Waits for an event and turns a failed kernel into a DeviceError.
void wait(const Event& event);

/// Device memory. Over host memory it is used in place where device and host share it.
class Buffer {
public:
    Buffer() = default;
    Buffer(const Engine& engine, std::size_t bytes);
    /// For small ones: zeros are copied from the host. Waits for nothing on the queue.
    static Buffer zeroed(const Engine& engine, std::size_t bytes);
    static Buffer from_host(const Engine& engine, std::span<const std::byte> bytes,
                            cl_mem_flags access = CL_MEM_READ_ONLY);  ///< read by kernels
    /// The host memory may go at once.
    static Buffer copy_of(const Engine& engine, std::span<const std::byte> bytes, cl_mem_flags access = CL_MEM_READ_ONLY);
    static Buffer onto_host(const Engine& engine, std::span<std::byte> bytes);  ///< written; see publish()
    static Buffer over_host(const Engine& engine, std::span<std::byte> bytes);  ///< read, then written; see publish()

    void read(std::span<std::byte> to, std::size_t offset = 0) const;
    void write(std::span<const std::byte> from, std::size_t offset = 0) const;
    void publish() const;  ///< makes what kernels wrote over or onto the host's memory visible to the host

    cl_mem mem() const { return memory_.get(); }
    std::size_t size() const { return size_; }
    explicit operator bool() const { return static_cast<bool>(memory_); }

private:
    Queue queue_;
    Memory memory_;
    std::size_t size_ = 0;
    std::span<std::byte> host_;
};

device::clr_layout layout(const View& view);

/// The most work-items that run_ranges() starts: how many rows a kernel's counters need.
std::size_t most_work_items(const Engine& engine);

/// Throws InvalidArgument unless the view holds `count` values inside its buffer.
void check_view(const char* name, const View& view, std::uint64_t count, std::size_t element_bytes = sizeof(float));
/// The same, and where pixels lie among each other.
void check_output(const char* name, const View& view, std::uint64_t count, std::size_t element_bytes = sizeof(float));
/// Throws InvalidArgument where the elements of two outputs lie among each other.
void check_apart(const char* name, const View& output, const char* other_name, const View& other);
/// Throws InvalidArgument where an output shares elements with another view without being the same view.
void check_overlap(const char* name, const View& output, const char* other_name, const View& other);

/// Waits until a command is over, failed or not.
void wait_quietly(const Event& event);

/// Waits for the last launch of a state when its scope ends, also by an exception: launches read their caller's memory.
class Joined {
public:
    explicit Joined(const Event& last) : last_(last) {}
    Joined(const Joined&) = delete;
    ~Joined() { wait_quietly(last_); }

private:
    const Event& last_;
};

/// A row of `columns` counters for each work-item, all 0.
template <std::size_t columns> Buffer zeroed_rows(const Engine& engine) {
    return Buffer::zeroed(engine, most_work_items(engine) * columns * sizeof(std::uint64_t));
}

/// The sums of counters that each work-item keeps a row of.
template <std::size_t columns> std::array<std::uint64_t, columns> sums_of_rows(const Buffer& rows) {
    std::vector<std::uint64_t> all(rows.size() / sizeof(std::uint64_t));
    rows.read(std::as_writable_bytes(std::span(all)));
    std::array<std::uint64_t, columns> sums{};
    for (std::size_t i = 0; i < all.size(); ++i) sums[i % columns] += all[i];
    return sums;
}

/// How many lanes a kernel has: the engine's, or two vectors in step (Engine::State::wide).
enum class Lanes { engine, wide };

/// One kernel call: arguments in order, then how to run it.
class Launch {
public:
    Launch(const Engine& engine, const std::string& word, const std::string& kernel, const std::string& options = "",
           Lanes lanes = Lanes::engine);

    Launch& arg(cl_mem mem);
    Launch& arg(const Buffer& buffer) { return arg(buffer.mem()); }
    template <class T>
    requires std::is_trivially_copyable_v<T> Launch& arg(const T& value) { return raw(&value, sizeof value); }
    /// A view's buffer and its clr_layout, two arguments.
    Launch& view(const View& v);
    Launch& local(std::size_t bytes) { return raw(nullptr, bytes); }
    Launch& after(std::span<const cl_event> events);

    /// Adds a last argument, the clr_range of `count` values, and cuts them into work-items.
    Event run_ranges(std::uint64_t count);
    /// `groups` work-groups of `size` work-items.
    Event run_groups(std::size_t groups, std::size_t size);

private:
    Launch& raw(const void* value, std::size_t size);
    Event enqueue(std::size_t global, std::size_t local);

    Engine engine_;
    int width_;
    Kernel kernel_;
    cl_uint next_ = 0;
    std::vector<cl_event> waits_;
};

}  // namespace clratio
