#include "cache.hpp"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>

namespace clratio::cache {
namespace {

constexpr char magic[] = "clratio program 1\n";

void append(std::vector<unsigned char>& to, const void* bytes, std::size_t size) {
    const auto* p = static_cast<const unsigned char*>(bytes);
    to.insert(to.end(), p, p + size);
}

}  // namespace

std::uint64_t fnv1a(const void* bytes, std::size_t size, std::uint64_t hash) {
    const auto* p = static_cast<const unsigned char*>(bytes);
    for (std::size_t i = 0; i < size; ++i) hash = (hash ^ p[i]) * 1099511628211u;
    return hash;
}

std::filesystem::path folder() {
    if (const char* xdg = std::getenv("XDG_CACHE_HOME"); xdg && *xdg) return std::filesystem::path(xdg) / "clratio";
    if (const char* home = std::getenv("HOME"); home && *home) return std::filesystem::path(home) / ".cache/clratio";
    return {};
}

std::filesystem::path entry(const std::filesystem::path& folder, const std::string& key) {
    char name[32];
    std::snprintf(name, sizeof name, "%016llx.bin", static_cast<unsigned long long>(fnv1a(key.data(), key.size())));
    return folder / name;
}

// magic | key, 0 | payload | fnv1a of all before
std::optional<std::vector<unsigned char>> load(const std::filesystem::path& path, const std::string& key) {
    std::ifstream in(path, std::ios::binary | std::ios::ate);
    if (!in) return std::nullopt;
    std::vector<unsigned char> all(static_cast<std::size_t>(std::max<std::streamoff>(in.tellg(), 0)));
    if (!in.seekg(0).read(reinterpret_cast<char*>(all.data()), static_cast<std::streamsize>(all.size())))
        return std::nullopt;
    std::vector<unsigned char> head;
    append(head, magic, sizeof magic - 1);
    append(head, key.c_str(), key.size() + 1);
    std::uint64_t sum = 0;
    if (all.size() < head.size() + sizeof sum) return std::nullopt;
    const std::size_t body = all.size() - sizeof sum;
    std::memcpy(&sum, all.data() + body, sizeof sum);
    if (sum != fnv1a(all.data(), body) || std::memcmp(all.data(), head.data(), head.size()) != 0) return std::nullopt;
    return std::vector<unsigned char>(all.begin() + static_cast<std::ptrdiff_t>(head.size()),
                                      all.begin() + static_cast<std::ptrdiff_t>(body));
}

bool prepare(const std::filesystem::path& folder) {
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    return !failed && access(folder.c_str(), W_OK) == 0;
}

bool store(const std::filesystem::path& path, const std::string& key, const std::vector<unsigned char>& payload) {
    std::vector<unsigned char> all;
    append(all, magic, sizeof magic - 1);
    append(all, key.c_str(), key.size() + 1);
    append(all, payload.data(), payload.size());
    const std::uint64_t sum = fnv1a(all.data(), all.size());
    append(all, &sum, sizeof sum);

    static std::atomic<unsigned> stored{0};
    auto temporary = path;
    temporary += "." + std::to_string(getpid()) + "." + std::to_string(stored++);
    std::ofstream out(temporary, std::ios::binary);
    out.write(reinterpret_cast<const char*>(all.data()), static_cast<std::streamsize>(all.size()));
    out.close();
    std::error_code failed;
    if (out) std::filesystem::rename(temporary, path, failed);
    if (!out || failed) {
        std::filesystem::remove(temporary, failed);
        return false;
    }
    return true;
}

}  // namespace clratio::cache
