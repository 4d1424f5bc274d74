#include "pocl.hpp"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <utility>

namespace clratio {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t least_space = 1 << 20;  // a program of ours takes some hundred kilobytes

fs::path cache_folder() {
    for (const auto& [variable, below] :
         {std::pair{"POCL_CACHE_DIR", ""}, {"XDG_CACHE_HOME", "/pocl"}, {"HOME", "/.cache/pocl"}})
        if (const char* value = std::getenv(variable); value && *value) return std::string(value) + below;
    return {};
}

}  // namespace

bool is_pocl(const DeviceInfo& device) { return device.platform == "Portable Computing Language"; }

std::string trouble_with_pocl_cache() {
    const fs::path folder = cache_folder();
    if (folder.empty()) return "";
    fs::path there = folder;
    std::error_code error;
    while (there.has_relative_path() && !fs::exists(there, error)) there = there.parent_path();
    const std::string remedy = "; POCL_CACHE_DIR names another folder";
    if (!fs::is_directory(there, error) || access(there.c_str(), W_OK) != 0)
        return "it cannot keep its kernels in " + folder.string() + remedy;
    const fs::space_info space = fs::space(there, error);
    if (!error && space.available < least_space)
        return "it keeps its kernels in " + folder.string() + ", where " + std::to_string(space.available) +
               " bytes are free" + remedy;
    return "";
}

}  // namespace clratio
