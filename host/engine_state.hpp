// What an Engine shares: private to the library.
#pragma once

#include <map>
#include <mutex>
#include <thread>

#include "clratio/engine.hpp"
#include "opencl.hpp"

namespace clratio {

struct Engine::State {
    Context context;
    Queue queue;
    cl_device_id device = nullptr;
    DeviceInfo info;
    EngineOptions options;
    int width = 1;
    int wide = 1;  ///< lanes of kernels whose every value is one long chain: two vectors in step where that pays
    bool grouped = false;
    std::uint32_t work_items = 1;

    std::mutex mutex;
    struct Built {
        Program program;
        bool unsaved;
    };
    std::map<std::string, Built> programs;  ///< by word, width and build options
    std::vector<std::jthread> savers;       ///< write binaries to the disk cache; joined before the programs go
};

/// The program of kernels/WORD.cl: from memory, from the disk cache, or built now.
Program program(Engine::State& state, const std::string& word, int width, const std::string& options);

/// Where this process built the program: once `first` is done, keeps its binary on disk, in the background.
void save_program(Engine::State& state, const std::string& word, int width, const std::string& options, const Event& first);

}  // namespace clratio
