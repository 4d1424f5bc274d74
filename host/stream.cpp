#include "clratio/stream.hpp"

#include "clratio/device/quantile.h"
#include "draws.hpp"

namespace clratio {

device::clr_stream device_stream(const Stream& s) {
    if (s.generator == Generator::pcg4d3x && s.seed > 0xffffffffu)
        throw InvalidArgument("seed", "below 2^32 with pcg4d3x", std::to_string(s.seed));
    if (static_cast<std::uint32_t>(s.domain) > 15)
        throw InvalidArgument("domain", "0 to 15", std::to_string(static_cast<std::uint32_t>(s.domain)));
    return {s.seed, s.id, static_cast<std::uint32_t>(s.domain)};
}

void check_range(std::uint64_t first, std::uint64_t count) {
    if (first > end_of_stream || count > end_of_stream - first)
        throw InvalidArgument("range", "an end of at most 2^60", std::to_string(first) + " + " + std::to_string(count));
}

void require_fp64(const Engine& engine, const char* what) {
    if (!engine.info().fp64) throw InvalidArgument(what, "a device with fp64", engine.info().name);
}

std::string generator_option(Generator generator) {
    return generator == Generator::philox ? "-DCLR_GENERATOR=CLR_PHILOX" : "-DCLR_GENERATOR=CLR_PCG4D3X";
}

BlockRange blocks_of(std::uint64_t first, std::uint64_t count, std::uint64_t per_block, int width) {
    const auto lanes = static_cast<std::uint64_t>(width);
    const std::uint64_t begin = first / per_block / lanes, end = (first + count - 1) / per_block / lanes + 1;
    return {begin * lanes, (end - begin) * lanes};
}

namespace {

cl_event fill(const Engine& engine, const char* kernel, std::uint64_t per_block, std::size_t element_bytes,
              const Stream& stream, std::uint64_t first, View out, std::span<const cl_event> wait_list) {
    const auto device = device_stream(stream);
    check_range(first, out.count);
    check_output("out", out, out.count, element_bytes);
    if (element_bytes == sizeof(double)) require_fp64(engine, "double draws");
    const auto blocks = blocks_of(first, std::max<std::uint64_t>(1, out.count), per_block, engine.width());
    return Launch(engine, "stream", kernel, generator_option(stream.generator))
        .view(out)
        .arg(device)
        .arg(cl_ulong{first})
        .arg(cl_ulong{out.count})
        .arg(cl_ulong{blocks.first})
        .after(wait_list)
        .run_ranges(blocks.count)
        .give();
}

device::clr_words block(const Stream& stream, std::uint64_t index, std::uint64_t per_block) {
    check_range(index, 1);
    return device::clr_draw(static_cast<std::uint32_t>(stream.generator), device_stream(stream), index / per_block);
}

struct WordPair {
    std::uint32_t low, high;
};

WordPair word_pair(const Stream& stream, std::uint64_t index) {
    const auto w = block(stream, index, 2);
    return index % 2 ? WordPair{w.w2, w.w3} : WordPair{w.w0, w.w1};
}

}  // namespace

std::uint32_t word(const Stream& stream, std::uint64_t index) {
    const auto w = block(stream, index, 4);
    const std::uint32_t words[]{w.w0, w.w1, w.w2, w.w3};
    return words[index % 4];
}

float uniform(const Stream& stream, std::uint64_t index) { return device::clr_uniform(word(stream, index)); }
float normal(const Stream& stream, std::uint64_t index) { return device::clr_normal(word(stream, index)); }

double uniform_double(const Stream& stream, std::uint64_t index) {
    const auto w = word_pair(stream, index);
    return device::clr_uniform_double(w.low, w.high);
}

double normal_double(const Stream& stream, std::uint64_t index) {
    const auto w = word_pair(stream, index);
    return device::clr_normal_double(w.low, w.high);
}

cl_event fill_words(const Engine& engine, const Stream& stream, std::uint64_t first, View out,
                    std::span<const cl_event> wait_list) {
    return fill(engine, "clr_fill_words", 4, sizeof(std::uint32_t), stream, first, out, wait_list);
}

cl_event fill_uniforms(const Engine& engine, const Stream& stream, std::uint64_t first, View out,
                       std::span<const cl_event> wait_list) {
    return fill(engine, "clr_fill_uniforms", 4, sizeof(float), stream, first, out, wait_list);
}

cl_event fill_uniforms_double(const Engine& engine, const Stream& stream, std::uint64_t first, View out,
                              std::span<const cl_event> wait_list) {
    return fill(engine, "clr_fill_uniforms_double", 2, sizeof(double), stream, first, out, wait_list);
}

cl_event fill_normals(const Engine& engine, const Stream& stream, std::uint64_t first, View out,
                      std::span<const cl_event> wait_list) {
    return fill(engine, "clr_fill_normals", 4, sizeof(float), stream, first, out, wait_list);
}

cl_event fill_normals_double(const Engine& engine, const Stream& stream, std::uint64_t first, View out,
                             std::span<const cl_event> wait_list) {
    return fill(engine, "clr_fill_normals_double", 2, sizeof(double), stream, first, out, wait_list);
}

void fill_words(const Engine& engine, const Stream& stream, std::uint64_t first, std::span<std::uint32_t> out) {
    fill_in_parts(engine, first, out, [&](View part, std::uint64_t at) { return fill_words(engine, stream, at, part); });
}

void fill_uniforms(const Engine& engine, const Stream& stream, std::uint64_t first, std::span<float> out) {
    fill_in_parts(engine, first, out, [&](View part, std::uint64_t at) { return fill_uniforms(engine, stream, at, part); });
}

void fill_uniforms(const Engine& engine, const Stream& stream, std::uint64_t first, std::span<double> out) {
    fill_in_parts(engine, first, out,
                  [&](View part, std::uint64_t at) { return fill_uniforms_double(engine, stream, at, part); });
}

void fill_normals(const Engine& engine, const Stream& stream, std::uint64_t first, std::span<float> out) {
    fill_in_parts(engine, first, out, [&](View part, std::uint64_t at) { return fill_normals(engine, stream, at, part); });
}

void fill_normals(const Engine& engine, const Stream& stream, std::uint64_t first, std::span<double> out) {
    fill_in_parts(engine, first, out,
                  [&](View part, std::uint64_t at) { return fill_normals_double(engine, stream, at, part); });
}

}  // namespace clratio
