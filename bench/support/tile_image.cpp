// tile_image IN OUT WIDTH HEIGHT: an image of that size, tiled with IN.
#include <cstdlib>
#include <exception>
#include <iostream>

#include "clratio/image.hpp"

namespace {

int run(const char* in, const char* out, int width, int height) {
    const clratio::Image tile = clratio::read_image(in);
    const auto tile_width = static_cast<std::size_t>(tile.width()), tile_height = static_cast<std::size_t>(tile.height());
    clratio::Image image;
    image.channels = tile.channels;
    image.data_window = {0, 0, width - 1, height - 1};
    const auto columns = static_cast<std::size_t>(width), rows = static_cast<std::size_t>(height), n = tile.channels.size();
    image.values.reserve(columns * rows * n);
    for (std::size_t y = 0; y < rows; ++y)
        for (std::size_t x = 0; x < columns; ++x)
            for (std::size_t c = 0; c < n; ++c)
                image.values.push_back(tile.values[((y % tile_height) * tile_width + x % tile_width) * n + c]);
    clratio::write_image(out, image);
    return 0;
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc == 5) return run(argv[1], argv[2], std::atoi(argv[3]), std::atoi(argv[4]));
    std::cerr << "usage: tile_image IN OUT WIDTH HEIGHT\n";
    return 2;
} catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
}
