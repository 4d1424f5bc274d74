#include "native_medium.hpp"

#include <algorithm>
#include <array>
#include <set>

namespace peers {
namespace {

using namespace clratio::device;

void take_lane(MediumPixels& to, std::size_t lane, const clr_medium_ray& ray, const clr_medium_plan& plan,
               const clr_shadows& shadows) {
    for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t i = 0; i < 3; ++i) {
            to.slope[c][i][lane] = plan.depth[c][i].slope;
            to.offset[c][i][lane] = plan.depth[c][i].offset;
        }
        for (std::size_t i = 0; i < 2; ++i) to.piece_from[c][i][lane] = plan.piece_from[c][i];
        to.low[c][lane] = plan.low[c];
        to.rise[c][lane] = plan.rise[c];
        to.start[c][lane] = plan.start[c];
        to.stride[c][lane] = plan.stride[c];
    }
    for (std::size_t i = 0; i < 2; ++i) to.channel_from[i][lane] = plan.channel_from[i];
    to.length[lane] = ray.length;
    to.scale[lane] = plan.scale[0];
    for (std::size_t k = 0; k < 9; ++k) {
        to.base[k][lane] = shadows.base[k];
        to.rate[k][lane] = shadows.rate[k];
    }
}

MediumPixels vector_of(const clr_medium& scene, const std::vector<float>& occluders, std::size_t lanes, std::uint32_t x,
                       std::uint32_t y) {
    MediumPixels out{};
    out.pixel = y * scene.width + x;
    std::set<const float*> spheres, boxes;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
        const clr_medium_ray ray = clr_aim(scene, occluders.data(), x + static_cast<std::uint32_t>(lane), y);
        const clr_medium_plan plan = clr_make_plan(CLR_WVDS_MIS, scene, &ray);
        std::array<clr_u32, CLR_SHADOW_LIST> list{};
        clr_shadows shadows{};
        shadows.list = list.data();
        clr_find_shadows(scene, occluders.data(), &ray, &shadows);
        for (std::uint32_t i = 0; i < shadows.spheres; ++i) spheres.insert(occluders.data() + list[i]);
        for (std::uint32_t i = 0; i < shadows.boxes; ++i) boxes.insert(occluders.data() + list[CLR_MOST_OCCLUDERS + i]);
        take_lane(out, lane, ray, plan, shadows);
    }
    out.spheres.assign(spheres.begin(), spheres.end());
    out.boxes.assign(boxes.begin(), boxes.end());
    return out;
}

}  // namespace

std::vector<MediumPixels> medium_pixels(const clr_medium& scene, const std::vector<float>& occluders, std::size_t lanes) {
    std::vector<MediumPixels> out;
    for (std::uint32_t y = 0; y < scene.height; ++y)
        for (std::uint32_t x = 0; x < scene.width; x += static_cast<std::uint32_t>(lanes))
            if (auto v = vector_of(scene, occluders, lanes, x, y);
                std::any_of(v.length, v.length + lanes, [](float d) { return d > 0; }))
                out.push_back(std::move(v));
    return out;
}

}  // namespace peers
