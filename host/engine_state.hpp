// What an Engine shares: private to the library.
#pragma once

#include <map>
#include <mutex>

#include "clratio/engine.hpp"
#include "opencl.hpp"

namespace clratio {

struct Engine::State {
    ~State();  ///< keeps binaries of programs built here in the disk cache: not while anyone waits for a result

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
        std::string unsaved;  ///< the key in the disk cache, where it is not there yet
    };
    std::map<std::string, Built> programs;  ///< by word, width and build options
};

/// The program of kernels/WORD.cl: from memory, from the disk cache, or built now.
Program program(Engine::State& state, const std::string& word, int width, const std::string& options);

}  // namespace clratio
