// How long each part took: beside the parts, so that neither they nor the CSV files depend on it.
#include <algorithm>
#include <filesystem>
#include <fstream>

#include "study.hpp"

namespace tool::study {

PartTime& PartTime::operator+=(const PartTime& other) {
    samples += other.samples;
    seconds += other.seconds;
    spread_seconds += other.spread_seconds;
    return *this;
}

TimeLog::TimeLog(const std::string& folder, const clratio::Engine& engine)
    : path_((std::filesystem::path(folder) / "times.jsonl").string()), device_(engine.info().name), lanes_(engine.width()) {
    std::ifstream in(path_);
    for (std::string line; std::getline(in, line);) {
        const Json json = Json::parse(line, nullptr, false);
        if (json.is_discarded()) continue;
        try {
            if (json.at("device") != device_ || json.at("lanes") != lanes_) continue;
            times_[json.at("part")] = {json.at("samples"), json.at("seconds"), json.at("spread_seconds")};
        } catch (const Json::exception&) {
        }
    }
}

void TimeLog::add(const std::string& part, const PartTime& time) {
    times_[part] = time;
    const Json line{{"part", part},
                    {"device", device_},
                    {"lanes", lanes_},
                    {"samples", time.samples},
                    {"seconds", time.seconds},
                    {"spread_seconds", time.spread_seconds}};
    std::ofstream out(path_, std::ios::app);
    out << line.dump() + "\n" << std::flush;
    if (!out) throw clratio::IoError(path_, "", "cannot be written");
}

std::optional<PartTime> TimeLog::find(const std::string& part) const {
    const auto at = times_.find(part);
    if (at == times_.end() || !(at->second.seconds > 0)) return std::nullopt;
    return at->second;
}

}  // namespace tool::study
