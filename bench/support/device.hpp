// What benches share: device arrays, waiting, and the in-place scaling that bounds every kernel that streams memory.
#pragma once

#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "clratio/clratio.hpp"

namespace clratio::bench {

/// A float buffer on the engine's device, filled with `value`; null where the device cannot hold it.
class Array {
public:
    Array(const Engine& engine, std::uint64_t count, float value);
    Array(Array&& other) noexcept : mem_(std::exchange(other.mem_, nullptr)), count_(other.count_) {}
    ~Array();
    View view() const { return {mem_, 0, count_}; }
    cl_mem mem() const { return mem_; }
    explicit operator bool() const { return mem_ != nullptr; }

private:
    cl_mem mem_ = nullptr;
    std::uint64_t count_ = 0;
};

void finish(cl_event event);

/// True where `bytes` fit beside each other; else the bench is skipped and says so.
bool fits(benchmark::State& state, const Engine& engine, std::uint64_t bytes, std::uint64_t largest);

/// items/s, bytes/s.
void report(benchmark::State& state, std::uint64_t items, std::uint64_t bytes);

/// Floats that a kernel reads and writes for each value; in_place: it writes over what it read.
struct Mix {
    std::uint32_t reads, writes;
    bool in_place = false;
};

/// Moves as many floats, one after the other in memory, and only adds up what it reads.
void mixed_limit(benchmark::State& state, std::uint64_t values, Mix mix);

/// x *= 1.0000001 in place over arrays of `bytes / 2` in all: it moves `bytes`.
void scaling_limit(benchmark::State& state, std::uint64_t bytes);

}  // namespace clratio::bench
