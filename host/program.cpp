#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <thread>

#include "cache.hpp"
#include "embedded.hpp"
#include "engine_state.hpp"
#include "launch.hpp"
#include "pocl.hpp"

namespace clratio {
namespace {

const EmbeddedFile* find_file(std::string_view path) {
    const auto f =
        std::find_if(embedded_files.begin(), embedded_files.end(), [&](const EmbeddedFile& e) { return e.path == path; });
    return f == embedded_files.end() ? nullptr : &*f;
}

void flatten(const EmbeddedFile& file, std::set<std::string_view>& done, std::string& out) {
    if (!done.insert(file.path).second) return;
    constexpr std::string_view include = "#include \"";
    const auto locate = [&](std::size_t line) {
        out += "#line " + std::to_string(line) + " \"" + std::string(file.path) + "\"\n";
    };
    locate(1);
    std::size_t line = 0;
    for (std::string_view rest = file.text; !rest.empty();) {
        const std::size_t end = std::min(rest.find('\n'), rest.size() - 1) + 1;
        const std::string_view text = rest.substr(0, end);
        rest.remove_prefix(end);
        ++line;
        const std::string_view name =
            text.starts_with(include) ? text.substr(include.size(), text.find('"', include.size()) - include.size()) : "";
        const EmbeddedFile* included = name.empty() ? nullptr : find_file(name);
        if (!included) {
            out += text;
            continue;
        }
        flatten(*included, done, out);
        locate(line + 1);
    }
}

std::string build_options(const Engine::State& s, int width, const std::string& extra) {
    std::string o = "-cl-std=CL1.2 -DCLR_WIDTH=" + std::to_string(width) + " -DCLR_GROUPED=" + (s.grouped ? "1" : "0") +
                    " -DCLR_FP64=" + (s.info.fp64 && width <= 16 ? "1" : "0");
    if (s.info.correctly_rounded_divide) o += " -cl-fp32-correctly-rounded-divide-sqrt";
    return extra.empty() ? o : o + " " + extra;
}

std::string cache_key(const Engine::State& s, const std::string& word, const std::string& options,
                      const std::string& source) {
    const auto& d = s.info;
    return d.platform + "|" + d.name + "|" + d.version + "|" + d.driver + "|" + word + "|" + options + "|" +
           std::to_string(cache::fnv1a(source.data(), source.size()));
}

std::string name_of(const std::string& word, int width, const std::string& extra) {
    return word + " " + std::to_string(width) + " " + extra;
}

bool build(cl_program p, cl_device_id device, const std::string& options) {
    return clBuildProgram(p, 1, &device, options.c_str(), nullptr, nullptr) == CL_SUCCESS;
}

Program from_binary(const Engine::State& s, const std::vector<unsigned char>& binary, const std::string& options) {
    const unsigned char* bytes = binary.data();
    const std::size_t size = binary.size();
    cl_int status = CL_SUCCESS, code = CL_SUCCESS;
    Program p(clCreateProgramWithBinary(s.context.get(), 1, &s.device, &size, &bytes, &status, &code));
    return code == CL_SUCCESS && build(p.get(), s.device, options) ? p : Program();
}

std::string build_log(cl_program p, cl_device_id device) {
    std::size_t size = 0;
    clGetProgramBuildInfo(p, device, CL_PROGRAM_BUILD_LOG, 0, nullptr, &size);
    std::string log(size, '\0');
    clGetProgramBuildInfo(p, device, CL_PROGRAM_BUILD_LOG, size, log.data(), nullptr);
    log.resize(std::min(log.find('\0'), log.size()));
    return log;
}

std::string why_not_built(cl_program p, const Engine::State& s) {
    const std::string log = build_log(p, s.device);
    const std::string trouble = is_pocl(s.info) ? trouble_with_pocl_cache() : "";
    return trouble.empty() ? log : log + "\nThis is PoCL, and " + trouble;
}

Program from_source(const Engine::State& s, const std::string& word, const std::string& source, const std::string& options) {
    const char* text = source.c_str();
    const std::size_t size = source.size();
    cl_int code = CL_SUCCESS;
    Program p(clCreateProgramWithSource(s.context.get(), 1, &text, &size, &code));
    check(code, "clCreateProgramWithSource");
    if (!build(p.get(), s.device, options)) throw BuildError(word, why_not_built(p.get(), s));
    return p;
}

std::vector<unsigned char> binary_of(cl_program p) {
    std::size_t size = 0;
    if (clGetProgramInfo(p, CL_PROGRAM_BINARY_SIZES, sizeof size, &size, nullptr) != CL_SUCCESS) return {};
    std::vector<unsigned char> binary(size);
    unsigned char* to = binary.data();
    if (clGetProgramInfo(p, CL_PROGRAM_BINARIES, sizeof to, &to, nullptr) != CL_SUCCESS) return {};
    return binary;
}

}  // namespace

std::string flatten_kernel(std::string_view word) {
    const std::string path = "kernels/" + std::string(word) + ".cl";
    const EmbeddedFile* file = find_file(path);
    if (!file) throw InvalidArgument("kernel word", "a file of kernels/", path);
    std::set<std::string_view> done;
    std::string out;
    flatten(*file, done, out);
    return out;
}

std::string device_source() {
    std::set<std::string_view> done;
    std::string out;
    for (const auto& file : embedded_files)
        if (file.path.ends_with(".h")) flatten(file, done, out);
    return out;
}

Program program(Engine::State& s, const std::string& word, int width, const std::string& extra) {
    const std::scoped_lock lock(s.mutex);
    const std::string name = name_of(word, width, extra);
    if (const auto known = s.programs.find(name); known != s.programs.end()) return known->second.program;

    const std::string source = flatten_kernel(word);
    const std::string options = build_options(s, width, extra);
    const auto folder = s.options.disk_cache ? cache::folder() : std::filesystem::path();
    const std::string key = folder.empty() ? "" : cache_key(s, word, options, source);
    if (!folder.empty())
        if (const auto binary = cache::load(cache::entry(folder, key), key))
            if (Program p = from_binary(s, *binary, options)) return s.programs[name] = {p, ""}, p;
    Program p = from_source(s, word, source, options);
    s.programs[name] = {p, key};
    return p;
}

namespace {

// PoCL compiles every kernel of a program again to give its binary, seconds in which no kernel starts: what is not begun in
// time is left to the next process.
void save_binaries(Engine::State& s) {
    const std::unique_lock lock(s.mutex, std::try_to_lock);
    if (!lock) return;  // another thread still builds
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds{1};
    const auto folder = cache::folder();
    for (const auto& [name, built] : s.programs) {
        if (built.unsaved.empty()) continue;
        if (std::chrono::steady_clock::now() > end || !cache::prepare(folder)) return;
        if (const auto binary = binary_of(built.program.get()); !binary.empty())
            cache::store(cache::entry(folder, built.unsaved), built.unsaved, binary);
    }
}

void save_quietly(Engine::State& s) {
    try {
        save_binaries(s);
    } catch (...) {
        // A cache may fail in silence.
    }
}

enum class Exit { unknown, to_come, begun } program_exit = Exit::unknown;  // of the main thread

bool on_main_thread() { return gettid() == getpid(); }

/// The main thread's: it goes when the program exits, before anything static, the driver's parts among them.
struct Keeper {
    std::vector<std::weak_ptr<Engine::State>> engines;

    ~Keeper() {
        program_exit = Exit::begun;
        for (const auto& engine : engines)
            if (const auto s = engine.lock()) save_quietly(*s);
    }
};

}  // namespace

void save_at_exit(const std::shared_ptr<Engine::State>& s) {
    if (!on_main_thread()) return;
    static thread_local Keeper keeper;
    program_exit = Exit::to_come;
    std::erase_if(keeper.engines, [](const auto& engine) { return engine.expired(); });
    keeper.engines.push_back(s);
}

Engine::State::~State() {
    if (std::this_thread::get_id() != maker) return;
    if (on_main_thread() && program_exit != Exit::to_come) return;
    save_quietly(*this);
}

}  // namespace clratio
