#include "clratio/medium.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "draws.hpp"
#include "medium_state.hpp"
#include "scene.hpp"
#include "vector3.hpp"

namespace clratio {
namespace {

constexpr std::uint32_t widest = 16;   // lanes
constexpr double no_component = 1e-7;  // of the light's direction: below, float does not see it move

void take(float (&to)[3], const Vector3& from) {
    for (std::size_t k = 0; k < 3; ++k) to[k] = static_cast<float>(from[k]);
}

void split(float (&to)[2][3], std::size_t k, double x) {
    to[0][k] = static_cast<float>(x);
    to[1][k] = static_cast<float>(x - static_cast<double>(to[0][k]));
}

/// The light as kernels see it, in double: everything that depends on its direction alone.
struct Light {
    explicit Light(const Vector3& toward) : omega(unit(toward)) {
        for (std::size_t k = 0; k < 3; ++k) {
            moves[k] = std::abs(omega[k]) >= no_component;
            skew[k] = moves[k] ? 1 / omega[k] : 1;
        }
        const std::size_t k = std::abs(omega[0]) < 0.6 ? 0 : std::abs(omega[1]) < 0.6 ? 1 : 2;
        Vector3 axis{};
        axis[k] = 1;
        across1 = unit(cross(omega, axis));
        across2 = cross(omega, across1);
    }
    bool axial() const { return !(moves[0] && moves[1] && moves[2]); }

    Vector3 omega, skew{}, across1, across2;
    std::array<bool, 3> moves{};
};

void take_channels(device::clr_medium& d, const Medium& m) {
    const auto order = channel_order(m);
    for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t from = order[c];
        d.channel[c] = static_cast<std::uint32_t>(from);
        d.sigma[c] = static_cast<float>(m.sigma_t[from]);
        d.inverse_sigma[c] = static_cast<float>(1 / m.sigma_t[from]);
        d.strength[c] = static_cast<float>(m.sigma_s[from] * m.irradiance[from]);
    }
    // Of equal floats the mean is that float: gray media stay gray.
    d.sigma_mean = static_cast<float>((m.sigma_t[0] + m.sigma_t[1] + m.sigma_t[2]) / 3);
    if (d.sigma[0] == d.sigma[1] && d.sigma[1] == d.sigma[2]) d.sigma_mean = d.sigma[0];
    d.inverse_sigma_mean = static_cast<float>(1 / static_cast<double>(d.sigma_mean));
    d.phase[0] = static_cast<float>((1 - m.g * m.g) / (4 * std::numbers::pi));
    d.phase[1] = static_cast<float>(1 + m.g * m.g);
    d.phase[2] = static_cast<float>(2 * m.g);
}

void take_light(device::clr_medium& d, const Medium& m, const Light& light) {
    take(d.omega, light.omega);
    take(d.across[0], light.across1);
    take(d.across[1], light.across2);
    take(d.skew, light.skew);
    d.axial = light.axial();
    for (std::size_t k = 0; k < 3; ++k) {
        d.inverse_omega[k] = light.moves[k] ? d.skew[k] : 0;
        d.beyond[k] = light.moves[k] ? 0 : CLR_FAR;
        d.exit[k] = static_cast<float>(light.omega[k] > 0 ? m.box.hi[k] : m.box.lo[k]);
    }
}

device::clr_medium describe(const Scene& scene, Frame frame, const Light& light) {
    device::clr_medium d{};
    const CameraAxes axes = axes_of(scene.camera, frame);
    take(d.eye, scene.camera.eye);
    const Medium& medium = scene.medium;
    for (std::size_t k = 0; k < 3; ++k) {
        split(d.forward, k, axes.forward[k]);
        split(d.right, k, axes.right[k] / frame.width);
        split(d.up, k, axes.up[k] / frame.height);
        split(d.to_lo, k, medium.box.lo[k] - scene.camera.eye[k]);
        split(d.to_hi, k, medium.box.hi[k] - scene.camera.eye[k]);
    }
    take(d.lo, medium.box.lo);
    take(d.hi, medium.box.hi);
    take_light(d, medium, light);
    take_channels(d, medium);
    d.width = frame.width;
    d.height = frame.height;
    d.plane = frame.width * frame.height;
    d.spheres = static_cast<std::uint32_t>(scene.spheres.size());
    d.boxes = static_cast<std::uint32_t>(scene.boxes.size());
    return d;
}

void put(std::vector<float>& to, std::initializer_list<double> values) {
    for (const double x : values) to.push_back(static_cast<float>(x));
}

void put_sphere(std::vector<float>& to, const Sphere& s, const Vector3& eye, const Light& light) {
    put(to, {eye[0] - s.centre[0], eye[1] - s.centre[1], eye[2] - s.centre[2], s.radius * s.radius});
    put(to, {dot(s.centre, light.across1), dot(s.centre, light.across2), dot(s.centre, light.omega), 0});
}

/// The shadow of a box in the coordinates g_k = p_k skew_k: a ray toward the light leaves the box's slab k at far_k - g_k
/// and enters it at near_k - g_k, and must enter each before it leaves another.
void put_box(std::vector<float>& to, const Box& box, const Vector3& eye, const Light& light) {
    for (const Vector3& corner : {box.lo, box.hi}) put(to, {corner[0] - eye[0], corner[1] - eye[1], corner[2] - eye[2]});
    Vector3 near{}, far{};
    for (std::size_t k = 0; k < 3; ++k) {
        const bool up = light.skew[k] > 0;
        near[k] = (up ? box.lo[k] : box.hi[k]) * light.skew[k];
        far[k] = (up ? box.hi[k] : box.lo[k]) * light.skew[k];
    }
    for (const auto& [i, j] : {std::pair<std::size_t, std::size_t>{0, 1}, {0, 2}, {1, 2}}) {
        const bool bound = light.moves[i] && light.moves[j];
        const double always = 2 * static_cast<double>(CLR_FAR);
        put(to, {bound ? near[i] - far[j] : -always, bound ? far[i] - near[j] : always});
    }
    put(to, {far[0], far[1], far[2]});
    for (std::size_t k = 0; k < 3; ++k) put(to, {light.moves[k] ? -2 * static_cast<double>(CLR_FAR) : near[k]});
}

std::vector<float> occluder_table(const Scene& scene, const Light& light) {
    std::vector<float> table;
    for (const auto& s : scene.spheres) put_sphere(table, s, scene.camera.eye, light);
    for (const auto& b : scene.boxes) put_box(table, b, scene.camera.eye, light);
    if (table.empty()) table.push_back(0);
    return table;
}

/// The same picture around the origin where the medium lies far from it beside its size: floats would not tell its points
/// apart.
Scene near_origin(Scene scene) {
    Box& medium = scene.medium.box;
    Vector3 middle{};
    double size = 0, distance = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        middle[k] = (medium.lo[k] + medium.hi[k]) / 2;
        size = std::max(size, medium.hi[k] - medium.lo[k]);
        distance = std::max(distance, std::abs(middle[k]));
    }
    if (distance <= 4 * size) return scene;
    const auto move = [&](Vector3& point) {
        for (std::size_t k = 0; k < 3; ++k) point[k] -= middle[k];
    };
    for (Vector3* point : {&medium.lo, &medium.hi, &scene.camera.eye, &scene.camera.at}) move(*point);
    for (Sphere& s : scene.spheres) move(s.centre);
    for (Box& b : scene.boxes) {
        move(b.lo);
        move(b.hi);
    }
    return scene;
}

/// mu / tau in planes of the device's channels, with room for a whole vector at the end.
std::vector<float> share_planes(const Scene& scene, Frame frame, const device::clr_medium& d) {
    const ExactImage image = exact_image(scene, frame);
    std::vector<float> shares(std::size_t{3} * d.plane + widest);
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t p = 0; p < d.plane; ++p) {
            const double tau = image.tau[3 * p + d.channel[c]];
            if (tau > 0) shares[c * d.plane + p] = static_cast<float>(image.mu[3 * p + d.channel[c]] / tau);
        }
    return shares;
}

}  // namespace

MediumScene::State::State(const Engine& e, const Scene& s, Frame f) : engine(e), scene(s), frame(f) {
    const Light light(s.medium.light);
    const Scene near = near_origin(s);
    device = describe(near, f, light);
    occluders = occluder_table(near, light);
    shares = share_planes(s, f, device);
    occluder_buffer = Buffer::copy_of(e, std::as_bytes(std::span(occluders)));
    share_buffer = Buffer::copy_of(e, std::as_bytes(std::span(shares)));
    for (std::uint32_t y = 0; y < frame.height; ++y) {
        std::uint32_t hits = 0;
        for (std::uint32_t x = 0; x < frame.width; ++x) hits += device::clr_aim(device, occluders.data(), x, y).length > 0;
        row_hits.push_back(hits);
    }
}

MediumScene::MediumScene(const Engine& engine, const Scene& scene, Frame frame) {
    check_scene(scene);
    check_frame(frame);
    state_ = std::make_shared<State>(engine, scene, frame);
}

const Engine& MediumScene::engine() const { return state_->engine; }
const Scene& MediumScene::scene() const { return state_->scene; }
Frame MediumScene::frame() const { return state_->frame; }
std::uint64_t MediumScene::values(Rows rows) const {
    return std::uint64_t{3} * state_->frame.width * checked(rows, state_->frame).count;
}

void check_sampler(const Sampler& sampler) {
    name_of(sampler.sampling);
    name_of(sampler.pattern);
}

void check_levels(std::uint32_t levels) {
    if (levels < 1 || levels > most_levels)
        throw InvalidArgument("levels", "1 to " + std::to_string(most_levels), std::to_string(levels));
}

device::clr_stream scene_stream(Stream stream) {
    if (stream.id & CLR_INDEPENDENT) throw InvalidArgument("stream.id", "below 2^31", std::to_string(stream.id));
    stream.domain = Domain::scene;
    return device_stream(stream);
}

device::clr_sampler device_sampler(const Sampler& sampler, std::uint32_t samples) {
    return {static_cast<std::uint32_t>(sampler.pattern), sampler.independent, samples, 1 / static_cast<float>(samples)};
}

std::string options_of(const Sampler& sampler, Generator generator) {
    return generator_option(generator) + " -DCLR_SAMPLING=" + std::to_string(static_cast<std::uint32_t>(sampler.sampling)) +
           "u -DCLR_INDEPENDENT_T=" + (sampler.independent ? "1" : "0");
}

namespace {

void check_samples(std::uint32_t samples) {
    if (samples < 1 || samples > 1u << 24) throw InvalidArgument("samples", "1 to 2^24", std::to_string(samples));
}

/// Lanes of whole vectors for each row: what kernels over `rows` are cut into.
std::uint64_t lanes_of(const MediumScene& scene, std::uint32_t rows) {
    const auto width = static_cast<std::uint64_t>(scene.engine().width());
    return rows * ((scene.frame().width + width - 1) / width * width);
}

cl_event exact(const MediumScene& scene, Rows rows, View out, bool shaded, std::span<const cl_event> wait_list) {
    const auto& s = scene.state();
    rows = checked(rows, s.frame);
    check_output(shaded ? "mu" : "tau", out, scene.values(rows));
    return Launch(s.engine, "medium", "clr_medium_exact", options_of({}, Generator::philox))
        .view(out)
        .arg(s.device)
        .arg(s.occluder_buffer)
        .arg(s.share_buffer)
        .arg(cl_uint{shaded})
        .arg(cl_uint{rows.first})
        .after(wait_list)
        .run_ranges(lanes_of(scene, rows.count))
        .give();
}

cl_event draw(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t samples,
              std::uint32_t levels, Rows rows, const View& m, const View& t, std::span<const cl_event> wait_list) {
    const auto& s = scene.state();
    check_sampler(sampler);
    rows = checked(rows, s.frame);
    const std::uint64_t values = scene.values(rows) * std::max(1u, levels);
    check_output("m", m, values);
    check_output("t", t, values);
    check_apart("m", m, "t", t);
    return Launch(s.engine, "medium", "clr_medium_render", options_of(sampler, stream.generator))
        .view(m)
        .view(t)
        .arg(s.device)
        .arg(s.occluder_buffer)
        .arg(scene_stream(stream))
        .arg(device_sampler(sampler, samples))
        .arg(cl_uint{levels})
        .arg(cl_uint{rows.first})
        .arg(cl_ulong{scene.values(rows) / 3})
        .after(wait_list)
        .run_ranges(lanes_of(scene, rows.count))
        .give();
}

template <class Enqueue> std::vector<float> onto_host(const MediumScene& scene, Rows rows, Enqueue enqueue) {
    std::vector<float> out(scene.values(rows));
    const auto buffer = Buffer::onto_host(scene.engine(), std::as_writable_bytes(std::span(out)));
    wait(Event(enqueue(View{buffer.mem(), 0, out.size()})));
    buffer.publish();
    return out;
}

template <class Enqueue> RenderedImages pair_onto_host(const Engine& engine, std::uint64_t values, Enqueue enqueue) {
    RenderedImages out{std::vector<float>(values), std::vector<float>(values)};
    const auto m = Buffer::onto_host(engine, std::as_writable_bytes(std::span(out.m)));
    const auto t = Buffer::onto_host(engine, std::as_writable_bytes(std::span(out.t)));
    wait(Event(enqueue(View{m.mem(), 0, values}, View{t.mem(), 0, values})));
    m.publish();
    t.publish();
    return out;
}

}  // namespace

Rows checked(Rows rows, Frame frame) {
    if (rows.first >= frame.height || rows.count > frame.height - rows.first)
        throw InvalidArgument("rows", "rows of " + std::to_string(frame.height),
                              std::to_string(rows.count) + " from row " + std::to_string(rows.first));
    return {rows.first, rows.count ? rows.count : frame.height - rows.first};
}

cl_event tau_image(const MediumScene& scene, Rows rows, View tau, std::span<const cl_event> wait_list) {
    return exact(scene, rows, tau, false, wait_list);
}

cl_event reference_image(const MediumScene& scene, Rows rows, View mu, std::span<const cl_event> wait_list) {
    return exact(scene, rows, mu, true, wait_list);
}

cl_event render(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t samples, Rows rows,
                View m, View t, std::span<const cl_event> wait_list) {
    check_samples(samples);
    return draw(scene, sampler, stream, samples, 0, rows, m, t, wait_list);
}

cl_event render_levels(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t levels,
                       Rows rows, View m, View t, std::span<const cl_event> wait_list) {
    check_levels(levels);
    return draw(scene, sampler, stream, 1, levels, rows, m, t, wait_list);
}

cl_event render(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t samples, Moments& sums,
                std::span<const cl_event> wait_list) {
    const std::uint64_t values = scene.values();
    if (sums.size() != values)
        throw InvalidArgument("sums", "a state of " + std::to_string(values) + " values", std::to_string(sums.size()));
    if (&sums.engine().state() != &scene.engine().state())
        throw InvalidArgument("sums", "a state on the scene's Engine", "another's");
    const Buffer m(scene.engine(), values * sizeof(float)), t(scene.engine(), values * sizeof(float));
    const Batch batch{{m.mem(), 0, values}, {t.mem(), 0, values}, static_cast<double>(samples)};
    const Event rendered(render(scene, sampler, stream, samples, Rows{}, batch.m, batch.t, wait_list));
    const cl_event after = rendered.get();
    return sums.add(std::span(&batch, 1), {&after, 1});
}

std::vector<float> tau_image(const MediumScene& scene, Rows rows) {
    return onto_host(scene, rows, [&](View out) { return tau_image(scene, rows, out); });
}

std::vector<float> reference_image(const MediumScene& scene, Rows rows) {
    return onto_host(scene, rows, [&](View out) { return reference_image(scene, rows, out); });
}

RenderedImages render(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t samples,
                      Rows rows) {
    return pair_onto_host(scene.engine(), scene.values(rows),
                          [&](View m, View t) { return render(scene, sampler, stream, samples, rows, m, t); });
}

RenderedImages render_levels(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t levels,
                             Rows rows) {
    check_levels(levels);
    return pair_onto_host(scene.engine(), scene.values(rows) * levels,
                          [&](View m, View t) { return render_levels(scene, sampler, stream, levels, rows, m, t); });
}

RenderedPixel render_pixel(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t samples,
                           std::uint32_t x, std::uint32_t y) {
    using namespace device;
    const auto& s = scene.state();
    check_sampler(sampler);
    check_samples(samples);
    if (x >= s.frame.width || y >= s.frame.height)
        throw InvalidArgument("pixel", "a column and a row of the frame", std::to_string(x) + ", " + std::to_string(y));
    const auto sampling = static_cast<std::uint32_t>(sampler.sampling),
               generator = static_cast<std::uint32_t>(stream.generator);
    const std::uint32_t pixel = y * s.frame.width + x;
    const clr_sampler how = device_sampler(sampler, samples);
    const clr_stream own = scene_stream(stream);
    clr_stream other = own;
    other.id |= CLR_INDEPENDENT;
    const clr_medium_ray ray = clr_aim(s.device, s.occluders.data(), x, y);
    const clr_medium_plan plan = clr_make_plan(sampling, s.device, &ray);
    std::array<clr_u32, CLR_SHADOW_LIST> list{};
    clr_shadows shadows{};
    shadows.list = list.data();
    clr_find_shadows(s.device, s.occluders.data(), &ray, &shadows);
    clr_medium_sums sums = clr_no_samples(), others = clr_no_samples();
    for (std::uint32_t k = 0; k < clr_step_count(how, 0); ++k) {
        const auto run = [&](const clr_stream& from, const clr_medium_sums& so_far) {
            return clr_do_step(clr_step_of(how, 0, k), generator, sampling, s.device, s.occluders.data(), &ray, &plan,
                               &shadows, from, pixel, so_far);
        };
        sums = run(own, sums);
        if (sampler.independent) others = run(other, others);
    }
    RenderedPixel out;
    out.hit = ray.length > 0;
    for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t to = s.device.channel[c];
        out.m[to] = sums.m[c] * how.inverse_samples;
        out.t[to] = (sampler.independent ? others : sums).t[c] * how.inverse_samples;
        out.tau[to] = ray.tau[c];
        out.reference[to] = ray.tau[c] * s.shares[c * s.device.plane + pixel];
    }
    return out;
}

}  // namespace clratio
