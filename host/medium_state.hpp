// A scene as kernels take it. Private to the library.
#pragma once

#include "clratio/medium.hpp"
#include "launch.hpp"

namespace clratio {

struct MediumScene::State {
    State(const Engine& engine, const Scene& scene, Frame frame);

    Engine engine;
    Scene scene;
    Frame frame;
    device::clr_medium device{};
    std::vector<float> occluders;
    std::vector<float> shares;  ///< mu / tau in planes of the device's channels, with room for a whole vector at the end
    Buffer occluder_buffer, share_buffer;
    std::vector<std::uint32_t> row_hits;  ///< for each row, how many rays hit the medium
};

// What rendering and counting errors share. Errors: InvalidArgument for what is out of range.
void check_sampler(const Sampler& sampler);
void check_levels(std::uint32_t levels);
device::clr_stream scene_stream(Stream stream);
device::clr_sampler device_sampler(const Sampler& sampler, std::uint32_t samples);
std::string options_of(const Sampler& sampler, Generator generator);  ///< of the program

}  // namespace clratio
