// clratio compare: how far an image is from a reference.
#include "command.hpp"
#include "difference.hpp"

namespace tool {
namespace {

constexpr auto relative_mse_formula = "mean((a - r)^2 / (r^2 + epsilon))";

struct Options {
    std::string image, reference, layer;
    bool json = false;
};

int compare(const Options& options) {
    const auto image = clratio::read_image(options.image, options.layer);
    const auto reference = clratio::read_image(options.reference, options.layer);
    const Difference d = difference(image, reference);
    if (d.compared == 0)
        throw clratio::IoError(image.path, image.layer, "no value is finite in it and in " + reference.path);
    if (options.json) {
        print(Json{{"values", d.values},
                   {"compared", d.compared},
                   {"nonfinite", d.nonfinite},
                   {"nonfinite_reference", d.nonfinite_ref},
                   {"rmse", d.rmse},
                   {"bias", d.bias},
                   {"mae", d.mae},
                   {"relative_mse", d.relative_mse},
                   {"relative_mse_formula", relative_mse_formula},
                   {"relative_mse_epsilon", relative_mse_epsilon}});
        return ok;
    }
    fmt::print("RMSE          {:.6g}\nbias          {:.6g}\nMAE           {:.6g}\n", d.rmse, d.bias, d.mae);
    fmt::print("relative MSE  {:.6g}   {}, epsilon = {}\n", d.relative_mse, relative_mse_formula, relative_mse_epsilon);
    fmt::print("values        {}   ({} pixels, {} channels)\n", d.values, d.values / image.channels.size(),
               image.channels.size());
    fmt::print("not finite    {} in {}, {} in {}{}\n", d.nonfinite, image.path, d.nonfinite_ref, reference.path,
               d.compared < d.values ? ": left out of the means" : "");
    return ok;
}

}  // namespace

void add_compare(CLI::App& app, Run& run) {
    auto options = std::make_shared<Options>();
    Command command(app, "compare", "Compare an image with a reference, over all pixels and channels");
    command.option("image", options->image, "The image, FILE or FILE:LAYER").required().type("A.exr");
    command.option("reference", options->reference, "What it should be, FILE or FILE:LAYER").required().type("REF.exr");
    command.option("--layer", options->layer, "The layer to read where a file names none").type("NAME");
    command.flag("--json", options->json, "Print one JSON object");
    command.footer("RMSE, bias (mean of A - REF), MAE and relative MSE (its formula and epsilon are printed) are over the\n"
                   "values that are finite in both files; the others are counted. Files of different sizes, windows or\n"
                   "channels are refused.\n\n"
                   "Example: clratio compare out.exr reference.exr --json");
    command.on_call(run, [options] { return compare(*options); });
}

}  // namespace tool
