#include "estimator_models.hpp"

#include <algorithm>
#include <array>
#include <boost/math/quadrature/tanh_sinh.hpp>
#include <cmath>
#include <limits>

#include "clratio/device/stream.h"
#include "clratio/stream.hpp"

namespace tool {
namespace {

// A work-item takes CLR_WIDTH replicates; block sample * padded + replicate of the stream holds its words.
constexpr auto source = R"(
static inline clr_real lognormal(clr_uint word, float sigma) {
    return clr_exp(clr_fma(clr_normal(word), (clr_real)(sigma), (clr_real)(-0.5f * sigma * sigma)));
}

kernel void draw_pairs(global float* m, global float* t, uint model, ulong seed, ulong first_sample, uint samples,
                       ulong padded) {
    const ulong first = get_global_id(0) * CLR_WIDTH;
    clr_stream stream = {seed, 0, CLR_DOMAIN_USER};
    const clr_real one = (clr_real)(1.0f), zero = (clr_real)(0.0f);
    clr_real m_sum = zero, t_sum = zero;
    for (uint i = 0; i < samples; ++i) {
        const clr_words w = clr_draw(CLR_PHILOX, stream, (first_sample + i) * padded + first);
        clr_real t_one = lognormal(w.w0, model == 2 ? 0.6f : 0.8f);
        clr_real seen = clr_fma((clr_real)(0.7f), t_one / (one + t_one), (clr_real)(0.2f));
        if (model == 1) seen = (clr_real)(0.6f);
        if (model == 3) {
            // Two words for u: a lattice of one would cut the tail, and a fifth of E[t^2] with it.
            const clr_real below = clr_fma(clr_to_real(w.w2), (clr_real)(0x1p-32f), (clr_real)(0x1p-33f));
            const clr_real u = (clr_to_real(w.w0) + below) * (clr_real)(0x1p-32f);
            t_one = clr_exp(clr_log(u) * (clr_real)(-1.0f / 2.2f));
            seen = (clr_real)(0.8f) / clr_fma((clr_real)(0.3f), t_one - one, one);
        }
        const clr_real visible = clr_uniform(w.w1) < seen ? t_one : zero;
        m_sum += model == 2 ? lognormal(w.w1, 0.6f) : visible;
        t_sum += t_one;
    }
    const clr_real count = (clr_real)((float)samples);
    clr_store(m_sum / count, m + first);
    clr_store(t_sum / count, t + first);
})";

/// E[f(t)] for a lognormal t of mean 1.
template <class F> double lognormal_mean(double sigma, F f) {
    constexpr double step = 1.0 / 64, root = 2.5066282746310005;  // sqrt(2 pi); the trapezoidal rule, exact to rounding
    double sum = 0;
    for (double z = -12; z <= 12; z += step) sum += std::exp(-z * z / 2) * f(std::exp(sigma * z - sigma * sigma / 2));
    return sum * step / root;
}

double mean_of_a() {
    return lognormal_mean(0.8, [](double t) { return (0.2 + 0.7 * t / (1 + t)) * t; });
}

double mean_of_c() {
    boost::math::quadrature::tanh_sinh<double> integrate;
    const auto f = [](double u) {
        const double t = std::pow(u, -1 / 2.2);
        return 0.8 / (1 + 0.3 * (t - 1)) * t;
    };
    return integrate.integrate(f, 0.0, 1.0);
}

void check(cl_int code, const char* call) {
    if (code != CL_SUCCESS) throw clratio::DeviceError(call, code);
}

}  // namespace

std::span<const PairModel> pair_models() {
    static const std::array models{
        PairModel{"A", "m = V t, V in {0, 1} with P(V) = .2 + .7 t / (1 + t), t lognormal(.8)", 0, mean_of_a(), 1},
        PairModel{"A0", "the same t, P(V) = .6", 1, 0.6, 1}, PairModel{"B", "m and t independent, lognormal(.6)", 2, 1, 1},
        PairModel{"C", "m = V t, P(V) = .8 / (1 + .3 (t - 1)), t Pareto(2.2)", 3, mean_of_c(), 2.2 / 1.2}};
    return models;
}

PairSampler::PairSampler(const clratio::Engine& engine, const PairModel& model, std::uint64_t values, std::uint64_t seed)
    : engine_(engine), model_(model), values_(values), padded_((values + 15) / 16 * 16), seed_(seed) {
    const std::string text = clratio::device_source() + source;
    const char* strings = text.c_str();
    const cl_device_id device = engine_.device();
    cl_int code = CL_SUCCESS;
    program_ = clCreateProgramWithSource(engine_.context(), 1, &strings, nullptr, &code);
    check(code, "clCreateProgramWithSource");
    const std::string options = "-cl-std=CL1.2 -DCLR_GROUPED=0 -DCLR_FP64=0 -DCLR_WIDTH=" + std::to_string(engine_.width());
    check(clBuildProgram(program_, 1, &device, options.c_str(), nullptr, nullptr), "clBuildProgram");
    kernel_ = clCreateKernel(program_, "draw_pairs", &code);
    check(code, "clCreateKernel");
    for (cl_mem* buffer : {&m_, &t_}) {
        *buffer = clCreateBuffer(engine_.context(), CL_MEM_READ_WRITE, padded_ * sizeof(float), nullptr, &code);
        check(code, "clCreateBuffer");
    }
}

PairSampler::~PairSampler() {
    for (cl_mem buffer : {m_, t_})
        if (buffer) clReleaseMemObject(buffer);
    if (kernel_) clReleaseKernel(kernel_);
    if (program_) clReleaseProgram(program_);
}

clratio::Batch PairSampler::next(std::uint32_t weight) {
    const cl_uint samples = weight, model = model_.code;
    const cl_ulong seed = seed_, first = drawn_, padded = padded_;
    cl_uint index = 0;
    const auto arg = [&](std::size_t size, const void* value) {
        check(clSetKernelArg(kernel_, index++, size, value), "clSetKernelArg");
    };
    arg(sizeof m_, &m_);
    arg(sizeof t_, &t_);
    arg(sizeof model, &model);
    arg(sizeof seed, &seed);
    arg(sizeof first, &first);
    arg(sizeof samples, &samples);
    arg(sizeof padded, &padded);
    const std::size_t work_items = padded_ / static_cast<std::size_t>(engine_.width());
    check(clEnqueueNDRangeKernel(engine_.queue(), kernel_, 1, nullptr, &work_items, nullptr, 0, nullptr, nullptr),
          "clEnqueueNDRangeKernel");
    drawn_ += weight;
    return {{m_, 0, values_}, {t_, 0, values_}, static_cast<double>(weight)};
}

}  // namespace tool
