// States of a small image, and files of them that are wrong in one way.
#pragma once

#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <ImfStringVectorAttribute.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "clratio/moments.hpp"
#include "clratio/state.hpp"
#include "support/exr.hpp"
#include "support/samples.hpp"

namespace clratio::test {

constexpr int state_width = 5, state_height = 3;
constexpr std::size_t state_values = 3 * state_width * state_height;

inline Image state_shape() {
    Image shape;
    shape.channels = {"R", "G", "B"};
    shape.data_window = {-2, 7, -2 + state_width - 1, 7 + state_height - 1};
    shape.display_window = {0, 0, 9, 9};
    shape.alpha.assign(state_width * state_height, .5f);
    return shape;
}

/// Batch k of a sequence that never ends; batch 1 holds NaN.
inline void add_batch(Moments& sum, std::uint64_t k) {
    Samples draw(k + 1);
    const auto m = floats(sum.size(), [&] { return k == 1 && draw.uniform() < .1 ? std::nan("") : draw.normal(); });
    const auto t = floats(sum.size(), [&] { return draw.uniform(); });
    const HostBatch batch{m, t, 1, k};
    sum.add(std::span(&batch, 1));
}

/// The state of batches [first, first + batches).
inline StateFile state_of(const Engine& engine, std::uint64_t first, std::uint64_t batches, MomentsOptions options = {}) {
    StateFile s;
    s.shape = state_shape();
    s.settings = {{"layer.m", "shadow"}, {"layer.t", ""}};
    Moments sum(engine, state_values, options);
    for (std::uint64_t k = first; k < first + batches; ++k) add_batch(sum, k);
    s.sums = sum.snapshot();
    s.ranges.add({first, first + batches});
    return s;
}

inline bool same(const StateFile& a, const StateFile& b) {
    return a.sums == b.sums && a.shape.channels == b.shape.channels && a.shape.data_window == b.shape.data_window &&
           a.shape.display_window == b.shape.display_window && a.shape.alpha == b.shape.alpha && a.settings == b.settings &&
           a.ranges == b.ranges;
}

/// Moments drawn evenly from the time that some work takes, which is found out on the way: the same on a busy machine.
class RandomDelays {
public:
    explicit RandomDelays(std::uint64_t seed) : draw_(seed) {}
    void sleep() { std::this_thread::sleep_for(draw_.uniform() * whole_); }
    void was_too_late() { whole_ *= .8; }
    void was_too_early() { whole_ *= 1.1; }

private:
    Samples draw_;
    std::chrono::duration<double> whole_{.1};
};

/// Copies the file with another header; pixels of channels that it no longer names are left out.
template <class Change> void rewrite(const std::string& from, const std::string& to, Change change) {
    Imf::InputFile in(from.c_str());
    Imf::Header header = in.header();
    change(header);
    const auto window = in.header().dataWindow();
    const std::size_t width = static_cast<std::size_t>(window.max.x - window.min.x + 1);
    const std::size_t pixels = width * static_cast<std::size_t>(window.max.y - window.min.y + 1);
    std::vector<std::vector<std::uint32_t>> planes;
    Imf::FrameBuffer frame;
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
        planes.emplace_back(pixels);
        frame.insert(c.name(), Imf::Slice::Make(c.channel().type, planes.back().data(), window, 4, 4 * width));
    }
    in.setFrameBuffer(frame);
    in.readPixels(window.min.y, window.max.y);
    Imf::OutputFile out(to.c_str(), header);
    out.setFrameBuffer(frame);
    out.writePixels(window.max.y - window.min.y + 1);
}

inline void drop_channel(Imf::Header& header, const std::string& name) {
    Imf::ChannelList left;
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c)
        if (name != c.name()) left.insert(c.name(), c.channel());
    header.channels() = left;
}

inline void set_text(Imf::Header& header, const char* name, const std::string& text) {
    header.insert(name, Imf::StringAttribute(text));
}

}  // namespace clratio::test
