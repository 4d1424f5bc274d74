// The exact answers of a camera ray, in double: sums of closed integrals over the pieces between the bends of phi and the
// ends of shadows. Independent of device/medium.h, whose oracle it is. Formulas: docs/medium.md.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "scene.hpp"
#include "vector3.hpp"

namespace clratio {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

Vector3 along(const Vector3& o, double s, const Vector3& w) { return {o[0] + s * w[0], o[1] + s * w[1], o[2] + s * w[2]}; }

// (1 - e^-z) / z for z >= 0.
double decay_mean(double z) { return z < 1e-3 ? 1 - z * (0.5 - z * (1.0 / 6 - z / 24)) : -std::expm1(-z) / z; }

// x in [0, 1] with density proportional to e^(-z x).
double inverse_decay(double u, double z) {
    if (z < 0) return 1 - inverse_decay(1 - u, -z);
    if (z < 1e-5) return std::clamp(u - z * u * (1 - u) * (0.5 - z * (1 - 2 * u) / 6), 0.0, 1.0);
    return std::clamp(-std::log1p(u * std::expm1(-z)) / z, 0.0, 1.0);
}

struct Chord {
    double lo = -infinity, hi = infinity;
    bool empty() const { return lo >= hi; }
    // Keeps the s with a + b s <= 0.
    void clip(double a, double b) {
        if (b > 0) hi = std::min(hi, -a / b);
        if (b < 0) lo = std::max(lo, -a / b);
        if (b == 0 && a > 0) hi = -infinity;
    }
};

Chord in_box(const Ray& ray, const Box& box) {
    Chord c;
    for (std::size_t k = 0; k < 3; ++k) {
        c.clip(box.lo[k] - ray.origin[k], -ray.direction[k]);
        c.clip(ray.origin[k] - box.hi[k], ray.direction[k]);
    }
    return c;
}

// The discriminant is R^2 - |q - (q w) w|^2: the other form cancels.
Chord in_ball(const Ray& ray, const Sphere& sphere) {
    const Vector3 q = difference(ray.origin, sphere.centre);
    const double b = dot(q, ray.direction);
    const Vector3 off = along(q, -b, ray.direction);
    const double d = sphere.radius * sphere.radius - dot(off, off);
    if (d <= 0) return {infinity, -infinity};
    return {-b - std::sqrt(d), -b + std::sqrt(d)};
}

// The shadow of a convex body is convex: one interval on each line. A sphere's is half a cylinder and the ball.
Chord shadow_of(const Ray& ray, const Vector3& omega, const Sphere& sphere) {
    const Vector3 q = difference(ray.origin, sphere.centre);
    const double h = dot(q, omega), rate = dot(ray.direction, omega);
    const Vector3 off = along(q, -h, omega), turn = along(ray.direction, -rate, omega);
    const double a = dot(turn, turn), b = dot(off, turn), e = dot(off, off) - sphere.radius * sphere.radius;
    Chord cylinder;
    if (a < 1e-24) {
        if (e > 0) cylinder.hi = -infinity;
    } else {
        const double d = b * b - a * e;
        if (d <= 0) cylinder.hi = -infinity;
        if (d > 0) cylinder = {(-b - std::sqrt(d)) / a, (-b + std::sqrt(d)) / a};
    }
    cylinder.clip(h, rate);
    const Chord ball = in_ball(ray, sphere);
    if (cylinder.empty()) return ball;
    if (ball.empty()) return cylinder;
    return {std::min(cylinder.lo, ball.lo), std::max(cylinder.hi, ball.hi)};
}

Chord shadow_of(const Ray& ray, const Vector3& omega, const Box& box) {
    Chord c;
    struct Line {
        double at, rate;
    };
    std::vector<Line> near, far;
    for (std::size_t k = 0; k < 3; ++k) {
        const double p = ray.origin[k], w = ray.direction[k];
        if (omega[k] == 0) {
            c.clip(box.lo[k] - p, -w);
            c.clip(p - box.hi[k], w);
            continue;
        }
        const bool up = omega[k] > 0;
        near.push_back({((up ? box.lo[k] : box.hi[k]) - p) / omega[k], -w / omega[k]});
        far.push_back({((up ? box.hi[k] : box.lo[k]) - p) / omega[k], -w / omega[k]});
    }
    for (std::size_t i = 0; i < far.size(); ++i) {
        c.clip(-far[i].at, -far[i].rate);
        for (std::size_t j = 0; j < near.size(); ++j)
            if (i != j) c.clip(near[j].at - far[i].at, near[j].rate - far[i].rate);
    }
    return c;
}

}  // namespace

double phase_of(double g, double cosine) {
    return (1 - g * g) / (4 * std::numbers::pi * std::pow(1 + g * g - 2 * g * cosine, 1.5));
}

struct Sightline::State {
    bool hit = false, stopped = false;
    double enter = 0, length = 0;
    std::vector<Chord> exits;  // exit distance lo + hi x in local x
    std::vector<Chord> shadows;
    std::vector<double> knots, cuts;               // local x: bends of phi; these and the ends of shadows
    std::vector<bool> lit;                         // between cuts
    Rgb sigma{}, strength{}, area{}, tau{}, mu{};  // strength: what one lit unit of length sends to the camera
    double mean = 0, least = 0;
    std::array<std::size_t, 3> order{};  // of channels in mixtures

    double exit_distance(double x) const {
        double d = infinity;
        for (const Chord& e : exits) d = std::min(d, e.lo + e.hi * x);
        return std::max(0.0, d);
    }
    double phi(double x) const { return x + exit_distance(x); }

    // The integral of exp(-a phi - b x) between neighbours of `ends`, of those that `keep`s.
    template <class Keep> double integral(const std::vector<double>& ends, double a, double b, Keep keep) const {
        double sum = 0;
        for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
            if (!keep(i)) continue;
            const double g0 = a * phi(ends[i]) + b * ends[i], g1 = a * phi(ends[i + 1]) + b * ends[i + 1];
            sum += (ends[i + 1] - ends[i]) * std::exp(-std::min(g0, g1)) * decay_mean(std::abs(g1 - g0));
        }
        return sum;
    }
    double open(double a, double b) const {
        return integral(knots, a, b, [](std::size_t) { return true; });
    }
    double shaded(double a, double b) const {
        return integral(cuts, a, b, [this](std::size_t i) { return static_cast<bool>(lit[i]); });
    }

    void find_pieces();
    void find_shadows(const Ray& local, const Scene& scene, const Vector3& omega);
    double depth_inverse(double sigma, double u) const;
    Rgb shares(Sampling sampling) const;
    double mixture_density(Sampling sampling, double x) const;
    double mixture_moment(Sampling sampling, std::size_t channel, bool only_lit) const;
};

void Sightline::State::find_pieces() {
    knots = {0, length};
    for (std::size_t i = 0; i < exits.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            if (const double turn = exits[i].hi - exits[j].hi; turn != 0)
                knots.push_back(std::clamp((exits[j].lo - exits[i].lo) / turn, 0.0, length));
    std::sort(knots.begin(), knots.end());
}

void Sightline::State::find_shadows(const Ray& local, const Scene& scene, const Vector3& omega) {
    const auto add = [&](Chord c) {
        c = {std::clamp(c.lo, 0.0, length), std::clamp(c.hi, 0.0, length)};
        if (!c.empty()) shadows.push_back(c);
    };
    for (const auto& s : scene.spheres) add(shadow_of(local, omega, s));
    for (const auto& b : scene.boxes) add(shadow_of(local, omega, b));
    cuts = knots;
    for (const Chord& c : shadows) cuts.insert(cuts.end(), {c.lo, c.hi});
    std::sort(cuts.begin(), cuts.end());
    for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
        const double middle = (cuts[i] + cuts[i + 1]) / 2;
        lit.push_back(
            std::none_of(shadows.begin(), shadows.end(), [&](const Chord& c) { return middle > c.lo && middle < c.hi; }));
    }
}

Sightline::Sightline(const Scene& scene, const Ray& ray) {
    check_scene(scene);
    if (!(dot(ray.direction, ray.direction) > 0)) throw InvalidArgument("ray", "a direction of some length", "0 or NaN");
    auto s = std::make_shared<State>();
    state_ = s;
    const Medium& medium = scene.medium;
    const Ray camera{ray.origin, unit(ray.direction)};
    const Chord box = in_box(camera, medium.box);
    s->enter = std::max(0.0, box.lo);
    double leave = box.hi;
    const auto stop = [&](const Chord& c) {
        if (c.hi < c.lo || c.lo <= 0 || c.lo >= leave) return;
        leave = c.lo;
        s->stopped = true;
    };
    for (const auto& o : scene.spheres) stop(in_ball(camera, o));
    for (const auto& o : scene.boxes) stop(in_box(camera, o));
    s->hit = leave > s->enter;
    if (!s->hit) return;
    s->length = leave - s->enter;

    Ray local{along(camera.origin, s->enter, camera.direction), camera.direction};
    const Vector3 omega = unit(medium.light);
    for (std::size_t k = 0; k < 3; ++k) {
        local.origin[k] = std::clamp(local.origin[k], medium.box.lo[k], medium.box.hi[k]);
        const double face = omega[k] > 0 ? medium.box.hi[k] : medium.box.lo[k];
        if (omega[k] != 0) s->exits.push_back({(face - local.origin[k]) / omega[k], -local.direction[k] / omega[k]});
    }
    s->find_pieces();
    s->find_shadows(local, scene, omega);
    s->sigma = medium.sigma_t;
    s->order = channel_order(medium);
    s->mean = std::accumulate(s->sigma.begin(), s->sigma.end(), 0.0) / 3;
    s->least = *std::min_element(s->sigma.begin(), s->sigma.end());
    for (std::size_t c = 0; c < 3; ++c) {
        s->strength[c] = medium.sigma_s[c] * medium.irradiance[c] * phase_of(medium.g, dot(local.direction, omega));
        s->area[c] = s->open(s->sigma[c], 0);
        s->tau[c] = s->strength[c] * s->area[c];
        s->mu[c] = s->shadows.empty() ? s->tau[c] : s->strength[c] * s->shaded(s->sigma[c], 0);
    }
}

bool Sightline::hit() const { return state_->hit; }
double Sightline::enter() const { return state_->enter; }
double Sightline::leave() const { return state_->enter + state_->length; }
bool Sightline::stopped() const { return state_->stopped; }
Rgb Sightline::tau() const { return state_->tau; }
Rgb Sightline::mu() const { return state_->mu; }
double Sightline::exit_distance(double s) const { return state_->exit_distance(s - state_->enter); }

std::vector<double> Sightline::breaks() const {
    std::vector<double> out;
    for (const double x : state_->knots)
        if (x > 0 && x < state_->length) out.push_back(state_->enter + x);
    return out;
}

std::vector<Stretch> Sightline::lit() const {
    const State& s = *state_;
    std::vector<Stretch> out;
    for (std::size_t i = 0; i + 1 < s.cuts.size(); ++i) {
        if (!s.lit[i] || s.cuts[i] == s.cuts[i + 1]) continue;
        const Stretch part{s.enter + s.cuts[i], s.enter + s.cuts[i + 1]};
        if (!out.empty() && out.back().hi == part.lo)
            out.back().hi = part.hi;
        else
            out.push_back(part);
    }
    return out;
}

// The x where the integral of exp(-sigma phi) has reached the share u of its whole.
double Sightline::State::depth_inverse(double s, double u) const {
    double left = u * open(s, 0);
    for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
        const std::vector<double> piece{knots[i], knots[i + 1]};
        const double part = integral(piece, s, 0, [](std::size_t) { return true; });
        if (left < part) {
            const double z = s * (phi(piece[1]) - phi(piece[0]));
            return piece[0] + (piece[1] - piece[0]) * inverse_decay(std::clamp(left / part, 0.0, 1.0), z);
        }
        left -= part;
    }
    return length;
}

// How often a mixture takes each channel.
Rgb Sightline::State::shares(Sampling sampling) const {
    if (sampling == Sampling::dsm) return {1.0 / 3, 1.0 / 3, 1.0 / 3};
    const double sum = tau[0] + tau[1] + tau[2];
    return {tau[0] / sum, tau[1] / sum, tau[2] / sum};
}

double Sightline::State::mixture_density(Sampling sampling, double x) const {
    const Rgb q = shares(sampling);
    double p = 0;
    for (std::size_t j = 0; j < 3; ++j)
        p += sampling == Sampling::dsm ? q[j] * std::exp(-sigma[j] * x) / (length * decay_mean(sigma[j] * length))
                                       : q[j] * std::exp(-sigma[j] * phi(x)) / area[j];
    return p;
}

// The integral of f^2 / p: no closed form, 12-point Gauss-Legendre on each piece.
double Sightline::State::mixture_moment(Sampling sampling, std::size_t c, bool only_lit) const {
    constexpr std::array<double, 6> node{0.1252334085114689, 0.3678314989981802, 0.5873179542866175,
                                         0.7699026741943047, 0.9041172563704749, 0.9815606342467192};
    constexpr std::array<double, 6> weight{0.2491470458134028, 0.2334925365383548, 0.2031674267230659,
                                           0.1600783285433462, 0.1069393259953184, 0.04717533638651183};
    const auto value = [&](double x) { return std::exp(-2 * sigma[c] * phi(x)) / mixture_density(sampling, x); };
    double sum = 0;
    for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
        if (only_lit && !lit[i]) continue;
        const double middle = (cuts[i] + cuts[i + 1]) / 2, half = (cuts[i + 1] - cuts[i]) / 2;
        for (std::size_t k = 0; k < node.size(); ++k)
            sum += half * weight[k] * (value(middle - half * node[k]) + value(middle + half * node[k]));
    }
    return sum;
}

SecondMoments Sightline::second_moments(Sampling sampling) const {
    const State& s = *state_;
    SecondMoments out{};
    if (!s.hit) return out;
    const auto moment = [&](std::size_t c, bool only_lit) {
        const auto j = [&](double a, double b) { return only_lit ? s.shaded(a, b) : s.open(a, b); };
        const double twice = 2 * s.sigma[c];
        switch (sampling) {
        case Sampling::uni:
            return s.length * j(twice, 0);
        case Sampling::ds:
            return s.length * decay_mean(s.mean * s.length) * j(twice, -s.mean);
        case Sampling::dsa:
            return j(twice, -s.mean) / s.mean;
        case Sampling::wvds_mean:
            return s.open(s.mean, 0) * j(twice - s.mean, 0);
        case Sampling::wvds_min:
            return s.open(s.least, 0) * j(twice - s.least, 0);
        case Sampling::dsm:
        case Sampling::wvds_mis:
            break;
        }
        return s.mixture_moment(sampling, c, only_lit);
    };
    for (std::size_t c = 0; c < 3; ++c) {
        out.mm[c] = s.strength[c] * s.strength[c] * moment(c, true);
        out.tt[c] = s.strength[c] * s.strength[c] * moment(c, false);
    }
    return out;
}

double Sightline::distance(Sampling sampling, double u) const {
    const State& s = *state_;
    const auto truncated = [&](double sigma, double v) { return s.length * inverse_decay(v, sigma * s.length); };
    switch (sampling) {
    case Sampling::uni:
        return s.enter + u * s.length;
    case Sampling::ds:
        return s.enter + truncated(s.mean, u);
    case Sampling::dsa:
        return s.enter - std::log1p(-u) / s.mean;
    case Sampling::wvds_mean:
        return s.enter + s.depth_inverse(s.mean, u);
    case Sampling::wvds_min:
        return s.enter + s.depth_inverse(s.least, u);
    case Sampling::dsm:
    case Sampling::wvds_mis:
        break;
    }
    const Rgb q = s.shares(sampling);
    double within = u;
    for (const std::size_t c : s.order) {
        if (within < q[c] || c == s.order.back()) {
            const double v = std::clamp(within / q[c], 0.0, 1.0);
            return s.enter + (sampling == Sampling::dsm ? truncated(s.sigma[c], v) : s.depth_inverse(s.sigma[c], v));
        }
        within -= q[c];
    }
    return leave();
}

Prediction predict(double mu, double tau, double mm, double tt, std::uint64_t n) {
    const auto count = static_cast<double>(n);
    const double v = tau > 0 ? mu / tau : 0;
    const double plain = std::max(0.0, mm - mu * mu), denominator = std::max(0.0, tt - tau * tau);
    const double bias = tau > 0 ? (v * tt - mm) / (count * tau) : 0;
    return {plain / count, std::max(0.0, (1 - 2 * v) * mm + v * v * tt) / count, bias, (plain + v * v * denominator) / count,
            tau > 0 ? v * denominator / (count * tau) : 0};
}

}  // namespace clratio
