// clratio law: density and probability of an estimator's error.
#include "clratio/law.hpp"

#include <cmath>
#include <map>

#include "command.hpp"

namespace tool {
namespace {

using clratio::ErrorLaw;
using clratio::Law;

const std::map<std::string, Law> laws = {{"exact", Law::exact},
                                         {"published", Law::published},
                                         {"mc", Law::mc},
                                         {"integral", Law::integral},
                                         {"exact-integral", Law::exact_integral}};

struct Options {
    std::string law = "exact";
    clratio::ErrorModel model;
    std::vector<double> x;
    bool json = false;
};

ErrorLaw law_of(const Options& options) {
    try {
        return {laws.at(options.law), options.model};
    } catch (const clratio::InvalidArgument& e) {
        throw UsageError(e.what());
    }
}

// A number where there is one: JSON knows no NaN and no infinity.
Json number(double v) { return std::isfinite(v) ? Json(v) : std::isnan(v) ? Json() : Json(v > 0 ? "inf" : "-inf"); }

Json describe(const Options& options, const ErrorLaw& law) {
    const auto& m = law.model();
    Json out{{"law", options.law},
             {"mu", m.mu},
             {"tau", m.tau},
             {"sigma_m", m.sigma_m},
             {"sigma_t", m.sigma_t},
             {"rho", m.rho},
             {"n", m.n},
             {"mode", number(law.modes().front())},
             {"median", number(law.median())},
             {"bias", number(law.bias())},
             {"tail_constant", number(law.tail_constant())},
             {"results", Json::array()}};
    for (const double v : options.x)
        out["results"].push_back({{"x", number(v)},
                                  {"pdf", number(law.pdf(v))},
                                  {"log_pdf", number(law.log_pdf(v))},
                                  {"cdf", number(law.cdf(v))},
                                  {"sf", number(law.sf(v))}});
    return out;
}

int law(const Options& options) {
    const ErrorLaw law = law_of(options);
    if (options.json) {
        print(describe(options, law));
        return ok;
    }
    fmt::print("{:>16}  {:>22}  {:>22}\n", "x", "pdf", "cdf");
    for (const double v : options.x) fmt::print("{:>16.9g}  {:>22.16g}  {:>22.16g}\n", v, law.pdf(v), law.cdf(v));
    return ok;
}

}  // namespace

void add_law(CLI::App& app, Run& run) {
    auto options = std::make_shared<Options>();
    auto& model = options->model;
    std::vector<std::string> names;
    for (const auto& [name, law] : laws) names.push_back(name);
    Command command(app, "law", "Print density and probability of an estimator's error, estimate - truth");
    command.option("--law", options->law, "exact, published (eq. 22), mc (plain mean), integral (eq. 17), exact-integral")
        .one_of(names)
        .type("LAW");
    command.option("--mu", model.mu, "Mean of m").required();
    command.option("--tau", model.tau, "Mean of t").required();
    command.option("--sigma-m", model.sigma_m, "Standard deviation of one sample of m").required();
    command.option("--sigma-t", model.sigma_t, "Standard deviation of one sample of t").required();
    command.option("--rho", model.rho, "Correlation of m and t (0)");
    command.option("--n", model.n, "Samples in an estimate (1)");
    command.option("--x", options->x, "Errors to print, separated by blanks or commas; write -0.5, not -.5")
        .required()
        .commas();
    command.flag("--json", options->json, "Print one JSON object; NaN is null");
    command.footer("The published law has no finite integral where --sigma-t is not 0: its cdf is nan (null).\n\n"
                   "Example: clratio law --law exact --mu .5 --tau 1 --sigma-m .5 --sigma-t .35 --n 4 --x -1 -0.5 0 .5 1");
    command.on_call(run, [options] { return law(*options); });
}

}  // namespace tool
