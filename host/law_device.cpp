// The law on a device; law.cpp has it on the host.
#include <string>

#include "clratio/law.hpp"
#include "launch.hpp"

namespace clratio {
namespace {

enum class Quantity { pdf, log_pdf, cdf, sf };

bool probability(Quantity q) { return q == Quantity::cdf || q == Quantity::sf; }

std::string kernel_name(Law law, Quantity q) {
    const std::string published = law == Law::published && !probability(q) ? "published_" : "";
    const char* const word[] = {"pdf", "log_pdf", "cdf", "sf"};
    return "clr_each_law_" + published + word[static_cast<int>(q)];
}

std::vector<device::clr_law> device_models(Law law, Quantity q, std::span<const ErrorModel> models) {
    if (models.empty()) throw InvalidArgument("models", "at least one", "none");
    std::vector<device::clr_law> out;
    out.reserve(models.size());
    for (const auto& model : models) {
        out.push_back(ErrorLaw(law, model).device_form());
        if (law == Law::published && probability(q) && out.back().s > 0)
            throw InvalidArgument("law", "one with a finite integral", "published, of a model with sigma_t > 0");
    }
    return out;
}

std::uint64_t points_of(std::uint64_t models, std::uint64_t x, std::uint64_t out) {
    if (out % models != 0 || out == 0)
        throw InvalidArgument("out", "a multiple of " + std::to_string(models) + " models", std::to_string(out) + " values");
    if (x != out && x != out / models)
        throw InvalidArgument("x", std::to_string(out) + " values, or " + std::to_string(out / models) + " for all models",
                              std::to_string(x));
    return out / models;
}

Event fill(const Engine& engine, Law law, Quantity q, std::span<const ErrorModel> models, const View& x, const View& out,
           std::span<const cl_event> waits) {
    const auto terms = device_models(law, q, models);
    const std::uint64_t points = points_of(models.size(), x.count, out.count);
    check_view("x", x, x.count);
    check_output("out", out, out.count);
    check_overlap("out", out, "x", x);
    if (x.mem == out.mem && x.count != out.count)
        throw InvalidArgument("out", "another buffer where all models share x", "the same buffer");
    const Buffer buffer = Buffer::copy_of(engine, std::as_bytes(std::span(terms)));
    const device::clr_law_task task{layout(x), layout(out), points, x.count == points, 0};
    return Launch(engine, "law", kernel_name(law, q))
        .arg(buffer)
        .arg(x.mem)
        .arg(out.mem)
        .arg(task)
        .after(waits)
        .run_ranges(out.count);
}

void fill(const Engine& engine, Law law, Quantity q, std::span<const ErrorModel> models, std::span<const float> x,
          std::span<float> out) {
    const Buffer xb = Buffer::from_host(engine, std::as_bytes(x));
    const Buffer ob = Buffer::onto_host(engine, std::as_writable_bytes(out));
    wait(fill(engine, law, q, models, {xb.mem(), 0, x.size()}, {ob.mem(), 0, out.size()}, {}));
    ob.publish();
}

}  // namespace

#define CLRATIO_LAW(quantity)                                                                                               \
    void law_##quantity(const Engine& engine, Law law, std::span<const ErrorModel> models, std::span<const float> x,        \
                        std::span<float> out) {                                                                             \
        fill(engine, law, Quantity::quantity, models, x, out);                                                              \
    }                                                                                                                       \
    cl_event law_##quantity(const Engine& engine, Law law, std::span<const ErrorModel> models, View x, View out,            \
                            std::span<const cl_event> wait_list) {                                                          \
        return fill(engine, law, Quantity::quantity, models, x, out, wait_list).give();                                     \
    }

CLRATIO_LAW(pdf)
CLRATIO_LAW(log_pdf)
CLRATIO_LAW(cdf)
CLRATIO_LAW(sf)

}  // namespace clratio
