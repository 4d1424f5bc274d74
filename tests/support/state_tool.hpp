// Small batches on disk, and the states that a run of the command line makes of them.
#pragma once

#include <chrono>
#include <limits>
#include <thread>

#include "support/states.hpp"
#include "support/tool.hpp"

namespace clratio::test {

template <class Condition> void wait_until(Condition condition) {
    for (int k = 0; k < 12000; ++k, std::this_thread::sleep_for(std::chrono::milliseconds(5)))
        if (condition()) return;
    ADD_FAILURE() << "nothing happened in a minute";
}

/// Batches of small images on disk, and the sums that they have.
class Batches {
public:
    explicit Batches(int count) {
        for (int k = 0; k < count; ++k) {
            Samples draw(static_cast<std::uint64_t>(k) + 1);
            Image m = state_shape(), t = m;
            m.alpha[0] = static_cast<float>(k);
            m.values = floats(state_values, [&] { return draw.normal(); });
            if (k == 1) m.values[3] = std::numeric_limits<float>::quiet_NaN();
            t.values = floats(state_values, [&] { return draw.uniform(); });
            write_image(m_file(k), m);
            write_image(t_file(k), t);
            m_.push_back(std::move(m));
            t_.push_back(std::move(t));
        }
    }

    std::string m_file(int k) const { return folder_ / ("m_" + std::to_string(k) + ".exr"); }
    std::string t_file(int k) const { return folder_ / ("t_" + std::to_string(k) + ".exr"); }

    /// combine with batches [begin, end).
    Words combine(int begin, int end) const {
        Words words{"combine", "--m"};
        for (int k = begin; k < end; ++k) words.push_back(m_file(k));
        words.emplace_back("--t");
        for (int k = begin; k < end; ++k) words.push_back(t_file(k));
        return words;
    }

    /// The sums of these batches, added in this order.
    Snapshot sums(const std::vector<int>& order, MomentsOptions options = {}) const {
        Moments sum(engine_, state_values, options);
        for (const int k : order) sum.add(m_[static_cast<std::size_t>(k)], t_[static_cast<std::size_t>(k)]);
        return sum.snapshot();
    }
    Snapshot sums(int begin, int end) const {
        std::vector<int> order;
        for (int k = begin; k < end; ++k) order.push_back(k);
        return sums(order);
    }

private:
    Scratch folder_;
    Engine engine_;
    std::vector<Image> m_, t_;
};

/// Is this the state of batches [0, n), whole? What is wrong, in words, or nothing.
inline std::string verdict(const std::string& path, const Batches& batches, std::uint64_t least) {
    if (!std::filesystem::exists(path)) return least == 0 ? "" : "it is not there";
    try {
        const StateFile state = read_state(path);
        const std::uint64_t n = state.sums.batches();
        if (n < least) return "it has lost batches";
        if (state.ranges.text() != "[0," + std::to_string(n) + ")") return "it holds no prefix: " + state.ranges.text();
        return state.sums == batches.sums(0, static_cast<int>(n)) ? "" : "its sums are not those of " + state.ranges.text();
    } catch (const IoError& e) {
        return e.what();
    }
}

}  // namespace clratio::test
