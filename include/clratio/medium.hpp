// A scene whose answer is known: sunlight scattered once in a box of fog, with occluders. The exact images and second
// moments on the host in double, the estimators on the device in float.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "clratio/device/medium.h"
#include "clratio/engine.hpp"
#include "clratio/histogram.hpp"
#include "clratio/moments.hpp"
#include "clratio/stream.hpp"
#include "clratio/view.hpp"

namespace clratio {

using Vector3 = std::array<double, 3>;
using Rgb = std::array<double, 3>;

/// Occluders stop light and camera rays and displace no medium. Lengths are in the scene's unit, world y is up.
struct Sphere {
    Vector3 centre{};
    double radius = 0;
};
struct Box {
    Vector3 lo{}, hi{};
};

/// A homogeneous medium in a box, lit by one collimated beam.
struct Medium {
    Box box;
    Rgb sigma_t{}, sigma_s{};  ///< extinction and scattering, each 1 / length
    double g = 0;              ///< of Henyey-Greenstein; positive brightens views toward the light
    Rgb irradiance{};          ///< on a plane across the beam
    Vector3 light{0, 1, 0};    ///< from the scene toward the light, of any length
};

struct Camera {
    Vector3 eye{}, at{};
    double fov_y = 40;  ///< degrees, from the lower edge of the image to the upper
};

/// Ranges, checked by check_scene() and by all that take a scene: all finite, coordinates and radius below 1e9; lo < hi in
/// each axis; radius > 0; 1e-9 <= sigma_t <= 1e9; sigma_s and irradiance >= 0, one product of them > 0; |g| < 1; light not
/// 0; 0 < fov_y < 180; the view not along y; at most most_occluders of each kind.
struct Scene {
    Medium medium;
    Camera camera;
    std::vector<Sphere> spheres;
    std::vector<Box> boxes;
};
inline constexpr std::size_t most_occluders = 256;

/// Errors: InvalidArgument names the field, as in "scene: boxes[2].hi".
void check_scene(const Scene& scene);

/// The scene with each sigma_t replaced by their mean: estimates of wvds_* then follow a binomial law exactly.
Scene gray(Scene scene);

/// Pixels of an image; row 0 is the top. Ranges: 1 <= width, height <= 65536, below 2^31 pixels.
struct Frame {
    std::uint32_t width = 200, height = 150;
};

struct Ray {
    Vector3 origin, direction;  ///< the direction has any length but 0
};

/// Through the centre of pixel (x, y).
Ray camera_ray(const Camera& camera, Frame frame, std::uint32_t x, std::uint32_t y);

/// How the distance along a camera ray is drawn. sigma_bar is the mean of the three sigma_t; phi(s) is the length of the
/// light's way through the medium to s and on to the camera.
enum class Sampling : std::uint32_t {
    uni = CLR_UNI,              ///< uniform: ray marching, with the stratified or offset pattern
    ds = CLR_DS,                ///< exp(-sigma_bar s) on the ray: truncated distance sampling
    dsa = CLR_DSA,              ///< the same on all s > 0: samples behind the medium count as 0
    dsm = CLR_DSM,              ///< ds with one sigma_t of the three, each as often; balance heuristic
    wvds_mean = CLR_WVDS_MEAN,  ///< exp(-sigma_bar phi(s))
    wvds_min = CLR_WVDS_MIN,    ///< exp(-min sigma_t phi(s)): bounded weights
    wvds_mis = CLR_WVDS_MIS,    ///< exp(-sigma_t phi(s)), one sigma_t of the three, chosen by their tau; balance heuristic
};

/// Which u in (0, 1) the N samples of a pixel use: u_i, (i + u_i) / N, or (i + u_0) / N.
enum class Pattern : std::uint32_t { iid = CLR_IID, stratified = CLR_STRATIFIED, offset = CLR_OFFSET };

/// "uni", "wvds-mis", ..; "iid", "stratified", "offset". Errors: InvalidArgument for other names, with all that there are.
std::string_view name_of(Sampling sampling);
std::string_view name_of(Pattern pattern);
Sampling sampling_of(std::string_view name);
Pattern pattern_of(std::string_view name);
inline constexpr std::array all_samplings{Sampling::uni,       Sampling::ds,       Sampling::dsa,     Sampling::dsm,
                                          Sampling::wvds_mean, Sampling::wvds_min, Sampling::wvds_mis};

struct Stretch {
    double lo, hi;
};

/// E[m^2] = E[m t] (visibility is 0 or 1) and E[t^2] of one sample.
struct SecondMoments {
    Rgb mm, tt;
};

/// One ray's exact answers, in double. m is the light scattered to the camera by one sample, t the same without occluders;
/// mu = E[m], tau = E[t], in units of radiance. Distances are from the ray's origin along the normalised direction.
/// Error bound: 1e-12 relative to tau (tests/data/medium_vectors.json). Cost: microseconds; the integrals are sums over the
/// pieces of phi and the shadows' ends, none is sampled. Source: supplement IV of Velinov and Mitchell, TVCG 2021; the
/// formulas, docs/medium.md.
class Sightline {
public:
    /// Errors: check_scene's, and a direction of length 0.
    Sightline(const Scene& scene, const Ray& ray);

    bool hit() const;      ///< some of the ray lies in the medium; else tau = mu = 0 and nothing below means anything
    double enter() const;  ///< where the medium begins, or 0 inside it
    double leave() const;  ///< where it ends, or an occluder
    bool stopped() const;  ///< by an occluder
    Rgb tau() const, mu() const;
    std::vector<double> breaks() const;    ///< where phi bends
    std::vector<Stretch> lit() const;      ///< the parts that see the light
    double exit_distance(double s) const;  ///< from the point at s toward the light to the end of the medium

    SecondMoments second_moments(Sampling sampling) const;
    /// Where a sample with this u in [0, 1] lies; may lie behind leave() with dsa. Mixtures take channels by sigma_t, those
    /// without light last.
    double distance(Sampling sampling, double u) const;

    struct State;

private:
    std::shared_ptr<const State> state_;
};

/// Mean squared error and bias of the estimates of one value from n iid samples. plain: the mean of m, exact. ratio: tau
/// (sum m) / (sum t), and independent: with t of other samples, both to first order in 1/n (delta method).
struct Prediction {
    double plain_mse, ratio_mse, ratio_bias, independent_mse, independent_bias;
};
Prediction predict(double mu, double tau, double mm, double tt, std::uint64_t n);

/// Interleaved RGB of width x height pixels, in double; 0 where a ray misses.
struct ExactImage {
    Frame frame;
    std::vector<double> tau, mu;
    std::vector<bool> hit;  ///< for each pixel
};
ExactImage exact_image(const Scene& scene, Frame frame);

/// Rows first .. first + count - 1 of a frame; count 0: all the rest.
struct Rows {
    std::uint32_t first = 0, count = 0;
};

struct Sampler {
    Sampling sampling = Sampling::wvds_mis;
    Pattern pattern = Pattern::iid;
    bool independent = false;  ///< t from samples of its own, stream id + 2^31: a contrast, not an estimator to use
};

/// A scene as kernels take it, and the exact share of the light that arrives, mu / tau, for each value. Copies share it.
class MediumScene {
public:
    /// Errors: check_scene's, and a frame out of range. Cost: an exact_image, and 4 bytes for each value.
    MediumScene(const Engine& engine, const Scene& scene, Frame frame = {});

    const Engine& engine() const;
    const Scene& scene() const;
    Frame frame() const;
    std::uint64_t values(Rows rows = {}) const;  ///< 3 for each pixel

    struct State;
    const State& state() const { return *state_; }

private:
    std::shared_ptr<const State> state_;
};

/// The most levels: 1, 2, 4, .., 64 samples.
inline constexpr std::uint32_t most_levels = CLR_MOST_LEVELS;

/// Images of `rows`, interleaved RGB, values(rows) each; views may have strides. m and t are the means of `samples` samples
/// of each pixel: one batch of that weight. tau: exact, in float; m and t are unbiased for mu and tau. reference: mu, as tau
/// times the exact share, so that it equals tau to the bit where no shadow falls and 0 where no light does.
/// The levels form writes images of 1, 2, 4, .. 2^(levels - 1) samples one after the other into m and t: prefixes of one
/// stream with Pattern::iid, a pattern of their own each with the others.
/// stream: any seed and id < 2^31; its domain is `scene` whatever stream.domain says. Draws: docs/streams.md.
/// Where all rays miss, 0. Where nothing is in the way, m and t have the same bits. NaN and infinity do not occur.
/// Accuracy: tau within 4e-6 absolute for tau of order 1, 1e-7 relative typically; short chords lose digits.
/// So do views along the beam where |g| is near 1: up to 2^-23 / (1 - |g|)^2 relative. Where the scene lies does not matter.
/// Errors: InvalidArgument for rows, samples (1 to 2^24), levels (1 to most_levels), a stream or a view out of range.
/// Determinism: the same bits at every width, work size and split into rows, and on the host (render_pixel).
/// Event forms: enqueued after wait_list, nothing waits; the caller releases the event.
cl_event tau_image(const MediumScene& scene, Rows rows, View tau, std::span<const cl_event> wait_list = {});
cl_event reference_image(const MediumScene& scene, Rows rows, View mu, std::span<const cl_event> wait_list = {});
cl_event render(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t samples, Rows rows,
                View m, View t, std::span<const cl_event> wait_list = {});
cl_event render_levels(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t levels,
                       Rows rows, View m, View t, std::span<const cl_event> wait_list = {});
/// Adds one batch of weight `samples` to a state of values() values on the scene's Engine.
cl_event render(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t samples, Moments& sums,
                std::span<const cl_event> wait_list = {});

/// Blocking forms.
struct RenderedImages {
    std::vector<float> m, t;
};
std::vector<float> tau_image(const MediumScene& scene, Rows rows = {});
std::vector<float> reference_image(const MediumScene& scene, Rows rows = {});
RenderedImages render(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t samples,
                      Rows rows = {});
RenderedImages render_levels(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t levels,
                             Rows rows = {});

/// One pixel on the host: the bits the device gives.
struct RenderedPixel {
    bool hit = false;
    std::array<float, 3> m{}, t{}, tau{}, reference{};
};
RenderedPixel render_pixel(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t samples,
                           std::uint32_t x, std::uint32_t y);

/// Signed errors, estimate minus reference, of the values of all pixels whose rays hit the medium.
/// Errors with |e| <= 1e-6 are counted in `atom` alone: lit and dark pixels, which would flatten any picture.
struct MediumErrorCounts : Histogram {
    std::uint64_t atom = 0;
    std::uint64_t zero_denominators = 0;  ///< sum t = 0, where the ratio estimate is 0; such values are counted above too

    std::uint64_t total() const;
    MediumErrorCounts& operator+=(const MediumErrorCounts& other);
};

/// Sums over one row of one image, exact integers: sum in units of `unit`, squares in 2^12 unit^2, each value rounded to
/// these and limited to 2^29 units.
struct MediumErrorSums {
    std::int64_t sum = 0, squares = 0;
};

/// Errors of images of seeds seeds.first .. and of `rows`, for the levels 1, 2, 4, .. samples. Index:
/// ((seed * rows + row) * levels + level) * 6 + 3 * ratio + channel, counts without the first term; ratio = 0 for the mean
/// of m, 1 for the ratio estimate.
struct MediumErrors {
    std::uint32_t levels = 0;
    IndexRange seeds;
    Rows rows;
    Bins bins;
    double unit = 0;
    std::vector<MediumErrorCounts> counts;  ///< levels x 6
    std::vector<MediumErrorSums> sums;      ///< seeds x rows x levels x 6
    std::vector<std::uint32_t> pixels;      ///< for each row, how many rays hit the medium
};

struct MediumErrorOptions {
    std::uint32_t levels = most_levels;
    std::uint32_t stream_id = 0;
    Generator generator = Generator::philox;
    Progress progress = {};  ///< in rows of images; Cancelled is thrown where it returns false
};

/// Renders, compares and counts in one pass: no image is stored. unit is the power of two in (2^-23 b, 2^-22 b] for the
/// larger |end| b of the bins. Cost: 32 bytes for each sum of the result. Determinism: all integers, the same for any width,
/// work size and any split into seeds and rows. Errors: InvalidArgument for seeds, rows, bins (1 to 4096) or levels out of
/// range.
MediumErrors medium_errors(const MediumScene& scene, const Sampler& sampler, IndexRange seeds, Rows rows, Bins bins,
                           const MediumErrorOptions& options = {});

}  // namespace clratio
