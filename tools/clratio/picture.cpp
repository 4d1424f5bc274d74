// clratio picture: images side by side as one PNG.
#include <cmath>

#include "clratio/image.hpp"
#include "command.hpp"
#include "label.hpp"
#include "output_file.hpp"
#include "png.hpp"

namespace tool {
namespace {

constexpr int gap = 4;  // pixels between images
constexpr std::uint8_t paper = 255;

struct Options {
    std::vector<std::string> images, titles;
    std::string output, layer;
    double exposure = 0;  ///< stops
};

void require_colour(const clratio::Image& image) {
    if (image.channels.size() != 1 && image.channels.size() != 3)
        throw clratio::IoError(image.path, image.layer,
                               "a picture needs 1 or 3 channels, this has " + std::to_string(image.channels.size()));
}

Canvas draw(const std::vector<clratio::Image>& images, const Options& options) {
    const int width = images.front().width(), height = images.front().height();
    const int top = options.titles.empty() ? 0 : label_height + gap;
    const int count = static_cast<int>(images.size());
    Canvas canvas(count * (width + gap) - gap, top + height, paper);
    const double scale = std::exp2(options.exposure);
    for (int i = 0; i < count; ++i) {
        const auto& image = images[static_cast<std::size_t>(i)];
        const std::size_t channels = image.channels.size();
        const int left = i * (width + gap);
        if (!options.titles.empty()) draw_label(canvas, left, width, options.titles[static_cast<std::size_t>(i)]);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const float* value = &image.values[(static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                                    static_cast<std::size_t>(x)) *
                                                   channels];
                std::array<std::uint8_t, 3> colour{};
                for (std::size_t c = 0; c < 3; ++c) colour[c] = srgb(scale * value[channels == 1 ? 0 : c]);
                if (!std::all_of(value, value + channels, [](float v) { return std::isfinite(v); })) colour = {255, 0, 255};
                canvas.set(left + x, top + y, colour);
            }
    }
    return canvas;
}

int picture(const Options& options) {
    if (!options.titles.empty() && options.titles.size() != options.images.size())
        throw UsageError(fmt::format("--titles has {} titles for {} images", options.titles.size(), options.images.size()));
    require_place_for(options.output);
    const auto output = identity_of(options.output);
    std::vector<clratio::Image> images;
    for (const auto& file : options.images) {
        if (identity_of(file) == output) throw UsageError(options.output + ": an input, and the output");
        images.push_back(clratio::read_image(file, options.layer));
        require_colour(images.back());
        clratio::require_same_shape(images.front(), images.back());
    }
    const Canvas canvas = draw(images, options);
    OutputFile out(options.output);
    out.write(png_of(canvas, options.output));
    out.commit();
    fmt::print("{}: {} image{}, {}x{} pixels\n", options.output, images.size(), images.size() == 1 ? "" : "s",
               canvas.width(), canvas.height());
    return ok;
}

}  // namespace

void add_picture(CLI::App& app, Run& run) {
    auto o = std::make_shared<Options>();
    Command command(app, "picture", "Put images side by side in one PNG");
    command.option("images", o->images, "Images of one shape, Y or RGB").required().type("FILE");
    command.option("-o,--output", o->output, "The PNG").required().type("OUT.png");
    command.option("--exposure", o->exposure, "Brighten by this many stops")
        .type("STOPS")
        .between(-100, 100)
        .shows_default();
    command.option("--titles", o->titles, "One for each image, with commas between").commas().type("TEXT,...");
    command.option("--layer", o->layer, "The layer to read where a file names none").type("NAME");
    command.footer("Values 0 to 1 get the sRGB transfer curve, others are clipped; a NaN or an infinity is magenta.\n\n"
                   "Example: clratio picture mean.exr out.exr reference.exr -o side.png --titles mean,ratio,reference");
    command.on_call(run, [o] { return picture(*o); });
}

}  // namespace tool
