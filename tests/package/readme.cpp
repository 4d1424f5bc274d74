#include <clratio/clratio.hpp>
#include <clratio/image.hpp>
#include <iostream>

int main(int argc, char** argv) {
    if (argc < 5) return std::cerr << "usage: " << argv[0] << " TAU OUT M T [M T ...]\n", 2;
    clratio::Engine engine;  // or Engine{queue}
    const auto tau = clratio::read_image(argv[1]);
    clratio::Moments sum{engine, tau.size()};
    for (int k = 3; k + 1 < argc; k += 2) sum.add(clratio::read_image(argv[k]), clratio::read_image(argv[k + 1]));
    const auto out = clratio::combine(sum, tau, {.zero = clratio::Zero::mc_mean});
    clratio::write_image(argv[2], out.estimate);
    std::cout << out.flags.total() << " values flagged\n";
}
