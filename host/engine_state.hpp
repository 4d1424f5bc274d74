// What an Engine shares: private to the library.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <thread>

#include "clratio/engine.hpp"
#include "opencl.hpp"

namespace clratio {

struct Engine::State {
    ~State();  ///< keeps binaries of programs built here in the disk cache: not while anyone waits for a result

    std::thread::id maker = std::this_thread::get_id();  ///< the only thread that keeps them

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

/// Of an engine that the program exits with, binaries are kept then, while the driver is whole: its static parts may go
/// before a static engine.
void save_at_exit(const std::shared_ptr<Engine::State>& state);

/// The program of kernels/WORD.cl: from memory, from the disk cache, or built now.
Program program(Engine::State& state, const std::string& word, int width, const std::string& options);

}  // namespace clratio
