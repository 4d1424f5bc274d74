// The three models of the estimators' comparison, sampled on the device: correlated, independent, heavy-tailed.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "clratio/moments.hpp"

namespace tool {

/// t > 0; m = V t with a visibility V in {0, 1} (A, A0, C), or a number of its own (B).
struct PairModel {
    std::string name, text;
    std::uint32_t code;
    double mu, tau;  ///< E[m], E[t]
};

/// A: t lognormal(.8), V more often 1 where t is large. A0: the same t, V independent. B: m and t independent
/// lognormal(.6). C: t Pareto(2.2), V more often 0 where t is large. Lognormals have mean 1.
std::span<const PairModel> pair_models();

/// Draws batches of a model into device buffers: `values` replicates each, every batch the mean of `weight` samples.
class PairSampler {
public:
    PairSampler(const clratio::Engine& engine, const PairModel& model, std::uint64_t values, std::uint64_t seed);
    PairSampler(const PairSampler&) = delete;
    PairSampler& operator=(const PairSampler&) = delete;
    ~PairSampler();

    /// The views live until the next call. Samples are numbered through all batches.
    clratio::Batch next(std::uint32_t weight);

private:
    clratio::Engine engine_;
    PairModel model_;
    std::uint64_t values_, padded_, seed_, drawn_ = 0;
    cl_program program_ = nullptr;
    cl_kernel kernel_ = nullptr;
    cl_mem m_ = nullptr, t_ = nullptr;
};

}  // namespace tool
