#include "watch_folder.hpp"

#include <algorithm>
#include <charconv>

namespace tool::combining {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

Pattern::Pattern(const char* option, const std::string& text) {
    const auto star = text.find('*'), colon = text.find(':', star == std::string::npos ? 0 : star);
    const std::string name = text.substr(0, colon);
    if (std::count(name.begin(), name.end(), '*') != 1 || name.find('/') != std::string::npos)
        throw UsageError(std::string(option) + " " + text +
                         ": with --watch, a file name with one * that stands for the batch's number");
    before_ = name.substr(0, star);
    after_ = name.substr(star + 1);
    if (colon != std::string::npos) layer_ = text.substr(colon);
}

std::optional<std::uint64_t> Pattern::number(const std::string& file) const {
    if (file.size() <= before_.size() + after_.size() || !file.starts_with(before_) || !file.ends_with(after_))
        return std::nullopt;
    const char* const end = file.data() + file.size() - after_.size();
    std::uint64_t n = 0;
    const auto [stop, error] = std::from_chars(file.data() + before_.size(), end, n);
    return error == std::errc() && stop == end ? std::optional(n) : std::nullopt;
}

WatchFolder::WatchFolder(fs::path folder, Pattern m, Pattern t, double settle)
    : folder_(std::move(folder)), m_pattern_(std::move(m)), t_pattern_(std::move(t)), settle_(settle) {}

void WatchFolder::look(Files& files, const Pattern& pattern) {
    Files now;
    for (const auto& entry : fs::directory_iterator(folder_)) {
        const std::string name = entry.path().filename().string();
        const auto number = pattern.number(name);
        std::error_code size_gone, time_gone;  // a file may be renamed or removed at any moment
        const Stamp stamp{entry.file_size(size_gone), entry.last_write_time(time_gone)};
        if (!number || size_gone || time_gone) continue;
        const auto before = files.find(*number);
        const bool same = before != files.end() && before->second.name == name && before->second.stamp == stamp;
        const auto [place, is_new] = now.try_emplace(*number, same ? before->second : Seen{name, stamp, Clock::now()});
        if (!is_new) throw clratio::IoError((folder_ / name).string(), "", "has the number of " + place->second.name);
    }
    files = std::move(now);
}

std::vector<Job> WatchFolder::settled() {
    try {
        look(m_, m_pattern_);
        look(t_, t_pattern_);
    } catch (const fs::filesystem_error& e) {
        throw clratio::IoError(folder_.string(), "", "cannot be watched: " + e.code().message());
    }
    const auto still = [now = Clock::now(), this](const Seen& file) { return now - file.since >= settle_; };
    std::vector<Job> jobs;
    for (const auto& [number, m] : m_) {
        const auto t = t_.find(number);
        if (t == t_.end() || !still(m) || !still(t->second) || (m.put_off && t->second.put_off)) continue;
        jobs.push_back({number, (folder_ / m.name).string() + m_pattern_.layer(),
                        (folder_ / t->second.name).string() + t_pattern_.layer()});
    }
    return jobs;
}

void WatchFolder::put_off(const Job& job) {
    m_.at(job.index).put_off = true;
    t_.at(job.index).put_off = true;
}

}  // namespace tool::combining
