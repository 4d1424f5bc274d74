// A state to disk and back: bytes/s beside a plain file of as many bytes, written, synced and read.
#include <fcntl.h>
#include <unistd.h>

#include <filesystem>

#include "clratio/state.hpp"
#include "support/device.hpp"

using namespace clratio;

namespace {

/// Random words: low parts of sums are noise, so nothing here compresses.
StateFile state_of(int width, int height) {
    StateFile s;
    s.shape.channels = {"R", "G", "B"};
    s.shape.data_window = {0, 0, width - 1, height - 1};
    Moments sum(Engine{}, 3 * static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height));
    std::vector<float> m(sum.size()), t(sum.size());
    std::uint32_t draw = 1;
    for (std::size_t i = 0; i < m.size(); ++i) {
        m[i] = static_cast<float>((draw = draw * 747796405u + 2891336453u) >> 8) * 0x1p-24f;
        t[i] = 1 + m[i] * m[i];
    }
    for (int k = 1; k <= 2; ++k) sum.add(m, t, k);
    s.sums = sum.snapshot();
    s.ranges.add({0, 2});
    return s;
}

class Folder {
public:
    Folder() : path_(std::filesystem::temp_directory_path() / ("clratio-bench-" + std::to_string(getpid()))) {
        std::filesystem::create_directory(path_);
    }
    ~Folder() { std::filesystem::remove_all(path_); }
    std::filesystem::path operator/(const char* name) const { return path_ / name; }

private:
    std::filesystem::path path_;
};

std::uint64_t bytes_of(const StateFile& s) { return 4 * s.sums.values * s.sums.planes.size(); }

void report(benchmark::State& state, const StateFile& s) {
    state.SetBytesProcessed(static_cast<std::int64_t>(bytes_of(s)) * static_cast<std::int64_t>(state.iterations()));
}

void write(benchmark::State& state) {
    const Folder folder;
    const StateFile s = state_of(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
    for (auto _ : state) write_state(folder / "state.exr", s);
    report(state, s);
}

void read(benchmark::State& state) {
    const Folder folder;
    const StateFile s = state_of(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
    write_state(folder / "state.exr", s);
    for (auto _ : state) benchmark::DoNotOptimize(read_state(folder / "state.exr"));
    report(state, s);
}

void plain_file(benchmark::State& state) {
    const Folder folder;
    const StateFile s = state_of(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
    std::vector<std::uint32_t> back(s.sums.values);
    const std::size_t bytes = 4 * back.size();
    for (auto _ : state) {
        const int file = open((folder / "plain").c_str(), O_RDWR | O_CREAT | O_TRUNC, 0600);
        bool good = file >= 0;
        for (const auto& plane : s.sums.planes)
            for (std::size_t done = 0; good && done < bytes;) {
                const auto* from = reinterpret_cast<const char*>(plane.words.data()) + done;
                const ssize_t wrote = ::write(file, from, bytes - done);
                good = wrote > 0;
                done += static_cast<std::size_t>(wrote);
            }
        good = good && fsync(file) == 0 && lseek(file, 0, SEEK_SET) == 0;
        for (std::size_t p = 0; good && p < s.sums.planes.size(); ++p) good = ::read(file, back.data(), bytes) > 0;
        close(file);
        if (!good) state.SkipWithError("a plain file cannot be written");
    }
    report(state, s);
}

void sizes(benchmark::internal::Benchmark* b) {
    b->Args({1920, 1080})->Args({3840, 2160})->Unit(benchmark::kMillisecond)->UseRealTime();
}

}  // namespace

BENCHMARK(plain_file)->Apply(sizes);
BENCHMARK(write)->Apply(sizes);
BENCHMARK(read)->Apply(sizes);
