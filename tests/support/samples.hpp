// Seeded inputs for tests: small, portable, the same on every machine.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

namespace clratio::test {

/// SplitMix64: one number after the other, every seed a stream of its own.
class Samples {
public:
    explicit Samples(std::uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15u) {}

    std::uint64_t bits() {
        std::uint64_t z = state_ += 0x9e3779b97f4a7c15u;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }
    /// In (0, 1).
    double uniform() { return (static_cast<double>(bits() >> 11) + 0.5) * 0x1p-53; }
    double normal() { return std::sqrt(-2 * std::log(uniform())) * std::cos(6.283185307179586 * uniform()); }
    double lognormal(double sigma) { return std::exp(sigma * normal() - sigma * sigma / 2); }

private:
    std::uint64_t state_;
};

/// `count` floats made by `draw()`.
template <class Draw> std::vector<float> floats(std::size_t count, Draw draw) {
    std::vector<float> v(count);
    for (auto& x : v) x = static_cast<float>(draw());
    return v;
}

}  // namespace clratio::test
