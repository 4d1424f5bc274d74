#include <filesystem>
#include <fstream>
#include <iterator>

#include "checksum.hpp"
#include "output_file.hpp"
#include "study.hpp"

namespace tool::study {
namespace {

constexpr auto head = "clratio study part 2, checksum ";

std::string line_of(const std::string& body) {
    clratio::Checksum sum;
    sum.add(std::span<const char>(body));
    return fmt::format("{}{:016x}, {} bytes\n", head, sum.sum(), body.size());
}

Json counts_of(const clratio::MediumErrorCounts& c) {
    return {{"bins", c.bins},           {"underflow", c.underflow}, {"overflow", c.overflow},
            {"nonfinite", c.nonfinite}, {"atom", c.atom},           {"zero_denominators", c.zero_denominators}};
}

clratio::MediumErrorCounts counts_of(const Json& j, double range) {
    clratio::MediumErrorCounts c;
    c.bins = j.at("bins").get<std::vector<std::uint64_t>>();
    c.underflow = j.at("underflow");
    c.overflow = j.at("overflow");
    c.nonfinite = j.at("nonfinite");
    c.atom = j.at("atom");
    c.zero_denominators = j.at("zero_denominators");
    c.lo = -range;
    c.hi = range;
    return c;
}

std::string bytes_of(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

}  // namespace

PartFolder::PartFolder(const std::string& folder, const Plan& plan) : folder_(folder), plan_(plan) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw clratio::IoError(folder, "", "cannot be made a folder: " + error.message());
}

std::string PartFolder::name_of(const Piece& p) const {
    const auto& sampler = p.series.sampler;
    return fmt::format("{}_{}_{}_{}x{}_seeds{}-{}.sums", plan_.scenes[p.series.scene].name,
                       clratio::name_of(sampler.sampling),
                       sampler.independent ? "independent" : std::string(clratio::name_of(sampler.pattern)),
                       plan_.frame.width, plan_.frame.height, p.seeds.first, p.seeds.first + p.seeds.count - 1);
}

std::string PartFolder::path_of(const Piece& piece) const {
    return (std::filesystem::path(folder_) / name_of(piece)).string();
}

Json PartFolder::settings_of(const Piece& p) const {
    const auto& sampler = p.series.sampler;
    return {{"scene", Json::parse(json_of(plan_.scenes[p.series.scene]))},
            {"sampling", clratio::name_of(sampler.sampling)},
            {"pattern", clratio::name_of(sampler.pattern)},
            {"independent", sampler.independent},
            {"width", plan_.frame.width},
            {"height", plan_.frame.height},
            {"seeds", {p.seeds.first, p.seeds.count}},
            {"rng", "philox"},
            {"levels", levels},
            {"bins", bins}};
}

bool PartFolder::read(const Piece& piece, Part& part) const {
    const std::string all = bytes_of(path_of(piece));
    const auto end = all.find('\n');
    if (end == std::string::npos) return false;
    const std::string body = all.substr(end + 1);
    if (all.substr(0, end + 1) != line_of(body)) return false;
    const Json json = Json::parse(body);
    if (json.at("settings") != settings_of(piece)) return false;
    part = {piece.seeds.count, json.at("pixels"), json.at("unit"), {}, {}, json.at("spread_seeds"), {}};
    for (const auto& counts : json.at("counts"))
        part.counts.push_back(counts_of(counts, plan_.scenes[piece.series.scene].range));
    for (const auto& sums : json.at("sums")) part.sums.push_back({sums.at(0), sums.at(1)});
    for (const auto& x : json.at("spreads")) part.spreads.push_back({x.at(0), x.at(1), x.at(2)});
    return true;
}

void PartFolder::write(const Piece& piece, const Part& part) const {
    Json json{{"settings", settings_of(piece)}, {"pixels", part.pixels}, {"unit", part.unit},
              {"counts", Json::array()},        {"sums", Json::array()}, {"spread_seeds", part.spread_seeds},
              {"spreads", Json::array()}};
    for (const auto& counts : part.counts) json["counts"].push_back(counts_of(counts));
    for (const auto& sums : part.sums) json["sums"].push_back({sums.sum, sums.squares});
    for (const auto& x : part.spreads) json["spreads"].push_back({x.sum, x.squares, x.squared_sums});
    const std::string body = json.dump() + "\n";
    OutputFile out(path_of(piece));
    out.write(line_of(body));
    out.write(body);
    out.commit();
}

}  // namespace tool::study
