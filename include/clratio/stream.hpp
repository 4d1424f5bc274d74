// Random streams: words, uniform and normal numbers as pure functions of (stream, index), on the device or one by one on the
// host.
#pragma once

#include <cstdint>
#include <span>

#include "clratio/device/stream.h"
#include "clratio/engine.hpp"
#include "clratio/view.hpp"

namespace clratio {

enum class Generator : std::uint32_t {
    philox = CLR_PHILOX,    ///< Philox4x32-10: the default, for everything
    pcg4d3x = CLR_PCG4D3X,  ///< our own hash, up to 1.8 times as fast: for pictures and histograms of up to 1e9 draws
};

/// Domains keep draws apart: equal seeds, ids and indices in two domains share no numbers. The library's own are named; 4 to
/// 15 are free for users.
enum class Domain : std::uint32_t {
    user = CLR_DOMAIN_USER,
    error = CLR_DOMAIN_ERROR,
    scene = CLR_DOMAIN_SCENE,
    study = CLR_DOMAIN_STUDY,
};

/// A stream of 2^62 words, of which each kind of draw has the first 2^60 of its own. Seeds are of 64 bits with philox, of 32
/// with pcg4d3x.
struct Stream {
    std::uint64_t seed = 0;
    std::uint32_t id = 0;
    Generator generator = Generator::philox;
    Domain domain = Domain::user;
};

/// No draw has an index of end_of_stream or more.
inline constexpr std::uint64_t end_of_stream = std::uint64_t{1} << 60;

/// Draw i alone, on the host: the bits the device gives. Words are uniform on all 2^32 values.
/// uniform, normal: from word i; uniform_double, normal_double: from the words 2 i (low) and 2 i + 1 (high).
/// Ranges: uniform [2^-24, 1 - 2^-24], uniform_double [2^-53, 1 - 2^-53], |normal| [2.9e-10, 6.338] within 8 ulp and 6e-7 of
/// the quantile at (word + 1/2) 2^-32, |normal_double| [6.8e-20, 9.155] within 2e-15 relative of it. Never 0, 1, infinite or
/// NaN. Errors: InvalidArgument (a seed, domain or index out of range). Source: docs/streams.md; Salmon et al. 2011;
/// Jarzynski and Olano 2020; Wichura's AS 241 for doubles.
std::uint32_t word(const Stream& stream, std::uint64_t index);
float uniform(const Stream& stream, std::uint64_t index);
float normal(const Stream& stream, std::uint64_t index);
double uniform_double(const Stream& stream, std::uint64_t index);
double normal_double(const Stream& stream, std::uint64_t index);

/// Draws first, first + 1, .. into out; blocking. Errors: as above, for the whole range; doubles need a device with fp64.
/// Cost: the bytes of out, used in place on devices that share host memory. Determinism: the same bits on every device with
/// correctly rounded + - * / sqrt and fma, at every width, work size and split.
void fill_words(const Engine& engine, const Stream& stream, std::uint64_t first, std::span<std::uint32_t> out);
void fill_uniforms(const Engine& engine, const Stream& stream, std::uint64_t first, std::span<float> out);
void fill_uniforms(const Engine& engine, const Stream& stream, std::uint64_t first, std::span<double> out);
void fill_normals(const Engine& engine, const Stream& stream, std::uint64_t first, std::span<float> out);
void fill_normals(const Engine& engine, const Stream& stream, std::uint64_t first, std::span<double> out);

/// The same to device memory: enqueued after wait_list, nothing waits; the caller releases the event. The elements of the
/// view are uint32 for words, float64 for the double forms. Errors: also a view that overlaps itself or does not fit its
/// buffer.
cl_event fill_words(const Engine& engine, const Stream& stream, std::uint64_t first, View out,
                    std::span<const cl_event> wait_list = {});
cl_event fill_uniforms(const Engine& engine, const Stream& stream, std::uint64_t first, View out,
                       std::span<const cl_event> wait_list = {});
cl_event fill_uniforms_double(const Engine& engine, const Stream& stream, std::uint64_t first, View out,
                              std::span<const cl_event> wait_list = {});
cl_event fill_normals(const Engine& engine, const Stream& stream, std::uint64_t first, View out,
                      std::span<const cl_event> wait_list = {});
cl_event fill_normals_double(const Engine& engine, const Stream& stream, std::uint64_t first, View out,
                             std::span<const cl_event> wait_list = {});

}  // namespace clratio
